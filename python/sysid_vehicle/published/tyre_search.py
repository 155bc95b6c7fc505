"""Searches with the published losses: from many starts on few samples, from the best on all."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._common.arrays import FloatArray, as_float64
from ..identify.search.objective import LinearRows
from ..identify.search.starts import Runner
from ..identify.search.walk import looking_alike
from ..lab.tyres.projection import Regression
from ..lab.tyres.regression_search import COARSE, EXACT, FINE, ROUGH, RegressionTask

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

    def merits(self, ends: FloatArray, losses: FloatArray) -> FloatArray:
        """By what ends are compared: minus half the loss, or the joint loss's log-likelihood.

        With its weights worked out anew at every end the joint loss is about the same at all of
        them; the likelihood of errors of those sizes tells them apart.
        """
        if self.loss != "joint":
            return as_float64(-0.5 * losses)
        n = self.motion.n
        return as_float64([-n * float(np.sum(np.log(self._sizes(p)))) for p in ends])

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
    runner = Runner(task.box, None, False, _SAME)
    # The way to the valley needs few samples, the place in it all of them.
    rough = task.thinned(COARSE) if task.motion.n > 2 * COARSE else task
    points = task.box.put(task.given, begins)
    ends, losses = _onwards(runner, rough, points, ROUGH)
    near = rough.behind(rough.merits(ends, losses)) <= _HOPELESS
    losses[~near] = [task.at(p) for p in ends[~near]]
    ends[near], losses[near] = _onwards(runner, task, ends[near], ROUGH)
    if len(begins) > 1:
        _walk(task, runner, ends, losses)
    close = 2.0 * task.behind(task.merits(ends, losses)) <= task.motion.n * _CLOSE
    ends[close], losses[close] = _onwards(runner, task, ends[close], FINE)
    return ends, losses, task.merits(ends, losses)


def _onwards(
    runner: Runner, task: LossTask, points: FloatArray, still: float
) -> tuple[FloatArray, FloatArray]:
    """Ends of searches, and the losses there; those that have met go together."""

    def descend(p: FloatArray) -> tuple[FloatArray, float]:
        end, loss = task.descend(task.box.inside(p), still)
        return end, -loss

    ends, values = runner.all_of(descend, points)
    return ends, -values


def _walk(task: LossTask, runner: Runner, ends: FloatArray, losses: FloatArray) -> None:
    """Leave the best end for a better one among the tyres that look alike, where there is one.

    Fewer samples have fewer valleys: all starts may have met in one that is not the lowest of all
    samples. Whatever ended at the best goes on to the better.
    """
    width = task.box.upper - task.box.lower
    others = [task.given]  # it may be better than where few samples led to
    for _ in range(_WALKS):
        merits = task.merits(ends, losses)
        best = int(np.argmax(merits))
        here = ends[best]
        points = as_float64([*others, *looking_alike(here)])
        tried, values = _onwards(runner, task, points, ROUGH)
        found = task.merits(tried, values)
        better = int(np.argmax(found))
        if found[better] <= merits[best] + ROUGH * abs(merits[best]):
            return
        met = np.max(np.abs(ends - here)[:, task.box.columns] / width, axis=1) <= _SAME
        ends[met], losses[met] = tried[better], values[better]
        others = []


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
