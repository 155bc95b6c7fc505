"""The climb from near the maximum of the likelihood to the maximum itself."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .. import _core
from .._common.arrays import FloatArray, as_float64
from .._common.threads import in_parallel
from .objective import LinearRows, Objective
from .search import Box, minimise, stride
from .settle import moved, risen

_GAIN = 0.05  # nats, below which a step is the last one
_STANDS = 0.5  # nats that noise gains, of which parameters add a tenth, or so
_TWICE = 2.0  # times what a step gained, from where a maximum is out of reach
_CLIMBS = 20  # steps
_ROUGHLY = 0.1  # of what a step promises, to which the search for its end goes
_NUDGE = 0.02  # standard errors by which the likelihood is differentiated
_NARROW = 0.01  # of the box, which is narrower than that for what the data do not tell
_SHARES = (1.0, 0.5)  # of a step, tried until the likelihood rises
_SLIGHT = 1e-6  # damping at which a step shows what is to be had
_TINY = 1e-300
_STIFF = 1e3  # root of nats


def climb(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box
) -> tuple[FloatArray, float, float]:
    """From where searches with frozen gains stand still to the maximum of the likelihood itself.

    The noise stays as it is.

    Parameters
    ----------
    objective : Objective
    p : array, shape (parameters,)
    noise : array, shape (noises,)
    box : Box

    Returns
    -------
    p : array, shape (parameters,)
    begin, reached : float
        Log-likelihoods of the start and there, priors included; the second is never the lower one.
    """
    begin = value = objective.log_likelihood(p, noise)
    for _ in range(_CLIMBS):
        p, reached, _ = _uphill(objective, p, noise, box)
        gained, value = reached - value, reached
        if gained < _GAIN:
            break
    return p, begin, value


def to_the_top(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box, *, least: float = -np.inf
) -> tuple[FloatArray, FloatArray, bool]:
    """Parameters and noise of the maximum, from where they are near.

    Neither is searched to its end while the other is not there: what one of them gains is lost
    again when the other moves.

    Parameters
    ----------
    objective : Objective
    p : array, shape (parameters,)
    noise : array, shape (noises,)
    box : Box
    least : float
        Log-likelihood, priors included, below which the maximum is of no use: where the last step
        leaves far more than it gained to that the search ends.

    Returns
    -------
    p : array, shape (parameters,)
    noise : array, shape (noises,)
    converged : bool
        Whether steps of both gained next to nothing.
    """
    value, astray = objective.log_likelihood(p, noise), False
    for _ in range(_CLIMBS):
        begin = value
        if not astray:
            p, value, astray = _uphill(objective, p, noise, box)
        if astray:
            p, gains = moved(objective, p, noise, box, rounds=8)
            value = objective.reached(p, gains)
        climbed = value - begin
        learned = objective.learn_noise(p, noise, rounds=1, enough=_GAIN).noise
        reached = objective.log_likelihood(p, learned)
        if reached > value:
            noise, value = learned, reached
        if climbed < _GAIN and value < begin + (_GAIN if astray else _STANDS):
            return p, noise, True
        if value + _TWICE * (value - begin) < least:
            break
    return p, noise, False


def _uphill(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box
) -> tuple[FloatArray, float, bool]:
    """Parameters where the likelihood is higher, if it rises at all, and how high it is there.

    The gains, and the spread that they predict, change with the parameters. Derivatives with frozen
    gains leave that out: they vanish elsewhere. In a flat valley, as that of tyres whose B C D is
    the same, this is far from the maximum, often with a parameter at its bound. Here the part that
    they leave out is worked out by differences and added to them, as a slope that stays as it is
    during a search (first-order model management: Alexandrov et al., AIAA 2000-4886).

    Returns
    -------
    p : array, shape (parameters,)
    log_likelihood : float
    astray : bool
        Whether the search led to where the likelihood is lower.
    """

    def values_at(trials: FloatArray) -> FloatArray:
        return objective.log_likelihoods(trials, noise)

    gains = objective.freeze(p, noise)
    value = objective.reached(p, gains)
    _, seen, information = objective.normal_equations(p, gains, box.columns)
    slope = _slope(values_at, p, information, box)
    x = p[box.columns]
    _, promised = stride(x, slope, information, _SLIGHT, box)
    if promised < _GAIN:
        return p, value, False
    leaning = objective.also(_leaning(p, slope - seen, box))
    enough = max(_GAIN, _ROUGHLY * promised)
    found = minimise(leaning, p, gains, box, rounds=8, tolerance=enough)
    best, there = risen(objective, p, gains, found.x, noise, box, shares=_SHARES)
    return best, objective.reached(best, there), best is p


def _leaning(p: FloatArray, slope: FloatArray, box: Box) -> LinearRows:
    """A residual whose half square falls by that slope, and hardly bends."""
    rows = np.zeros((1, p.size))
    rows[0, box.columns] = slope / _STIFF
    return LinearRows(rows, as_float64(rows @ p + _STIFF))


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
    central = -(-2 * len(x) // _core.LANES) == -(-(len(x) + 1) // _core.LANES)
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
