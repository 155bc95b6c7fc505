"""Searches for tyres from many starts: quick ones first, then along the tyres that look alike."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from .._arrays import FloatArray, as_float64
from ..errors import NumericalError
from ..identify.objective import Objective
from ..identify.search import Box, minimise
from ..identify.settle import descend, settle
from ..identify.starts import SAME_OPTIMUM, Runner, Search, Starts
from ..identify.tyre_shape import look_alike

_CURVATURES = (-1.0, 0.0, 0.4, 0.8)
_SIDES = ((0,), (4,), (0, 4))  # where the coefficients of the axles that are moved begin
_TASTE = 5  # steps that tell whether a valley is worth going down
_WORTH = 0.1  # nats
_WALKS = 4
_HOPELESS = 15.0  # nats above, after the taste
_TRIED = 4
_APART = 0.02  # of the box's width


def multistart(
    objective: Objective,
    rough: Objective,
    regression: Search,
    p: FloatArray,
    box: Box,
    begins: FloatArray,
    names: tuple[str, ...],
    loose: FloatArray,
    *,
    method: str,
    workers: int | None,
    progress: bool | None,
) -> tuple[FloatArray, FloatArray, Starts, list[FloatArray]]:
    """Search from every start, in three rounds, each from where the one before ended.

    A regression on the smoothed motion is quick and has few valleys that lead astray. A filter that
    follows the readings closely (`rough`, noise `loose`) has less bias. The likelihood itself, with
    the noise learned at the best end, decides; there each end is also tried along the tyres that
    look alike.

    Returns
    -------
    p : array, shape (parameters,)
        The best end.
    noise : array, shape (7,)
    ends : Starts
    others : list of array
        Other optima found on the way, for a closer look.
    """
    runner = Runner(box, workers, progress)
    points = np.tile(p, (len(begins), 1))
    points[:, box.columns] = begins
    ends, _ = runner.all_of(regression, as_float64(points))
    ends, values = runner.all_of(lambda x: descend(rough, x, loose, box, method=method), ends)
    noise = loose
    others: dict[float, list[FloatArray]] = {}
    # The noise learned at a poor end hides better ones: it is learned again as ends get better. To
    # walk takes long, and is for ends that are as good as they get without.
    for walks in (False, True, False, True, False, True):
        if not np.isfinite(values).any():
            raise NumericalError(
                "no start led to a finite likelihood; check units, signs and the timing of the "
                "inputs"
            )
        if not walks:
            best_end = ends[int(np.argmax(values))]
            _, noise, _ = settle(
                objective, best_end, noise, box, method=method, parameters_first=True
            )
            go = partial(descend, objective, noise=noise, box=box, method=method)
            ends, values = runner.all_of(go, ends)
            continue

        def search(x: FloatArray, told: FloatArray = noise) -> tuple[FloatArray, float]:
            value = objective.log_likelihood(x, told)
            end, value, found = walk(objective, x, value, told, box)
            others[value] = found
            return end, value

        before = float(np.max(values))
        ends, values = runner.all_of(search, ends)
        if np.max(values) < before + SAME_OPTIMUM:
            break
    best = int(np.argmax(values))
    table = Starts(names, begins, as_float64(ends[:, box.columns]), values)
    return ends[best], noise, table, others.get(float(values[best]), [])


def looking_alike(p: FloatArray) -> Iterator[FloatArray]:
    """Points with tyres of other curvature, but of the same stiffness and peak, at either axle."""
    for sides in _SIDES:
        for e in _CURVATURES:
            trial = p.copy()
            for first in sides:
                trial[first : first + 4] = look_alike(p[first : first + 4], e)
            yield trial


def walk(
    objective: Objective, p: FloatArray, value: float, noise: FloatArray, box: Box
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
