"""Variable projection: coefficients that enter linearly are worked out, not searched for.

Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973), with the derivative of Kaufman, BIT 15 (1975).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import lsq_linear

from .. import _core
from .._arrays import FloatArray, as_float64

__all__ = ["Regression", "SoftRows"]


@dataclass(frozen=True)
class SoftRows:
    """Wishes that are linear in the parameters: residuals `target - rows @ p`."""

    rows: FloatArray
    target: FloatArray

    @classmethod
    def none(cls, parameters: int) -> SoftRows:
        """Make no wish at all."""
        return cls(np.zeros((0, parameters)), np.zeros(0))


@dataclass
class Regression:
    """A loss in the form local searches ask for, its linear parameters eliminated.

    Parameters
    ----------
    loss : TyreLoss
    soft : SoftRows
    linear : list of int
        Parameters that are eliminated; empty to search for all.
    lower, upper : array, shape (linear,)
        Their bounds.
    """

    loss: _core.TyreLoss
    soft: SoftRows
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
            return p, self._cost(p)
        key = p.tobytes()
        if self._last is not None and self._last[0] == key:
            return self._last[1], self._last[2]
        cost, gradient, information = self._normal(p, self.linear)
        step = _bounded(
            information, gradient, self.lower - p[self.linear], self.upper - p[self.linear]
        )
        full = p.copy()
        full[self.linear] += step
        cost += float(0.5 * step @ information @ step - gradient @ step)
        self._last = (key, full, cost)
        return full, cost

    def _cost(self, p: FloatArray) -> float:
        wished = self.soft.target - self.soft.rows @ p
        return self.loss.half_sum_of_squares(p) + 0.5 * float(wished @ wished)

    def _normal(self, p: FloatArray, columns: list[int]) -> tuple[float, FloatArray, FloatArray]:
        cost, gradient, information = self.loss.normal_equations(p, columns)
        if len(self.soft.target):
            wished = self.soft.target - self.soft.rows @ p
            some = self.soft.rows[:, columns]
            cost += 0.5 * float(wished @ wished)
            gradient = gradient + some.T @ wished
            information = information + some.T @ some
        return cost, gradient, information

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
        cost, gradient, information = self._normal(full, [*columns, *linear])
        n = len(columns)
        if not linear:
            return cost, gradient, information
        across = information[:n, n:]
        factor = _factor(information[n:, n:])
        return (
            cost,
            as_float64(gradient[:n] - across @ cho_solve(factor, gradient[n:])),
            as_float64(information[:n, :n] - across @ cho_solve(factor, across.T)),
        )

    def residuals(self, p: FloatArray, _: object = None) -> FloatArray:
        """All residuals, those of the wishes last."""
        full, _cost = self._completed(p)
        wished = self.soft.target - self.soft.rows @ full
        return np.concatenate([self.loss.residuals(full).ravel(), wished])

    def sensitivities(self, p: FloatArray, _: object, columns: list[int]) -> FloatArray:
        """Minus the derivatives of the residuals, after elimination."""
        full, _cost = self._completed(p)
        linear = self._free(full)
        every = [*columns, *linear]
        by = np.vstack([self.loss.sensitivities(full, every), self.soft.rows[:, every]])
        n = len(columns)
        if not linear:
            return as_float64(by)
        other = by[:, n:]
        return as_float64(
            by[:, :n] - other @ cho_solve(_factor(other.T @ other), other.T @ by[:, :n])
        )


def _factor(matrix: FloatArray) -> tuple[FloatArray, bool]:
    ridge = 1e-13 * float(np.trace(matrix)) + 1e-300
    factor, low = cho_factor(matrix + ridge * np.eye(len(matrix)))
    return as_float64(factor), bool(low)


def _bounded(
    matrix: FloatArray, gradient: FloatArray, lower: FloatArray, upper: FloatArray
) -> FloatArray:
    """Minimum of the quadratic within the bounds."""
    step = cho_solve(_factor(matrix), gradient)
    if np.all(step >= lower) and np.all(step <= upper):
        return as_float64(step)
    values, vectors = np.linalg.eigh(matrix)
    root = np.sqrt(np.maximum(values, 1e-14 * values[-1]))
    found = lsq_linear(
        root[:, None] * vectors.T,
        (vectors.T @ gradient) / root,
        bounds=(np.minimum(lower, 0.0) - 1e-15, np.maximum(upper, 0.0) + 1e-15),
        method="bvls",
    )
    return as_float64(np.clip(found.x, lower, upper))
