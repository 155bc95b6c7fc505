"""Searches from many ends on: by noise learned anew, and along the tyres that look alike."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from ..._common.arrays import FloatArray
from .objective import Objective
from .search import Box, minimise
from .settle import descend, settle
from .starts import SAME_OPTIMUM, Runner
from .tyre_shape import look_alike

_ALTERNATIONS = 3
_CURVATURES = (-1.0, 0.0, 0.4, 0.8)
_SIDES = ((0,), (4,), (0, 4))  # where the coefficients of the axles that are moved begin
_TASTE = 5  # steps that tell whether a valley is worth going down
_WORTH = 0.1  # nats
_WALKS = 4
_HOPELESS = 15.0  # nats above, after the taste
_TRIED = 4
_APART = 0.02  # of the box's width


def alternate(
    objective: Objective,
    ends: FloatArray,
    values: FloatArray,
    noise: FloatArray,
    runner: Runner,
    *,
    method: str,
) -> tuple[FloatArray, FloatArray, FloatArray, list[FloatArray]]:
    """Go on from the ends of quicker searches, by the noise learned at the best of them.

    The noise learned at a poor end hides better ones: it is learned again as ends get better. To
    walk along the tyres that look alike takes long, and is for ends that are as good as they get
    without.

    Parameters
    ----------
    objective : Objective
    ends : array, shape (starts, parameters)
    values : array, shape (starts,)
        By which the best of them is told.
    noise : array, shape (noises,)
    runner : Runner
    method : str
        Local optimiser.

    Returns
    -------
    ends : array, shape (starts, parameters)
    values : array, shape (starts,)
        Log-likelihoods.
    noise : array, shape (noises,)
    others : list of array
        Other optima than the best end, for a closer look.
    """
    box = runner.box
    others: dict[float, list[FloatArray]] = {}

    def walked(p: FloatArray) -> tuple[FloatArray, float]:
        end, value, found = walk(objective, p, noise, box)
        others[value] = found
        return end, value

    for _ in range(_ALTERNATIONS):
        best = ends[int(np.argmax(values))]
        _, noise, _ = settle(objective, best, noise, box, method=method, parameters_first=True)
        go = partial(descend, objective, noise=noise, box=box, method=method)
        ends, values = runner.all_of(go, ends)
        before = float(np.max(values))
        ends, values = runner.all_of(walked, ends)
        if np.max(values) < before + SAME_OPTIMUM:
            break
    return ends, values, noise, others.get(float(np.max(values)), [])


def looking_alike(p: FloatArray) -> Iterator[FloatArray]:
    """Points with tyres of other curvature, but of the same stiffness and peak, at either axle."""
    for sides in _SIDES:
        for e in _CURVATURES:
            trial = p.copy()
            for first in sides:
                trial[first : first + 4] = look_alike(p[first : first + 4], e)
            yield trial


def walk(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box
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
    value = objective.log_likelihood(p, noise)
    for _ in range(_WALKS):
        found = valleys(objective, p, noise, box)
        if not found or found[0][1] < value + _WORTH:
            return p, value, [end for end, _ in found]
        others = [p, *(end for end, _ in found[1:])]
        p, value = found[0]
    return p, value, others


def valleys(
    objective: Objective, p: FloatArray, noise: FloatArray, box: Box
) -> list[tuple[FloatArray, float]]:
    """Other optima among the tyres of the same stiffness and peak but of other curvature.

    Along these the likelihood has several minima that only a small bend of the tyre curve tells
    apart, too far from each other for a local search.

    Returns
    -------
    list of (parameters, log-likelihood)
        Best first; none that is `p` itself.
    """
    gains = objective.freeze(p, noise)
    here = objective.half_sum_of_squares(p, gains)
    tasted = []
    for trial in looking_alike(p):
        found = minimise(objective, trial, gains, box, rounds=_TASTE)
        trial = box.put(trial, found.x)
        if found.cost < here + _HOPELESS and not box.near(trial, p, _APART):
            tasted.append((found.cost, trial))
    ends: list[tuple[FloatArray, float]] = []
    tried: list[FloatArray] = [p]
    for _, trial in sorted(tasted, key=lambda one: one[0])[:_TRIED]:
        if any(box.near(trial, other, _APART) for other in tried):
            continue
        there, value = descend(objective, trial, noise, box)
        if not any(box.near(there, other, _APART) for other in tried):
            ends.append((there, value))
        tried += [trial, there]
    return sorted(ends, key=lambda one: -one[1])
