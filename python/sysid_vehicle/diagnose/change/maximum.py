"""Maxima of a likelihood under given noise: the nearest one, and others over a delay."""

from __future__ import annotations

import numpy as np

from ..._common.arrays import FloatArray
from ...identify.objective import Objective
from ...identify.search import Box
from ...identify.settle import moved

_REFREEZES = 4
_ENOUGH = 0.05  # nats that a step gains
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
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box
) -> tuple[FloatArray, float]:
    """The end of a search under given noise, and its log-likelihood."""
    best = -np.inf
    for _ in range(_REFREEZES):
        p, gains = moved(objective, p, noise, box, tolerance=_ENOUGH)
        before, best = best, objective.reached(p, gains)
        if best < before + _ENOUGH:
            break
    return p, best
