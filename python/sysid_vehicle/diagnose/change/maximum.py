"""Maxima of a likelihood under given noise: the nearest one, and others over a delay."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from ..._common.arrays import FloatArray
from ...errors import NumericalError
from ...identify.search.objective import Objective
from ...identify.search.search import Box
from ...identify.search.settle import moved
from ...identify.search.starts import SAME_VALLEY

_REFREEZES = 6
_ENOUGH = 0.05  # nats that a step gains
_ROUGH = 1.0  # the same where several searches are compared on their way
_HOPELESS = 1e-3  # of what a search lacks to the best one: a step that gains less is its end
_WALKS, _STEPS = 3, 8  # along a parameter, by its usual size in so many steps to either side


def along(
    objective: Objective,
    p: FloatArray,
    value: float,
    column: int,
    size: float,
    noise: FloatArray,
    box: Box,
) -> tuple[FloatArray, float]:
    """From the end of a search on, past other maxima over one parameter.

    Inputs are straight between samples: over a delay the likelihood has a kink at each of them.
    """
    for _ in range(_WALKS):
        sets = np.repeat(p[None, :], 2 * _STEPS + 1, axis=0)
        sets[:, column] += size * np.arange(-_STEPS, _STEPS + 1) / _STEPS
        sets = np.array([box.inside(q) for q in sets])
        values = objective.log_likelihoods(sets, noise)
        best = int(np.argmax(values))
        if not values[best] > value + _ENOUGH:
            break
        there, reached = highest(objective, sets[best], noise, box)
        if reached <= value:
            break
        p, value = there, reached
    return p, value


def highest(
    objective: Objective,
    p: FloatArray,
    noise: FloatArray,
    box: Box,
    *,
    enough: float = _ENOUGH,
    best: float = -np.inf,
) -> tuple[FloatArray, float]:
    """The end of a search under given noise, and its log-likelihood.

    What lacks thousands of nats to the best known log-likelihood need not be told to hundredths of
    one: most of the way to such ends is along flat valleys.
    """
    value = objective.log_likelihood(p, noise)
    for _ in range(_REFREEZES):
        tolerance = max(enough, _HOPELESS * (best - value))
        p, gains = moved(objective, p, noise, box, tolerance=tolerance)
        before, value = value, objective.reached(p, gains)
        if value < before + max(enough, _HOPELESS * (best - value)):
            break
    return p, value


def highest_of(
    objective: Objective,
    starts: Sequence[FloatArray],
    noise: FloatArray,
    box: Box,
    *,
    best: float = -np.inf,
    every: bool = False,
) -> list[tuple[FloatArray, float]]:
    """Ends of searches from several starts, the likeliest first.

    All are followed roughly; what falls behind then, or came to the same end, is not followed on.
    Over a delay there are many ends, and what falls behind may be near a better one: `every`.
    """
    if len(starts) == 1:
        return [highest(objective, starts[0], noise, box, best=best)]
    rough = []
    for start in starts:
        with suppress(NumericalError, np.linalg.LinAlgError):
            rough.append(highest(objective, start, noise, box, enough=_ROUGH, best=best))
    rough.sort(key=lambda end: -end[1])
    ends: list[tuple[FloatArray, float]] = []
    for p, value in rough:
        top = rough[0][1]
        least = top - max(2.0 * _ROUGH, _HOPELESS * (best - top))
        behind = value < least and not every
        if behind or any(box.near(p, q, SAME_VALLEY) for q, _ in ends):
            continue
        with suppress(NumericalError, np.linalg.LinAlgError):
            ends.append(highest(objective, p, noise, box, best=best))
    return sorted(ends, key=lambda end: -end[1])
