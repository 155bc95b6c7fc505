"""Variable projection: coefficients that enter linearly are worked out, not searched for.

Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973), with the derivative of Kaufman, BIT 15 (1975).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy

from ..._common.arrays import FloatArray, as_float64
from ...identify.search.objective import Problem
from ...identify.search.search import least_within


@dataclass
class Regression:
    """A loss in the form local searches ask for, its linear parameters eliminated.

    Parameters
    ----------
    loss : Problem
    linear : list of int
        Parameters that are eliminated; empty to search for all.
    lower, upper : array, shape (linear,)
        Their bounds.
    """

    loss: Problem
    linear: list[int]
    lower: FloatArray
    upper: FloatArray
    # The search asks for the derivatives where it has just asked for the cost.
    _last: tuple[bytes, FloatArray, float] | None = field(default=None, repr=False)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.loss.samples

    def complete(self, p: FloatArray) -> FloatArray:
        """`p` with the best linear parameters within their bounds."""
        return self._completed(p)[0]

    def _completed(self, p: FloatArray) -> tuple[FloatArray, float]:
        if not self.linear:
            return p, self.loss.half_sum_of_squares(p, None)
        key = p.tobytes()
        if self._last is not None and self._last[0] == key:
            return self._last[1], self._last[2]
        cost, gradient, information = self.loss.normal_equations(p, None, self.linear)
        step = _bounded(
            information, gradient, self.lower - p[self.linear], self.upper - p[self.linear]
        )
        full = p.copy()
        full[self.linear] += step
        cost += float(0.5 * step @ information @ step - gradient @ step)
        self._last = (key, full, cost)
        return full, cost

    def half_sum_of_squares(self, p: FloatArray, _: object = None) -> float:
        """Half the sum of squares alone."""
        return self._completed(p)[1]

    def _free(self, full: FloatArray) -> list[int]:
        """Linear parameters that are not held by a bound."""
        where = full[self.linear]
        return [
            c
            for c, x, low, high in zip(self.linear, where, self.lower, self.upper, strict=True)
            if low < x < high
        ]

    def normal_equations(
        self, p: FloatArray, _: object, columns: list[int]
    ) -> tuple[float, FloatArray, FloatArray]:
        """Half the sum of squares, direction of descent, Gauss-Newton matrix, after elimination."""
        full, _cost = self._completed(p)
        linear = self._free(full)
        cost, gradient, information = self.loss.normal_equations(full, None, [*columns, *linear])
        n = len(columns)
        if not linear:
            return cost, gradient, information
        across = information[:n, n:]
        factor = _factor(information[n:, n:])
        return (
            cost,
            as_float64(gradient[:n] - across @ scipy.linalg.cho_solve(factor, gradient[n:])),
            as_float64(information[:n, :n] - across @ scipy.linalg.cho_solve(factor, across.T)),
        )

    def residuals(self, p: FloatArray, _: object = None) -> FloatArray:
        """All residuals, those of the wishes last."""
        return self.loss.residuals(self._completed(p)[0], None).ravel()

    def sensitivities(self, p: FloatArray, _: object, columns: list[int]) -> FloatArray:
        """Minus the derivatives of the residuals, after elimination."""
        full, _cost = self._completed(p)
        linear = self._free(full)
        every = [*columns, *linear]
        by = self.loss.sensitivities(full, None, every)
        n = len(columns)
        if not linear:
            return as_float64(by)
        other = by[:, n:]
        return as_float64(
            by[:, :n]
            - other @ scipy.linalg.cho_solve(_factor(other.T @ other), other.T @ by[:, :n])
        )


def _factor(matrix: FloatArray) -> tuple[FloatArray, bool]:
    ridge = 1e-13 * float(np.trace(matrix)) + 1e-300
    factor, low = scipy.linalg.cho_factor(matrix + ridge * np.eye(len(matrix)))
    return as_float64(factor), bool(low)


def _bounded(
    matrix: FloatArray, gradient: FloatArray, lower: FloatArray, upper: FloatArray
) -> FloatArray:
    """Minimum of the quadratic within the bounds."""
    step = scipy.linalg.cho_solve(_factor(matrix), gradient)
    if np.all(step >= lower) and np.all(step <= upper):
        return as_float64(step)
    values, vectors = np.linalg.eigh(matrix)
    values = np.maximum(values, 1e-14 * values[-1])
    ends = np.minimum(lower, 0.0) - 1e-15, np.maximum(upper, 0.0) + 1e-15
    return as_float64(np.clip(least_within(values, vectors, gradient, *ends), lower, upper))
