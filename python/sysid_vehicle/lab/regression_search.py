"""Searches of a regression of tyres: from many starts on few samples, from the best on all."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from .._arrays import FloatArray, as_float64
from ..identify.objective import LinearRows, Penalised
from ..identify.search import Box, minimise
from ..identify.tyre_shape import look_alike
from .motion import TyreMotion
from .projection import Regression
from .tyre_data import GreyBoxVehicle
from .tyre_fit import PARAMETERS

__all__ = ["RegressionTask", "descend_regression", "search"]

_PRIOR_WEIGHT = 0.1
_PRIOR_OF_RESIDUAL_TERMS = 0.1  # relative to that of the tyres
_SIMILARITY_WEIGHT = 1000.0
_FLOOR = 1e-6  # of the variance of a_y [m2/s4]
_COARSE = 800  # samples of a first search
_ROUNDS = 60  # of one search
_PASSES = 3  # over the sizes of the errors, joint loss
_FINE_PASSES = 30
_ROUGH, _FINE = 1e-5, 1e-8  # of the loss: what a whole search may gain and count as none
_STEP = 1e-2  # of that: what a step may
_AGAIN = {_ROUGH: 2, _FINE: 6}  # searches after each other
_CURVATURES = (-1.0, 0.0, 0.4, 0.8)
_SIDES = ((0,), (4,), (0, 4))  # where the coefficients of the axles that are moved begin
_WALKS = 3
_CLOSE = 1e-3  # of the loss: ends nearer than this to the best are searched finely
_EXACT = 1e-12  # of the squares to explain: less is rounding
_HOPELESS = 15.0  # nats behind the best on few samples
_SAME = 0.02  # of the box's width


@dataclass(frozen=True, eq=False)
class RegressionTask:
    """A loss over a motion, and where its minimum is looked for.

    Parameters
    ----------
    vehicle : GreyBoxVehicle
    motion : TyreMotion
    loss : str
        One of `lab.regression.LOSSES`.
    box : Box
    projection : bool
        Work D and P out wherever the search goes.
    method : str
        Local optimiser.
    given : array, shape (parameters,)
        Values of what is not searched for; the regularised loss is drawn towards it.
    """

    vehicle: GreyBoxVehicle
    motion: TyreMotion
    loss: str
    box: Box
    projection: bool
    method: str
    given: FloatArray

    def thinned(self, most: int) -> RegressionTask:
        """The same with about `most` samples."""
        return replace(self, motion=self.motion.thinned(most))

    def descend(self, begin: FloatArray, still: float | None = None) -> tuple[FloatArray, float]:
        """Search from one start.

        Parameters
        ----------
        begin : array, shape (parameters,)
        still : float, optional
            `_ROUGH` or `_FINE`: until the loss stands still to this share of it; else until a step
            gains little.

        Returns
        -------
        p : array, shape (parameters,)
        loss : float
        """
        p, value = begin.copy(), np.inf
        ay, yaw = self._first_weights()
        joint = self.loss == "joint"
        for _ in range(1 if not joint else _FINE_PASSES if still else _PASSES):
            problem = self._problem(ay, yaw)
            before = value
            p, value = self._minimum(problem, p, still)
            if joint:
                ay, yaw = (np.full(self.motion.n, 1.0 / s) for s in self._sizes(p))
                # Under the sizes that errors have, their squares sum up to as many as there are.
                if still and abs(value - before) < still * value:
                    break
        return p, value

    def _minimum(
        self, problem: Regression, p: FloatArray, still: float | None
    ) -> tuple[FloatArray, float]:
        inner = self._inner()
        p = p.copy()
        exact = _EXACT * float(np.sum(self.motion.ay_mps2**2))
        cost = np.inf
        for _ in range(_AGAIN[still] if still else 1):
            here = problem.half_sum_of_squares(p)
            tolerance = _STEP * max(still * here, exact) if still else self._tolerance()
            found = minimise(
                problem,
                p,
                None,
                inner,
                method=self.method,
                rounds=_ROUNDS,
                tolerance=tolerance,
            )
            p[inner.columns] = found.x
            cost = found.cost
            if still and here - cost <= max(still * cost, exact):
                break
        return problem.complete(p), 2.0 * cost

    def at(self, p: FloatArray) -> float:
        """Give the loss of a point."""
        ay, yaw = self._first_weights()
        if self.loss == "joint":
            ay, yaw = (np.full(self.motion.n, 1.0 / s) for s in self._sizes(p))
        return 2.0 * replace(self, projection=False)._problem(ay, yaw).half_sum_of_squares(p)

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
        losses = -2.0 * merits + _EXACT * float(np.sum(self.motion.ay_mps2**2))
        return as_float64(0.5 * self.motion.n * np.log(losses / np.min(losses)))

    def _inner(self) -> Box:
        kept = [not self.projection or PARAMETERS[c][0] in "BCE" for c in self.box.columns]
        columns = [c for c, k in zip(self.box.columns, kept, strict=True) if k]
        return Box(columns, self.box.lower[kept], self.box.upper[kept])

    def _problem(self, ay: FloatArray, yaw: FloatArray) -> Regression:
        out = [self.projection and PARAMETERS[c][0] not in "BCE" for c in self.box.columns]
        errors = self.motion.errors(self.vehicle, ay, yaw, projects_steer=self.loss == "joint")
        return Regression(
            Penalised(errors, (_wishes(self.given),) if self.loss == "regularised" else ()),
            [c for c, k in zip(self.box.columns, out, strict=True) if k],
            self.box.lower[out],
            self.box.upper[out],
        )

    def _sizes(self, p: FloatArray) -> FloatArray:
        """Root mean square errors of a_y and of the yaw acceleration."""
        one = np.ones(self.motion.n)
        errors = self.motion.errors(self.vehicle, one, one, projects_steer=True).residuals(p, None)
        return as_float64(np.sqrt(np.mean(errors**2, axis=0)) + 1e-9)

    def _first_weights(self) -> tuple[FloatArray, FloatArray]:
        motion = self.motion
        one, none = np.ones(motion.n), np.zeros(motion.n)
        if self.loss == "plain":
            return one, none
        if self.loss == "joint":
            rate = motion.yaw_acc_radps2
            assert rate is not None  # callers have seen to it
            return one / (0.1 * np.std(motion.ay_mps2) + 1e-6), one / (0.1 * np.std(rate) + 1e-6)
        variance = motion.ay_variance if motion.ay_variance is not None else one
        return as_float64(1.0 / np.sqrt(np.maximum(variance, _FLOOR))), none

    def _tolerance(self) -> float:
        """Gain of half the loss that ends a search that need not be fine."""
        if self.loss != "plain":
            return 1e-3
        return 1e-8 * float(np.sum(self.motion.ay_mps2**2))


def search(task: RegressionTask, begins: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Search from every start; what is not hopeless on few samples goes on to all of them.

    Parameters
    ----------
    task : RegressionTask
    begins : array, shape (starts, free)

    Returns
    -------
    ends : array, shape (starts, parameters)
    losses : array, shape (starts,)
    merits : array, shape (starts,)
        By which ends are compared, the greatest being the best.
    """
    # The way to the valley needs few samples, the place in it all of them.
    rough = task.thinned(_COARSE) if task.motion.n > 2 * _COARSE else task
    found: list[tuple[FloatArray, float]] = []
    for begin in begins:
        p = task.given.copy()
        p[task.box.columns] = begin
        found.append(rough.descend(p, _ROUGH))
    behind = rough.behind(rough.merits(found))
    for i in np.flatnonzero(behind > _HOPELESS):
        found[i] = found[i][0], task.at(found[i][0])
    _go_on(task, found, np.flatnonzero(behind <= _HOPELESS), behind, _ROUGH)
    if len(begins) > 1:
        _walk(task, found)
    behind = task.behind(task.merits(found))
    close = np.flatnonzero(2.0 * behind <= task.motion.n * _CLOSE)
    _go_on(task, found, close, behind, _FINE)
    return as_float64([p for p, _ in found]), as_float64([v for _, v in found]), task.merits(found)


def _walk(task: RegressionTask, found: list[tuple[FloatArray, float]]) -> None:
    """Leave the best end for a better one among the tyres that look alike, where there is one.

    Fewer samples have fewer valleys: all starts may have met in one that is not the lowest of all
    samples. Whatever ended at the best goes on to the better.
    """
    # The given point may be better than where few samples led to.
    tried = [(p, v) for p, v in [task.descend(_at_given(task), _ROUGH)] if np.isfinite(v)]
    for _ in range(_WALKS):
        best = int(np.argmax(task.merits(found)))
        here = found[best][0]
        for sides in _SIDES:
            for e in _CURVATURES:
                trial = here.copy()
                for first in sides:
                    trial[first : first + 4] = look_alike(here[first : first + 4], e)
                trial[task.box.columns] = np.clip(
                    trial[task.box.columns], task.box.lower, task.box.upper
                )
                tried.append(task.descend(trial, _ROUGH))
        merits = task.merits(tried)
        better = int(np.argmax(merits))
        now = task.merits([found[best]])[0]
        if merits[better] <= now + _ROUGH * abs(now):
            return
        width = task.box.upper - task.box.lower
        for i, (p, _) in enumerate(found):
            if np.max(np.abs(p - here)[task.box.columns] / width) <= _SAME:
                found[i] = tried[better]
        tried = []


def _at_given(task: RegressionTask) -> FloatArray:
    p = task.given.copy()
    p[task.box.columns] = np.clip(p[task.box.columns], task.box.lower, task.box.upper)
    return p


def _go_on(
    task: RegressionTask,
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


def descend_regression(
    vehicle: GreyBoxVehicle, motion: TyreMotion, p: FloatArray, box: Box
) -> tuple[FloatArray, float]:
    """Search with the joint loss from one start, near enough to go on from.

    Returns
    -------
    p : array, shape (parameters,)
    loss : float
    """
    task = RegressionTask(vehicle, motion, "joint", box, True, "gauss-newton", p)
    if motion.n > 2 * _COARSE:
        p, _ = task.thinned(_COARSE).descend(p)
    return task.descend(p)


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
