"""Search of a regression of tyres on a motion that is taken as known, from one start."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ...identify.search.objective import LinearRows, Penalised
from ...identify.search.search import Box, minimise
from .data import GreyBoxVehicle
from .fit import PARAMETERS
from .motion import TyreMotion
from .projection import Regression

COARSE = 800  # samples of a first search
ROUGH, FINE = 1e-5, 1e-8  # of the loss: what a whole search may gain and count as none
EXACT = 1e-12  # of the squares to explain: less is rounding
_ROUNDS = 60  # of one search
_PASSES = 3  # over the sizes of the errors
_FINE_PASSES = 30
_STEP = 1e-2  # of what a whole search may gain: what a step may
_Task = TypeVar("_Task", bound="RegressionTask")
_AGAIN = {ROUGH: 2, FINE: 6}  # searches after each other


@dataclass(frozen=True, eq=False)
class RegressionTask:
    """The joint loss over a motion, and where its minimum is looked for.

    It is the sum of squared errors of a_y and of the yaw acceleration, each over the size it turns
    out to have.

    Parameters
    ----------
    vehicle : GreyBoxVehicle
    motion : TyreMotion
    box : Box
    given : array, shape (parameters,)
        Values of what is not searched for.
    projection : bool
        Work D and P out wherever the search goes.
    method : str
        Local optimiser.
    """

    vehicle: GreyBoxVehicle
    motion: TyreMotion
    box: Box
    given: FloatArray
    projection: bool = True
    method: str = "gauss-newton"

    def thinned(self: _Task, most: int) -> _Task:
        """The same with about `most` samples."""
        return replace(self, motion=self.motion.thinned(most))

    def descend(self, begin: FloatArray, still: float | None = None) -> tuple[FloatArray, float]:
        """Search from one start.

        Parameters
        ----------
        begin : array, shape (parameters,)
        still : float, optional
            `ROUGH` or `FINE`: until the loss stands still to this share of it; else until a step
            gains little.

        Returns
        -------
        p : array, shape (parameters,)
        loss : float
        """
        p, value = begin.copy(), np.inf
        weights = self._first_weights()
        for _ in range(_FINE_PASSES if still else _PASSES):
            before = value
            p, value = self._minimum(self._problem(*weights), p, still)
            weights = self._weights(p)
            # Under the sizes that errors have, their squares sum up to as many as there are.
            if still and abs(value - before) < still * value:
                break
        return p, value

    def _minimum(
        self, problem: Regression, p: FloatArray, still: float | None
    ) -> tuple[FloatArray, float]:
        inner = self._inner()
        p = p.copy()
        exact = EXACT * float(np.sum(self.motion.ay_mps2**2))
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

    def _inner(self) -> Box:
        kept = [not self.projection or PARAMETERS[c][0] in "BCE" for c in self.box.columns]
        columns = [c for c, k in zip(self.box.columns, kept, strict=True) if k]
        return Box(columns, self.box.lower[kept], self.box.upper[kept])

    def _problem(
        self,
        ay: FloatArray,
        yaw: FloatArray,
        *,
        projects_steer: bool = True,
        wishes: tuple[LinearRows, ...] = (),
    ) -> Regression:
        out = [self.projection and PARAMETERS[c][0] not in "BCE" for c in self.box.columns]
        errors = self.motion.errors(self.vehicle, ay, yaw, projects_steer=projects_steer)
        return Regression(
            Penalised(errors, wishes),
            [c for c, k in zip(self.box.columns, out, strict=True) if k],
            self.box.lower[out],
            self.box.upper[out],
        )

    def _sizes(self, p: FloatArray) -> FloatArray:
        """Root mean square errors of a_y and of the yaw acceleration."""
        one = np.ones(self.motion.n)
        errors = self.motion.errors(self.vehicle, one, one, projects_steer=True).residuals(p, None)
        return as_float64(np.sqrt(np.mean(errors**2, axis=0)) + 1e-9)

    def _weights(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """One over the sizes of the errors, for every sample."""
        ay, yaw = self._sizes(p)
        return np.full(self.motion.n, 1.0 / ay), np.full(self.motion.n, 1.0 / yaw)

    def _first_weights(self) -> tuple[FloatArray, FloatArray]:
        one, rate = np.ones(self.motion.n), self.motion.yaw_acc_radps2
        assert rate is not None  # callers have seen to it
        ay = 0.1 * np.std(self.motion.ay_mps2) + 1e-6
        return as_float64(one / ay), as_float64(one / (0.1 * np.std(rate) + 1e-6))

    def _tolerance(self) -> float:
        """Gain of half the loss that ends a search that need not be fine."""
        return 1e-3


def descend_regression(
    vehicle: GreyBoxVehicle, motion: TyreMotion, p: FloatArray, box: Box
) -> tuple[FloatArray, float]:
    """Search from one start, near enough to go on from.

    Returns
    -------
    p : array, shape (parameters,)
    loss : float
    """
    task = RegressionTask(vehicle, motion, box, p)
    if motion.n > 2 * COARSE:
        p, _ = task.thinned(COARSE).descend(p)
    return task.descend(p)
