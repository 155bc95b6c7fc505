"""What noise of the measured inputs costs a fit.

A model takes the steering angle and the wheel force for exact. Their noise acts on its predictions,
and less of it where a lag filters it: of two models that answer late by the same time, one with a
lag and one with a delay, the lag is the likelier one whichever the car has. So models are compared
by the likelihood that they would have with exact inputs: with as much noise once more it falls by
as much as it has fallen already (simulation and extrapolation, Cook & Stefanski, JASA 1994).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .._common.arguments import generator
from .._common.memo import remembered
from ..errors import NumericalError
from ..estimate import Driving, again, noisier
from .fit import Fit
from .offsets import driving_of


@remembered(64)
def lost_to_input_noise(fit: Fit, driving: Driving) -> float:
    """Log-likelihood that noise of the measured inputs takes from a fit [nats]; 0 where it fails.

    With gains of the fit, noise moves its whitened residuals by d, and takes d'd / 2 on average.

    Parameters
    ----------
    fit : Fit
    driving : Driving
        Its own, or other driving.
    """
    own = driving if driving is fit.driving else driving_of(fit, driving)
    problem, p = own.problem(fit.model), fit.model.vector()
    noise = again(own, generator(0))  # the same for all models
    other = own.problem(fit.model, other_inputs=noisier(own, own.inputs(), noise))
    try:
        gains: Any = problem.freeze(p, fit.noise.vector())
        moved = other.residuals(p, gains) - problem.residuals(p, gains)
    except NumericalError:
        return 0.0
    return 0.5 * float(np.sum(moved**2))


def with_exact_inputs(fit: Fit) -> float:
    """The log-likelihood that a fit would have with exact inputs."""
    return fit.log_likelihood + lost_to_input_noise(fit, fit.driving)
