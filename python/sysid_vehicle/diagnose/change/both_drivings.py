"""The likelihood of two drivings of a car together, some parameters of which differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ...identify.search.objective import Predicting, Together


class OneDriving(Predicting, Together, Protocol):
    """The likelihood of one of them, as `Driving.problem` gives it."""


@dataclass(frozen=True, eq=False)
class _Gains:
    later: Any
    before: Any
    log_likelihood: float


@dataclass(frozen=True, eq=False)
class BothDrivings:
    """Two drivings as one problem (`identify.objective.Predicting`).

    Parameters
    ----------
    later, before : OneDriving
        Of models with the same effects.
    own : array, shape (parameters,)
        Of `before`.
    shared : sequence of int
        Columns of parameters that are in both the same.
    noise : array, shape (noises,)
        Of the later driving; what is given is that of the reference.
    """

    later: OneDriving
    before: OneDriving
    own: FloatArray
    shared: Sequence[int]
    noise: FloatArray

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.later.samples + self.before.samples)

    def freeze(self, p: FloatArray, noise: FloatArray) -> _Gains:
        """Gains of both filters."""
        later = self.later.freeze(p, self.noise)
        before = self.before.freeze(self._own(p), noise)
        return _Gains(later, before, float(later.log_likelihood + before.log_likelihood))

    def residuals(self, p: FloatArray, gains: _Gains) -> FloatArray:
        """Whitened residuals, those of the later driving first."""
        one = self.later.residuals(p, gains.later).ravel()
        return np.concatenate([one, self.before.residuals(self._own(p), gains.before).ravel()])

    def half_sum_of_squares(self, p: FloatArray, gains: _Gains) -> float:
        """Half the sum of their squares."""
        one = self.later.half_sum_of_squares(p, gains.later)
        return float(one + self.before.half_sum_of_squares(self._own(p), gains.before))

    def sensitivities(self, p: FloatArray, gains: _Gains, columns: list[int]) -> FloatArray:
        """Minus the derivatives of the residuals by the parameters `columns`."""
        one = self.later.sensitivities(p, gains.later, columns)
        other = self.before.sensitivities(self._own(p), gains.before, columns)
        return np.vstack([one, other * self._moves(columns)])

    def normal_equations(
        self, p: FloatArray, gains: _Gains, columns: list[int]
    ) -> tuple[float, FloatArray, FloatArray]:
        """Half the sum of squares, G' e and G' G of the sensitivities G."""
        one = self.later.normal_equations(p, gains.later, columns)
        few = np.flatnonzero(self._moves(columns))
        own = [columns[i] for i in few]
        cost, descent, information = self.before.normal_equations(self._own(p), gains.before, own)
        one[1][few] += descent
        one[2][np.ix_(few, few)] += information
        return float(one[0] + cost), as_float64(one[1]), as_float64(one[2])

    def noise_score(self, p: FloatArray, noise: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Log-likelihood, its derivatives by the logarithms of `noise`, and their information."""
        value, slope, information = self.before.noise_score(self._own(p), noise)
        more = float(self.later.freeze(p, self.noise).log_likelihood)
        return value + more, slope, information

    def log_likelihoods(self, sets: FloatArray, noise: FloatArray) -> FloatArray:
        """Of sets of parameters, a row each; minus infinity where one fails."""
        own = np.array([self._own(p) for p in sets])
        later = self.later.log_likelihoods(sets, self.noise)
        return as_float64(later + self.before.log_likelihoods(own, noise))

    def _own(self, p: FloatArray) -> FloatArray:
        own = self.own.copy()
        own[list(self.shared)] = p[list(self.shared)]
        return own

    def _moves(self, columns: list[int]) -> FloatArray:
        """Of each column whether it moves the reference."""
        return as_float64([float(c in self.shared) for c in columns])
