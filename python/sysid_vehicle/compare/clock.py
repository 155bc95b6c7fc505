"""Whether a fitted model finds the steering angle on time, where a law of motion says otherwise.

The law (`log/laws/steering.py`) knows no car. What pushes an axle, and the driver who answers to
it, can look like a lag of the steering there; a fitted model tells pushes from forces of tyres.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from .._common.arrays import FloatArray, as_float64
from ..estimate import Driving, NoiseModel
from ..model import Model

_MOST = 1 << 15  # samples, more than which tell nothing else
_SMALL = 1e-3  # of the steering angle, to differentiate by
_SURE = 3.0  # standard errors
_CLOSER = 4.0  # disturbances take up as much of a true lag: the first order finds the rest of it


def steering_on_time(driving: Driving, model: Model, noise: NoiseModel, late_s: float) -> bool:
    """Whether the likelihood has no lag of the steering angle where one so long would show.

    Parameters
    ----------
    driving : Driving
        Of one log.
    model : Model
        With fitted values; its free parameters may be others here.
    noise : NoiseModel
    late_s : float
        Lag in doubt.

    Returns
    -------
    bool
        Whether the lag is less than three standard errors off nothing, and these less than a
        quarter of `late_s`.
    """
    found = [_lag(part, model, noise) for part in _parts(driving)]
    precision = sum(std**-2 for _, std in found)
    if not precision > 0.0:
        return False
    size = sum(lag * std**-2 for lag, std in found) / precision
    sure = _SURE * precision**-0.5
    return bool(abs(size) <= sure and _CLOSER * sure < abs(late_s))


def _parts(driving: Driving) -> list[Driving]:
    """Its stretches, up to as many samples as tell enough."""
    parts, left = [], _MOST
    for s in driving.stretches:
        count = min(s.where.stop - s.where.start, left)
        if count > 1:
            where = slice(s.where.start, s.where.start + count)
            parts.append(driving.only(replace(s, where=where)))
        left -= count
    return parts


def _lag(driving: Driving, model: Model, noise: NoiseModel) -> tuple[float, float]:
    """By how much the steering angle is late, to first order, and its standard error [s]."""
    problem, p = driving.problem(model), model.vector()
    gains: Any = problem.freeze(p, noise.vector())
    left = problem.residuals(p, gains).ravel()
    free = [model.parameters[name].column for name in model.free_names]
    basis = scipy.linalg.orth(problem.sensitivities(p, gains, free)) if free else None

    def beside_the_parameters(column: FloatArray) -> FloatArray:
        return column if basis is None else as_float64(column - basis @ (basis.T @ column))

    inputs = driving.inputs()
    # From the last sample to this one: what the driver does next answers to this residual.
    rise = np.diff(inputs[:, 0], prepend=inputs[0, 0]) * driving.logs[0].rate_hz
    spread = float(np.std(rise))
    if spread <= 0.0:
        return 0.0, np.inf
    step_s = _SMALL * float(np.std(inputs[:, 0])) / spread
    sooner = inputs.copy()
    sooner[:, 0] += step_s * rise
    moved = driving.problem(model, other_inputs=sooner).residuals(p, gains).ravel()
    direction = beside_the_parameters(as_float64(left - moved) / step_s)
    power = float(direction @ direction)
    if power <= 0.0:
        return 0.0, np.inf
    return float(direction @ beside_the_parameters(left)) / power, power**-0.5
