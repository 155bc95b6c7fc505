"""What every search minimises: whitened residuals of data, and of what is known beforehand.

The grey-box model (`_core.Problem`) and the laboratory's regressions on a known motion are problems
of one form. Priors, and the wish that a quantity have a certain value, are further residuals.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ..._common.threads import check_time
from ...errors import NumericalError
from ...estimate import Learned, maximise_noise, promised_by_noise

# Gains that are kept; samples above which only the last ones are, and no normal equations.
_KEPT, _LONG = 3, 100_000

Rows = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Further residuals: from all parameters to errors (m,) and minus their derivatives (m, n)."""


class Problem(Protocol):
    """Nonlinear least squares over some of all parameters.

    `gains` is what stays as it is during a search: the gains of a filter, or None.
    """

    @property
    def samples(self) -> int:
        """Number of samples."""

    def residuals(self, p: FloatArray, gains: Any, /) -> FloatArray:
        """Whitened residuals."""

    def half_sum_of_squares(self, p: FloatArray, gains: Any, /) -> float:
        """Half the sum of their squares."""

    def sensitivities(self, p: FloatArray, gains: Any, columns: list[int], /) -> FloatArray:
        """Minus the derivatives of the residuals by the parameters `columns`, one row each."""

    def normal_equations(
        self, p: FloatArray, gains: Any, columns: list[int], /
    ) -> tuple[float, FloatArray, FloatArray]:
        """Half the sum of squares, G' e and G' G of the sensitivities G."""


class Predicting(Problem, Protocol):
    """A problem whose residuals are prediction errors of a filter with noise to be learned."""

    def freeze(self, p: FloatArray, noise: FloatArray, /) -> Any:
        """Gains of the filter, with the log-likelihood as `log_likelihood`."""

    def noise_score(
        self, p: FloatArray, noise: FloatArray, /
    ) -> tuple[float, FloatArray, FloatArray]:
        """Log-likelihood, its derivatives by the noise's logarithms, and their information."""


@runtime_checkable
class Together(Protocol):
    """A problem whose filter runs with several sets of parameters side by side."""

    def log_likelihoods(self, sets: FloatArray, noise: FloatArray, /) -> FloatArray:
        """Log-likelihoods of sets of parameters, a row each; minus infinity where one fails."""


@runtime_checkable
class Filtered(Protocol):
    """A problem that scores the noise along a filter that has run."""

    def filtered_noise_score(
        self, p: FloatArray, gains: Any, /
    ) -> tuple[float, FloatArray, FloatArray]:
        """What `noise_score` gives under the noise with which the gains were made."""


@dataclass(frozen=True)
class LinearRows:
    """Further residuals that are linear in the parameters: `target - rows @ p`."""

    rows: FloatArray
    target: FloatArray

    def __call__(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Errors, and minus their derivatives."""
        return as_float64(self.target - self.rows @ p), self.rows


def gaussian_prior(size: int, priors: dict[int, tuple[float, float]]) -> tuple[LinearRows, ...]:
    """Independent normal priors.

    Parameters
    ----------
    size : int
        Number of all parameters.
    priors : dict
        Mean and standard deviation by place of the parameter.

    Returns
    -------
    tuple of LinearRows
        Empty where there is no prior.
    """
    if not priors:
        return ()
    rows = np.zeros((len(priors), size))
    target = np.empty(len(priors))
    for i, (column, (mean, std)) in enumerate(priors.items()):
        rows[i, column] = 1.0 / std
        target[i] = mean / std
    return (LinearRows(rows, target),)


@dataclass(frozen=True)
class Penalised:
    """A problem with further residuals, which is a problem again.

    Parameters
    ----------
    problem : Problem
    prior : tuple of Rows
    """

    problem: Problem
    prior: tuple[Rows, ...] = ()

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.problem.samples

    def also(self, rows: Rows) -> Penalised:
        """The same with more residuals."""
        return replace(self, prior=(*self.prior, rows))

    def prior_cost(self, p: FloatArray) -> float:
        """Half the sum of squares of what is no data."""
        return sum((0.5 * float(e @ e) for e, _ in (rows(p) for rows in self.prior)), 0.0)

    def residuals(self, p: FloatArray, gains: Any = None) -> FloatArray:
        """All residuals, those of the data first."""
        errors = [rows(p)[0] for rows in self.prior]
        return np.concatenate([self.problem.residuals(p, gains).ravel(), *errors])

    def half_sum_of_squares(self, p: FloatArray, gains: Any = None) -> float:
        """Half the sum of squares alone."""
        check_time()
        return self.problem.half_sum_of_squares(p, gains) + self.prior_cost(p)

    def sensitivities(self, p: FloatArray, gains: Any, columns: list[int]) -> FloatArray:
        """Minus the derivatives of the residuals."""
        slopes = [rows(p)[1][:, columns] for rows in self.prior]
        return np.vstack([self.problem.sensitivities(p, gains, columns), *slopes])

    def normal_equations(
        self, p: FloatArray, gains: Any, columns: list[int]
    ) -> tuple[float, FloatArray, FloatArray]:
        """Half the sum of squares, direction of descent, Gauss-Newton matrix."""
        check_time()
        cost, descent, information = self.problem.normal_equations(p, gains, columns)
        for rows in self.prior:
            errors, slopes = rows(p)
            some = slopes[:, columns]
            cost += 0.5 * float(errors @ errors)
            descent = descent + some.T @ errors
            information = information + some.T @ some
        return cost, descent, information


class Seen(NamedTuple):
    """What the filter has run with, and its log-likelihood, priors included."""

    p: FloatArray
    noise: FloatArray
    log_likelihood: float


class _Scored(NamedTuple):
    """The score of the noise, and where it was asked for."""

    p: FloatArray
    noise: FloatArray
    found: tuple[float, FloatArray, FloatArray]


class _Linear(NamedTuple):
    """Normal equations, and where they were asked for."""

    p: FloatArray
    gains: Any
    columns: list[int]
    found: tuple[float, FloatArray, FloatArray]


@dataclass(frozen=True)
class Objective(Penalised):
    """The likelihood of a model with its priors, and of its noise.

    Parameters
    ----------
    problem : Predicting
    prior : tuple of Rows
    lowest, highest : array, shape (noises,)
        Within which the noise is learned.
    """

    problem: Predicting
    lowest: FloatArray = field(default_factory=lambda: np.empty(0))
    highest: FloatArray = field(default_factory=lambda: np.empty(0))
    _last: list[tuple[FloatArray, FloatArray, Any]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )
    _linear: list[_Linear] = field(default_factory=list, init=False, repr=False, compare=False)
    _seen: list[Seen] = field(default_factory=list, init=False, repr=False, compare=False)
    _score: list[_Scored] = field(default_factory=list, init=False, repr=False, compare=False)

    @property
    def likeliest(self) -> Seen | None:
        """The likeliest of all parameters and noise that the filter has run with."""
        return self._seen[0] if self._seen else None

    def freeze(self, p: FloatArray, noise: FloatArray) -> Any:
        """Gains of the filter; their log-likelihood is that of the data alone.

        Those asked for last are kept: searches end where the next one begins, and go back to where
        they were.
        """
        check_time()
        gains = self._known(p, noise)
        if gains is not None:
            return gains
        gains = self.problem.freeze(p, noise)
        value = self.reached(p, gains)
        if not self._seen or value > self._seen[0].log_likelihood:
            self._seen[:] = [Seen(p.copy(), noise.copy(), value)]
        kept = 1 if self.samples > _LONG else _KEPT
        self._last[:] = [(p.copy(), noise.copy(), gains), *self._last[: kept - 1]]
        return gains

    def normal_equations(
        self, p: FloatArray, gains: Any, columns: list[int]
    ) -> tuple[float, FloatArray, FloatArray]:
        """Half the sum of squares, direction of descent, Gauss-Newton matrix.

        Those asked for last are kept: where a search ends the next one begins, and standard errors
        are those of its end.
        """
        for last in tuple(self._linear):
            if last.gains is gains and last.columns == columns and np.array_equal(last.p, p):
                return last.found
        found = super().normal_equations(p, gains, columns)
        if self.samples <= _LONG:
            last = _Linear(p.copy(), gains, list(columns), found)
            self._linear[:] = [last, *self._linear[: _KEPT - 1]]
        return found

    def log_likelihood(self, p: FloatArray, noise: FloatArray) -> float:
        """Of the data, less what the priors cost."""
        return self.reached(p, self.freeze(p, noise))

    def reached(self, p: FloatArray, gains: Any) -> float:
        """The same where the gains of the parameters are known."""
        return float(gains.log_likelihood) - self.prior_cost(p)

    def log_likelihoods(self, sets: FloatArray, noise: FloatArray) -> FloatArray:
        """The same for several sets of parameters, minus infinity where the model fails.

        Parameters
        ----------
        sets : array, shape (sets, parameters)
        noise : array, shape (noises,)

        Returns
        -------
        array, shape (sets,)
        """
        check_time()
        if isinstance(self.problem, Together):
            values = self.problem.log_likelihoods(sets, noise)
            return as_float64(values - [self.prior_cost(p) for p in sets])

        def one(p: FloatArray) -> float:
            try:
                return self.log_likelihood(p, noise)
            except NumericalError:
                return -np.inf

        return as_float64([one(p) for p in sets])

    def learn_noise(
        self, p: FloatArray, noise: FloatArray, *, rounds: int = 12, enough: float = 0.01
    ) -> Learned:
        """Noise of maximum likelihood at fixed parameters, and the log-likelihood of the data."""
        return maximise_noise(
            self,
            p,
            noise,
            self.lowest,
            self.highest,
            rounds=rounds,
            enough=enough,
            likelihood=lambda v: float(self.freeze(p, v).log_likelihood),
            along=self._tells,
        )

    def noise_promises(self, p: FloatArray, noise: FloatArray) -> float:
        """What a step of the noise promises to gain at fixed parameters [nats]."""
        return promised_by_noise(self, p, noise, self.lowest, self.highest)

    def noise_score(self, p: FloatArray, noise: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Log-likelihood of the data, its derivatives by the noise's logarithms, their information.

        It goes along the filter, which is kept: searches go on from it. So is the last score: what
        it promises tells whether the noise is worth learning.
        """
        check_time()
        for last in tuple(self._score):
            if np.array_equal(last.p, p) and np.array_equal(last.noise, noise):
                return last.found
        if isinstance(self.problem, Filtered) and self._tells:
            found = self.problem.filtered_noise_score(p, self.freeze(p, noise))
        else:
            found = self.problem.noise_score(p, noise)
        self._score[:] = [_Scored(p.copy(), noise.copy(), found)]
        return found

    @property
    def _tells(self) -> bool:
        """Whether the noise is scored along a filter that has run."""
        return isinstance(self.problem, Filtered) and self.samples <= _core.TOLD_SAMPLES

    def _known(self, p: FloatArray, noise: FloatArray) -> Any:
        """Gains that were asked for last, or None."""
        for at, under, gains in tuple(self._last):
            if np.array_equal(at, p) and np.array_equal(under, noise):
                return gains
        return None
