"""From where searches with frozen gains stand still to the maximum of the likelihood itself.

The gains, and the spread that they predict, change with the parameters. Derivatives with frozen
gains leave that out: they vanish elsewhere. In a flat valley, as that of tyres whose B C D is the
same, this is far from the maximum, often with a parameter at its bound. Here the slope of the
likelihood itself is worked out by differences. Nor do parameters and noise stand by themselves:
disturbances take up what a model does not explain, and a search that moves one and the other in
turn creeps along the valley of both. Here they move together. The curvature to begin with is that
of the frozen gains and of the score of the noise; the slopes that are met on the way correct it
(BFGS, damped: Nocedal & Wright, Numerical Optimization, 2006, 6.1 and 18.3). Steps are damped as
much as the likelihood itself asks for.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from .objective import Objective
from .quasi_newton import Met, Trials
from .search import SLIGHT, Box, stride
from .ways import GAIN, Place, Ways

_STANDS = 0.5  # nats that two steps gain: with less it stands still
_CLIMBS, _TOP = 10, 40  # most steps
_ASKED = 3  # steps after which it is asked whether to go on
_FIRST = 4  # of the dampings
_FREER = 0.2  # root of how much less the noise is damped than parameters are
# Times what a step promises that is not to be had any more, by the best of the last few. Of 16
# climbs of exchanges on a handling course that some package simulated none gained more than 4.1.
_REACH, _LAST = 5.0, 3
FAR_BELOW = 20.0
"""Nats below another maximum, from where neither a lag nor noise of another time climbs up to it.

Of 36 lags that began at their typical size (exam at 100 Hz, seed 424201) those more than 50 below
on few samples ended 60 or more below on all. From where they settle climbs take lags and such noise
up by 1 to 4 nats on two measured cars, effects of sensors by up to 97, several effects together by
up to 260, and once by 830, to where they still lacked 140: those are not given up for so little.
This is effort of the search: what is claimed of a model that was fitted is asked of `Rules`.
"""


def climb(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box, *, steps: int = _CLIMBS
) -> tuple[FloatArray, float, float]:
    """Climb by the slope of the likelihood, whose gains move with the parameters.

    Parameters
    ----------
    objective : Objective
    p : array, shape (parameters,)
    noise : array, shape (noises,)
        Which stays as it is.
    box : Box
    steps : int
        Most steps.

    Returns
    -------
    p : array, shape (parameters,)
    begin, reached : float
        Log-likelihoods of the start and there, priors included; the second is never the lower one.
    """
    begin = Place(p, noise, objective.log_likelihood(p, noise))
    ways = Ways(objective, box, np.empty(0, dtype=np.intp))
    end = _climbed(ways, begin, steps, lambda *_: True)
    return end.p, begin.value, end.value


def to_the_top(
    objective: Objective,
    p: FloatArray,
    noise: FloatArray,
    box: Box,
    goes_on: Callable[[FloatArray, FloatArray], bool] = lambda *_: True,
    least: float = -np.inf,
) -> tuple[FloatArray, FloatArray]:
    """Parameters and noise of the maximum, from where `settle` came to a stand.

    Parameters
    ----------
    objective : Objective
    p : array, shape (parameters,)
    noise : array, shape (noises,)
        What is zero is not there, and stays so.
    box : Box
    goes_on : callable, optional
        From parameters and noise on the way to whether they are worth climbing from.
    least : float
        Log-likelihood below which nobody asks for the maximum: it stops where that is out of reach.

    Returns
    -------
    p : array, shape (parameters,)
    noise : array, shape (noises,)
    """
    free = (noise > 0.0) & (objective.lowest < objective.highest)
    ways = Ways(objective, box, np.flatnonzero(free))
    noise = as_float64(np.where(free, np.clip(noise, objective.lowest, objective.highest), noise))
    begin = Place(p, noise, objective.log_likelihood(p, noise))
    end = _climbed(ways, begin, _TOP, goes_on, least)
    return end.p, end.noise


def _climbed(
    ways: Ways,
    here: Place,
    steps: int,
    goes_on: Callable[[FloatArray, FloatArray], bool],
    least: float = -np.inf,
) -> Place:
    here, promised = _searched(ways, here, least)
    met, damping, before = Met(), _FIRST, np.inf
    lately: list[float] = []
    for done in range(1, steps + 1 if promised > _STANDS else 1):
        slope, curvature = ways.slope(here)
        met.meet(ways.at(here), slope)
        scale = np.sqrt(np.maximum(np.diag(curvature), 1e-12))
        scale[len(ways.box.columns) :] *= _FREER
        trials = Trials(ways, here, slope, met.corrected(curvature, scale), scale)
        lately = [*lately[1 - _LAST :], trials.promised]
        if trials.promised < GAIN or here.value + _REACH * max(lately) < least:
            break
        damping, there = trials.best(damping)
        there = ways.learned_at(there)
        gained, here = there.value - here.value, there
        if not gained > 0.0 or gained + before < _STANDS:
            break
        if done % _ASKED == 0 and not goes_on(here.p, here.noise):
            break
        before = gained
    return here


def _searched(ways: Ways, here: Place, least: float) -> tuple[Place, float]:
    """Where a search of the parameters leads, and what a step of them promised [nats].

    It follows a valley that bends, of which steps are tangents. Where `least` is out of reach
    nothing is searched, and nothing promised.
    """
    slope, information = ways.slope_of_parameters(here)
    x = here.p[ways.box.columns]
    promised = stride(x, slope, information, SLIGHT, ways.box)[1]
    if promised < GAIN:
        return here, promised
    if least > -np.inf:
        more = ways.objective.noise_promises(here.p, here.noise)
        if here.value + _REACH * (promised + more) < least:
            return here, 0.0
    return ways.learned_at(ways.led(here, slope)), promised
