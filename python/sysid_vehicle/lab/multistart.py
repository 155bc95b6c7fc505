"""Searches for tyres from many starts: quick and rough ones first."""

from __future__ import annotations

from functools import partial

import numpy as np

from .._arrays import FloatArray, as_float64
from ..errors import NumericalError
from ..identify.objective import Objective
from ..identify.search import Box
from ..identify.settle import descend, settle
from ..identify.starts import SAME_OPTIMUM, Runner, Search, Starts
from .walk import walk


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
