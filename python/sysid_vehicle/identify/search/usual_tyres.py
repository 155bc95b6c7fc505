"""Whether tyres of usual shape lead to a better maximum than the tyres that a search ended at.

The search begins with disturbances that are taken to be large, and these explain what poor tyres
leave: it may end at tyres that no car has, for whose faults slow forces make up. Noise is learned
to suit them, and no search leads back. Their cornering stiffness is right even so: tyres of the
same stiffness and of usual shape, with noise learned anew, are another place to begin at. Of a
complete model the disturbances come out small, and nothing has to be asked.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..._common.arrays import FloatArray
from ...errors import NumericalError
from ...estimate.noise import DISTURBANCE
from .objective import Objective
from .search import SLIGHT, Box, stride
from .settle import settle
from .starts import SAME_VALLEY
from .tyre_shape import of_usual_shape

_SMALL = 0.1  # of what disturbances are first taken to be: these hide no tyre
_MORE = 10.0  # nats: what one maximum gains on few samples by being fitted to them alone
_ROUNDS = 4  # of the noise
_TWICE = 2.0  # times what a step of the parameters promises
_AXLES = (slice(0, 4), slice(4, 8))


def from_usual_tyres(
    objective: Objective,
    found: tuple[FloatArray, FloatArray],
    noise: FloatArray,
    box: Box,
    thin: Sequence[Objective] = (),
) -> tuple[FloatArray, FloatArray, bool] | None:
    """Where a search from tyres of usual shape comes to a stand, if that is another maximum.

    Parameters
    ----------
    objective : Objective
    found : (p, noise)
        Of the maximum that is known.
    noise : array, shape (noises,)
        With which the search began.
    box : Box
    thin : sequence of Objective
        The same on fewer samples, the fewest first; these decide whether more are asked.
    """
    if np.all(found[1][DISTURBANCE] <= _SMALL * noise[DISTURBANCE]):
        return None
    usual = found[0].copy()
    for axle in _AXLES:
        usual[axle] = of_usual_shape(usual[axle])
    begin = found[0].copy()
    begin[box.columns] = usual[box.columns]
    begin = box.inside(begin)
    if box.near(begin, found[0], SAME_VALLEY):
        return None
    few, *more = *thin, objective
    try:
        least = few.log_likelihood(*found) + _MORE
        learned = few.learn_noise(begin, noise, rounds=_ROUNDS)
        gains = few.freeze(begin, learned.noise)
        _, slope, information = few.normal_equations(begin, gains, box.columns)
        _, promised = stride(begin[box.columns], slope, information, SLIGHT, box)
        if learned.log_likelihood + _TWICE * promised < least:
            return None
        p, told, converged = settle(few, begin, learned.noise, box)
        if few.log_likelihood(p, told) < least:
            return None
        for some in more:
            p, told, converged = settle(some, p, told, box)
    except (NumericalError, np.linalg.LinAlgError):
        return None
    return p, told, converged
