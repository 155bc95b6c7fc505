"""Searches with the published losses: from many starts on few samples, from the best on all."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from .._arrays import FloatArray, as_float64
from ..identify.objective import LinearRows
from ..lab.multistart import looking_alike
from ..lab.projection import Regression
from ..lab.regression_search import COARSE, EXACT, FINE, ROUGH, RegressionTask

_PRIOR_WEIGHT = 0.1
_PRIOR_OF_RESIDUAL_TERMS = 0.1  # relative to that of the tyres
_SIMILARITY_WEIGHT = 1000.0
_FLOOR = 1e-6  # of the variance of a_y [m2/s4]
_WALKS = 3
_CLOSE = 1e-3  # of the loss: ends nearer than this to the best are searched finely
_HOPELESS = 15.0  # nats behind the best on few samples
_SAME = 0.02  # of the box's width


@dataclass(frozen=True, eq=False)
class LossTask(RegressionTask):
    """A loss over a motion, and where its minimum is looked for.

    Parameters
    ----------
    loss : str
        One of `published.tyres.LOSSES`; the regularised one is drawn towards the given point. The
        other parameters are those of a `RegressionTask`.
    """

    loss: str = "joint"

    def descend(self, begin: FloatArray, still: float | None = None) -> tuple[FloatArray, float]:
        """Search from one start; as that of a `RegressionTask`."""
        if self.loss == "joint":
            return super().descend(begin, still)
        return self._minimum(self._as_published(), begin, still)

    def at(self, p: FloatArray) -> float:
        """Give the loss of a point."""
        whole = replace(self, projection=False)
        joint = self.loss == "joint"
        problem = whole._problem(*self._weights(p)) if joint else whole._as_published()
        return 2.0 * problem.half_sum_of_squares(p)

    def merits(self, found: list[tuple[FloatArray, float]]) -> FloatArray:
        """By what ends are compared: minus half the loss, or the joint loss's log-likelihood.

        With its weights worked out anew at every end the joint loss is about the same at all of
        them; the likelihood of errors of those sizes tells them apart.
        """
        if self.loss != "joint":
            return as_float64([-0.5 * value for _, value in found])
        n = self.motion.n
        return as_float64([-n * float(np.sum(np.log(self._sizes(p)))) for p, _ in found])

    def behind(self, merits: FloatArray) -> FloatArray:
        """How far behind the best each is [nats], were the errors as large as the best's."""
        if self.loss == "joint":
            return as_float64(np.max(merits) - merits)
        losses = -2.0 * merits + EXACT * float(np.sum(self.motion.ay_mps2**2))
        return as_float64(0.5 * self.motion.n * np.log(losses / np.min(losses)))

    def _as_published(self) -> Regression:
        motion = self.motion
        ay = np.ones(motion.n)
        if self.loss != "plain" and motion.ay_variance is not None:
            ay = as_float64(1.0 / np.sqrt(np.maximum(motion.ay_variance, _FLOOR)))
        wishes = (_wishes(self.given),) if self.loss == "regularised" else ()
        return self._problem(ay, np.zeros(motion.n), projects_steer=False, wishes=wishes)

    def _tolerance(self) -> float:
        if self.loss != "plain":
            return super()._tolerance()
        return 1e-8 * float(np.sum(self.motion.ay_mps2**2))


def search(task: LossTask, begins: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Search from every start; what is not hopeless on few samples goes on to all of them.

    Parameters
    ----------
    task : LossTask
    begins : array, shape (starts, free)

    Returns
    -------
    ends : array, shape (starts, parameters)
    losses : array, shape (starts,)
    merits : array, shape (starts,)
        By which ends are compared, the greatest being the best.
    """
    # The way to the valley needs few samples, the place in it all of them.
    rough = task.thinned(COARSE) if task.motion.n > 2 * COARSE else task
    found: list[tuple[FloatArray, float]] = []
    for begin in begins:
        found.append(rough.descend(task.box.put(task.given, begin), ROUGH))
    behind = rough.behind(rough.merits(found))
    for i in np.flatnonzero(behind > _HOPELESS):
        found[i] = found[i][0], task.at(found[i][0])
    _go_on(task, found, np.flatnonzero(behind <= _HOPELESS), behind, ROUGH)
    if len(begins) > 1:
        _walk(task, found)
    behind = task.behind(task.merits(found))
    close = np.flatnonzero(2.0 * behind <= task.motion.n * _CLOSE)
    _go_on(task, found, close, behind, FINE)
    return as_float64([p for p, _ in found]), as_float64([v for _, v in found]), task.merits(found)


def _walk(task: LossTask, found: list[tuple[FloatArray, float]]) -> None:
    """Leave the best end for a better one among the tyres that look alike, where there is one.

    Fewer samples have fewer valleys: all starts may have met in one that is not the lowest of all
    samples. Whatever ended at the best goes on to the better.
    """
    # The given point may be better than where few samples led to.
    given = task.descend(task.box.inside(task.given), ROUGH)
    tried = [given] if np.isfinite(given[1]) else []
    for _ in range(_WALKS):
        best = int(np.argmax(task.merits(found)))
        here = found[best][0]
        for trial in looking_alike(here):
            tried.append(task.descend(task.box.inside(trial), ROUGH))
        merits = task.merits(tried)
        better = int(np.argmax(merits))
        now = task.merits([found[best]])[0]
        if merits[better] <= now + ROUGH * abs(now):
            return
        width = task.box.upper - task.box.lower
        for i, (p, _) in enumerate(found):
            if np.max(np.abs(p - here)[task.box.columns] / width) <= _SAME:
                found[i] = tried[better]
        tried = []


def _go_on(
    task: LossTask,
    found: list[tuple[FloatArray, float]],
    some: npt.NDArray[np.intp],
    behind: FloatArray,
    still: float,
) -> None:
    """Search on from some of the points, the best first; those that have met go together."""
    width = task.box.upper - task.box.lower
    done: list[tuple[FloatArray, tuple[FloatArray, float]]] = []
    for i in some[np.argsort(behind[some], kind="stable")]:
        begin = found[i][0]
        apart = [float(np.max(np.abs(begin - b)[task.box.columns] / width)) for b, _ in done]
        if not apart or min(apart) > _SAME:
            done.append((begin, task.descend(begin, still)))
            apart.append(0.0)
        found[i] = done[int(np.argmin(apart))][1]


def _wishes(start: FloatArray) -> LinearRows:
    scale = np.where(start == 0.0, 1.0, np.abs(start))
    rows, target = [], []
    for i in range(11):
        weight = np.sqrt(_PRIOR_WEIGHT) * (1.0 if i < 8 else _PRIOR_OF_RESIDUAL_TERMS) / scale[i]
        row = np.zeros(len(start))
        row[i] = weight
        rows.append(row)
        target.append(weight * start[i])
    for i in range(4):
        row = np.zeros(len(start))
        row[i] = np.sqrt(_SIMILARITY_WEIGHT) / scale[i]
        row[i + 4] = -row[i]
        rows.append(row)
        target.append(0.0)
    return LinearRows(as_float64(rows), as_float64(target))
