"""Problems whose parameters are copies of common ones: tied to each other, or one for each run.

A run's parameters are p = q[source], q the common vector. Sensitivities by q are sums of those by
p, so that gradients and information matrices of the runs add up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..._common.arrays import FloatArray, as_float64
from .objective import Predicting

_Places = npt.NDArray[np.intp]


@dataclass(frozen=True)
class _Frozen:
    """Gains of every part."""

    parts: tuple[Any, ...]
    log_likelihood: float


@dataclass(frozen=True)
class Copied:
    """A problem, and where each of its parameters stands among the common ones.

    Attributes
    ----------
    problem : Predicting
    source : array of int, shape (parameters,)
    """

    problem: Predicting
    source: _Places

    def moved_by(self, columns: Sequence[int]) -> tuple[list[int], FloatArray]:
        """Own parameters that common ones move, and which: shape (own, common) of ones."""
        own = [int(i) for i in np.flatnonzero(np.isin(self.source, columns))]
        hit = self.source[own][:, None] == np.asarray(columns, dtype=np.intp)[None, :]
        return own, hit.astype(np.float64)


@dataclass(frozen=True)
class Mapped:
    """Several copied problems as one (`Predicting`)."""

    parts: tuple[Copied, ...]

    @property
    def samples(self) -> int:
        """Number of samples of all parts."""
        return sum(part.problem.samples for part in self.parts)

    def freeze(self, p: FloatArray, noise: FloatArray) -> _Frozen:
        """Gains of every part, and the log-likelihood of all."""
        frozen = tuple(part.problem.freeze(p[part.source], noise) for part in self.parts)
        return _Frozen(frozen, float(sum(f.log_likelihood for f in frozen)))

    def noise_score(self, p: FloatArray, noise: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Log-likelihood, its derivatives by the noise's logarithms, and their information."""
        told = [part.problem.noise_score(p[part.source], noise) for part in self.parts]
        value = float(sum(t[0] for t in told))
        return value, _sum([t[1] for t in told]), _sum([t[2] for t in told])

    def residuals(self, p: FloatArray, gains: _Frozen) -> FloatArray:
        """Whitened residuals, part after part."""
        pairs = zip(self.parts, gains.parts, strict=True)
        return np.concatenate([c.problem.residuals(p[c.source], g).ravel() for c, g in pairs])

    def half_sum_of_squares(self, p: FloatArray, gains: _Frozen) -> float:
        """Half the sum of their squares."""
        pairs = zip(self.parts, gains.parts, strict=True)
        return sum((c.problem.half_sum_of_squares(p[c.source], g) for c, g in pairs), 0.0)

    def sensitivities(self, p: FloatArray, gains: _Frozen, columns: list[int]) -> FloatArray:
        """Minus the derivatives of the residuals, one row each."""
        rows = []
        for c, g in zip(self.parts, gains.parts, strict=True):
            own, hit = c.moved_by(columns)
            rows.append(c.problem.sensitivities(p[c.source], g, own) @ hit)
        return as_float64(np.vstack(rows))

    def normal_equations(
        self, p: FloatArray, gains: _Frozen, columns: list[int]
    ) -> tuple[float, FloatArray, FloatArray]:
        """Half the sum of squares, direction of descent, Gauss-Newton matrix."""
        told = []
        for c, g in zip(self.parts, gains.parts, strict=True):
            own, hit = c.moved_by(columns)
            cost, descent, information = c.problem.normal_equations(p[c.source], g, own)
            told.append((cost, hit.T @ descent, hit.T @ information @ hit))
        cost = float(sum(t[0] for t in told))
        return cost, _sum([t[1] for t in told]), _sum([t[2] for t in told])


def _sum(arrays: Sequence[FloatArray]) -> FloatArray:
    return as_float64(np.sum(arrays, axis=0))
