"""From where searches with frozen gains stand still to the maximum of the likelihood itself.

The gains, and the spread that they predict, change with the parameters. Derivatives with frozen
gains leave that out: they vanish elsewhere. In a flat valley, as that of tyres whose B C D is the
same, this is far from the maximum, often with a parameter at its bound. Here the part that they
leave out is worked out by differences and added to them, as a slope that stays as it is during a
search (first-order model management: Alexandrov et al., AIAA 2000-4886). That search sees nothing
of how fast the part changes: where parameters can copy each other it goes so far along their valley
that the likelihood falls, be the slope tens of nats. From there on steps are damped, and the
likelihood itself tells how much.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ..._common.threads import in_parallel
from .objective import LinearRows, Objective
from .search import SLIGHT, Box, minimise, stride
from .settle import risen

_GAIN = 0.05  # nats
_STANDS = 0.5  # nats
_CLIMBS = 10  # steps
_CLIMBED, _STEPS = 22, 2  # times, with noise learned anew, of so many steps each
_NUDGE = 0.02  # standard errors by which the likelihood is differentiated
_NARROW = 0.01  # of the box, which is narrower than that for what the data do not tell
_TINY = 1e-300
_DAMPINGS = (1e-3, 0.01, 0.03, 0.1, 0.3, 1.0, 10.0, 100.0)  # of steps tried together
_STIFF = 1e3  # root of nats
FAR_BELOW = 20.0
"""Nats below another maximum, from where neither a lag nor noise of another time climbs up to it.

Of 36 lags that began at their typical size (exam at 100 Hz, seed 424201) those more than 50 below
on few samples ended 60 or more below on all. From where they settle climbs take lags and such noise
up by 1 to 4 nats on two measured cars, effects of sensors by up to 97, several effects together by
up to 260: those are not given up for so little. This is effort of the search: what is claimed of a
model that was fitted is asked of `Rules`.
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
    box : Box
    steps : int
        Most steps.

    Returns
    -------
    p : array, shape (parameters,)
    begin, reached : float
        Log-likelihoods of the start and there, priors included; the second is never the lower one.
    """
    p, begin, reached, _ = _climbed(objective, p, noise, box, steps, False)
    return p, begin, reached


def _climbed(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box, steps: int, astray: bool
) -> tuple[FloatArray, float, float, bool]:
    """As `climb`; the last, in and out, is whether searches are led astray here."""

    def values_at(trials: FloatArray) -> FloatArray:
        return objective.log_likelihoods(trials, noise)

    gains = objective.freeze(p, noise)
    begin = value = objective.reached(p, gains)
    for _ in range(steps):
        _, seen, information = objective.normal_equations(p, gains, box.columns)
        x = p[box.columns]
        slope = _slope(values_at, p, information, box)
        if stride(x, slope, information, SLIGHT, box)[1] < _GAIN:
            break
        least = value + _GAIN
        if not astray:
            leaning = objective.also(_leaning(p, slope - seen, box))
            found = minimise(leaning, p, gains, box, rounds=8, tolerance=_GAIN)
            p, gains = risen(objective, p, gains, found.x, noise, box)
            value = objective.reached(p, gains)
            astray = value < least
        if astray:
            p, gains = _damped(objective, p, gains, noise, (slope, information), box)
            value = objective.reached(p, gains)
        # Damped steps that gain little creep, and hardly any are worth what they cost.
        if value < least + (_STANDS - _GAIN if astray else 0.0):
            break
    return p, begin, value, astray


def _damped(
    objective: Objective,
    p: FloatArray,
    gains: Any,
    noise: FloatArray,
    linear: tuple[FloatArray, FloatArray],
    box: Box,
) -> tuple[FloatArray, Any]:
    """The best of steps damped more and more, if it gains: the likelihood says how far to go.

    All go through the filter together, in its lanes.

    Parameters
    ----------
    linear : (slope, information)
        Of the likelihood by the free parameters, and its Gauss-Newton matrix.
    """
    ways = [stride(p[box.columns], *linear, damping, box)[0] for damping in _DAMPINGS]
    trials = box.put(p, np.array(ways))
    values = objective.log_likelihoods(trials, noise)
    least = objective.reached(p, gains)
    if not values.max() > least:
        return p, gains
    best = trials[int(np.argmax(values))]
    there = objective.freeze(best, noise)
    return (best, there) if objective.reached(best, there) > least else (p, gains)


def _leaning(p: FloatArray, slope: FloatArray, box: Box) -> LinearRows:
    """A residual whose half square falls by that slope, and hardly bends."""
    rows = np.zeros((1, p.size))
    rows[0, box.columns] = slope / _STIFF
    return LinearRows(rows, as_float64(rows @ p + _STIFF))


def to_the_top(
    objective: Objective,
    p: FloatArray,
    noise: FloatArray,
    box: Box,
    goes_on: Callable[[FloatArray, FloatArray], bool] = lambda *_: True,
) -> tuple[FloatArray, FloatArray]:
    """Parameters and noise of the maximum, from where `settle` came to a stand.

    Neither is searched to its end while the other is not there.

    Parameters
    ----------
    objective : Objective
    p : array, shape (parameters,)
    noise : array, shape (noises,)
    box : Box
    goes_on : callable, optional
        From parameters and noise on the way to whether they are worth climbing from.

    Returns
    -------
    p : array, shape (parameters,)
    noise : array, shape (noises,)
    """
    astray = False
    for _ in range(_CLIMBED):
        p, begin, reached, astray = _climbed(objective, p, noise, box, _STEPS, astray)
        noise = objective.learn_noise(p, noise, rounds=1).noise
        if reached < begin + _STANDS or not goes_on(p, noise):
            break
    return p, noise


def _slope(
    values_at: Callable[[FloatArray], FloatArray],
    p: FloatArray,
    information: FloatArray,
    box: Box,
) -> FloatArray:
    """Derivatives by differences; zero where the model fails.

    Central ones where both ends of all parameters go through the filter together, in its lanes. Of
    more parameters from `p` to one end, less what the likelihood bends on the way. The value at `p`
    comes out of the same lanes: one that was rounded in another way would give a slope to what the
    driving never felt, and send it to its bound.
    """
    curvature = np.diag(information)
    step = np.minimum(_NUDGE / np.sqrt(np.maximum(curvature, _TINY)), _NARROW * box.width)
    x = p[box.columns]
    low, high = np.maximum(x - step, box.lower), np.minimum(x + step, box.upper)
    central = 2 * len(x) <= _core.LANES
    far = np.where(high - x < x - low, low, high)
    ends = np.array([low, high] if central else [far])
    trials = np.tile(p, (len(ends), len(x), 1))
    trials[:, np.arange(len(x)), box.columns] = ends
    trials = np.vstack([trials.reshape(-1, p.size), *([] if central else [p])])
    together = np.array_split(trials, -(-len(trials) // _core.LANES))
    found = np.concatenate(in_parallel(values_at, together))
    if central:
        slope = (found[len(x) :] - found[: len(x)]) / np.maximum(high - low, _TINY)
    else:
        way = far - x
        slope = (found[:-1] - found[-1]) / np.where(way == 0.0, _TINY, way) + 0.5 * curvature * way
    return as_float64(np.where(np.isfinite(slope), slope, 0.0))
