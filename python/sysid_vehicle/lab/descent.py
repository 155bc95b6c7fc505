"""One search for the tyres of greatest likelihood, and its way along the tyres that look alike."""

from __future__ import annotations

from typing import cast

import numpy as np

from .. import _core
from .._arrays import FloatArray
from ..identify.search import Box, Outcome, minimise
from .likelihood import Likelihood, learn_noise
from .tyre_shape import look_alike
from .valley import down_the_valley

__all__ = ["bottom", "descend", "minimum", "settle", "settle_finely", "valleys", "walk"]

_SETTLED = 0.5
_ROUNDS = 12
_CURVATURES = (-1.0, 0.0, 0.4, 0.8)
_SIDES = ((0,), (4,), (0, 4))  # where the coefficients of the axles that are moved begin
_TASTE = 5  # steps that tell whether a valley is worth going down
_WORTH = 0.1  # nats
_WALKS = 4
_HOPELESS = 15.0  # nats above, after the taste
_TRIED = 4
_APART = 0.02  # of the box's width
_STILL = 3e-4  # nats
_REFREEZES = 8


def minimum(
    objective: Likelihood,
    p: FloatArray,
    gains: _core.FrozenGains,
    box: Box,
    *,
    method: str = "gauss-newton",
    rounds: int = 40,
    tolerance: float = 0.01,
) -> Outcome:
    """Least squares of the prediction errors, with gains that stay as they are."""
    # `minimise` asks no more of a problem than `Likelihood` gives it.
    return minimise(
        cast(_core.Problem, objective),
        p,
        cast(_core.FrozenFilter, gains),
        box,
        method=method,
        rounds=rounds,
        tolerance=tolerance,
    )


def descend(
    objective: Likelihood,
    p: FloatArray,
    noise: FloatArray,
    box: Box,
    *,
    method: str = "gauss-newton",
    refreezes: int = 2,
) -> tuple[FloatArray, float]:
    """One local search: gains are worked out anew wherever it has settled.

    Returns
    -------
    p : array, shape (parameters,)
    log_likelihood : float
        Priors included.
    """
    p = p.copy()
    for _ in range(refreezes):
        gains = objective.problem.freeze(p, noise)
        found = minimum(objective, p, gains, box, method=method)
        moved = np.abs(found.x - p[box.columns])
        p[box.columns] = found.x
        if np.all(moved < 1e-3 * (box.upper - box.lower)):
            break
    gains = objective.problem.freeze(p, noise)
    return p, gains.log_likelihood - objective.prior_cost(p)


def walk(
    objective: Likelihood, p: FloatArray, value: float, noise: FloatArray, box: Box
) -> tuple[FloatArray, float, list[FloatArray]]:
    """Leave a side valley for the best of those that `valleys` finds, again and again.

    Returns
    -------
    p : array, shape (parameters,)
    log_likelihood : float
    others : list of array
        The valleys that were found and are not better.
    """
    others: list[FloatArray] = []
    for _ in range(_WALKS):
        found = valleys(objective, p, noise, box)
        if not found or found[0][1] < value + _WORTH:
            return p, value, [end for end, _ in found]
        others = [p, *(end for end, _ in found[1:])]
        p, value = found[0]
    return p, value, others


def valleys(
    objective: Likelihood, p: FloatArray, noise: FloatArray, box: Box
) -> list[tuple[FloatArray, float]]:
    """Other optima among the tyres of the same stiffness and peak but of other curvature.

    Along these the likelihood has several minima that only a small bend of the tyre curve tells
    apart, too far from each other for a local search.

    Returns
    -------
    list of (parameters, log-likelihood)
        Best first; none that is `p` itself.
    """
    gains = objective.problem.freeze(p, noise)
    here = objective.half_sum_of_squares(p, gains)
    tasted = []
    for sides in _SIDES:
        for e in _CURVATURES:
            trial = p.copy()
            for first in sides:
                trial[first : first + 4] = look_alike(p[first : first + 4], e)
            found = minimum(objective, trial, gains, box, rounds=_TASTE)
            trial[box.columns] = found.x
            if found.cost < here + _HOPELESS and not _same(trial, p, box):
                tasted.append((found.cost, trial))
    ends: list[tuple[FloatArray, float]] = []
    tried: list[FloatArray] = [p]
    for _, trial in sorted(tasted, key=lambda one: one[0])[:_TRIED]:
        if any(_same(trial, other, box) for other in tried):
            continue
        there, value = descend(objective, trial, noise, box)
        if not any(_same(there, other, box) for other in tried):
            ends.append((there, value))
        tried += [trial, there]
    return sorted(ends, key=lambda one: -one[1])


def _same(a: FloatArray, b: FloatArray, box: Box) -> bool:
    apart = np.abs(a - b)[box.columns] / (box.upper - box.lower)
    return bool(np.all(apart < _APART))


def settle(
    objective: Likelihood, p: FloatArray, noise: FloatArray, box: Box, *, method: str
) -> tuple[FloatArray, FloatArray, float]:
    """Tyres and noise in turn until the likelihood stands still."""
    best = -np.inf
    value = -np.inf
    for _ in range(_ROUNDS):
        # Noise learned at poor tyres is large, and large noise makes poor tyres look good enough:
        # the tyres move first.
        p, _ = descend(objective, p, noise, box, method=method)
        noise, _ = learn_noise(objective.problem, p, noise)
        p, value = descend(objective, p, noise, box, method=method)
        if value < best + _SETTLED:
            break
        best = value
    return p, noise, value


def bottom(
    objective: Likelihood, p: FloatArray, noise: FloatArray, box: Box
) -> tuple[FloatArray, float]:
    """From near an optimum to the optimum itself, to a thousandth of a nat.

    `descend` ends where steps gain little, which in a valley of tyres that look alike may be a nat
    above its bottom: near enough to tell starts apart, too far to call it the maximum.

    Returns
    -------
    p : array, shape (parameters,)
    log_likelihood : float
        Priors included.
    """
    gains = objective.problem.freeze(p, noise)
    value = gains.log_likelihood - objective.prior_cost(p)
    for _ in range(_REFREEZES):
        trial = down_the_valley(objective, p, gains, box)
        gains = objective.problem.freeze(trial, noise)
        reached = gains.log_likelihood - objective.prior_cost(trial)
        if reached > value:
            p = trial
        if reached < value + _STILL:
            return p, max(value, reached)
        value = reached
    return p, value


def settle_finely(
    objective: Likelihood, p: FloatArray, noise: FloatArray, box: Box, value: float
) -> tuple[FloatArray, FloatArray, float]:
    """Tyres and noise to the bottom of the valley that `settle` has found."""
    for _ in range(_ROUNDS):
        p, _ = bottom(objective, p, noise, box)
        noise, _ = learn_noise(objective.problem, p, noise)
        before = value
        value = objective.problem.freeze(p, noise).log_likelihood - objective.prior_cost(p)
        if value < before + _STILL:
            break
    return p, noise, value
