"""The default objective: joint likelihood of v_x, v_y, yaw rate and lateral acceleration.

Equations: `cpp/include/sysid/lab/tyre_likelihood.hpp`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import _core
from .._arrays import FloatArray, as_float64
from ..errors import NumericalError

__all__ = ["NOISES", "Likelihood", "SoftRow", "learn_noise"]

NOISES = (
    "v_x [m/s]",
    "v_y [m/s]",
    "yaw rate [rad/s]",
    "a_y [m/s2]",
    "disturbed v_x [m/s per root second]",
    "disturbed v_y [m/s per root second]",
    "disturbed yaw rate [rad/s per root second]",
)

SoftRow = Callable[[FloatArray], tuple[float, FloatArray]]
"""A residual that is added to those of the data, and its gradient by all parameters."""


@dataclass(frozen=True)
class Likelihood:
    """Prediction errors of the grey-box car with priors, in the form local searches ask for.

    Parameters
    ----------
    problem : TyreProblem
    centre, per_std : array, shape (parameters,)
        Gaussian prior of each parameter; `per_std` is zero where there is none.
    soft : tuple of SoftRow
        Further residuals.
    """

    problem: _core.TyreProblem
    centre: FloatArray
    per_std: FloatArray
    soft: tuple[SoftRow, ...] = ()

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.problem.samples

    def _prior(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        where = np.flatnonzero(self.per_std)
        errors = [(self.centre[where] - p[where]) * self.per_std[where]]
        slopes = np.zeros((len(where) + len(self.soft), len(p)))
        slopes[np.arange(len(where)), where] = self.per_std[where]
        for i, row in enumerate(self.soft):
            value, slope = row(p)
            errors.append(np.array([-value]))
            slopes[len(where) + i] = slope
        return np.concatenate(errors), slopes

    def normal_equations(
        self, p: FloatArray, gains: _core.FrozenGains, columns: list[int]
    ) -> tuple[float, FloatArray, FloatArray]:
        """Half the sum of squares, direction of descent, Gauss-Newton matrix."""
        cost, gradient, information = self.problem.normal_equations(p, gains, columns)
        errors, slopes = self._prior(p)
        some = slopes[:, columns]
        return (
            cost + 0.5 * float(errors @ errors),
            gradient + some.T @ errors,
            information + some.T @ some,
        )

    def prior_cost(self, p: FloatArray) -> float:
        """Half the sum of squares of the priors and of further residuals."""
        errors, _ = self._prior(p)
        return 0.5 * float(errors @ errors)

    def half_sum_of_squares(self, p: FloatArray, gains: _core.FrozenGains) -> float:
        """Half the sum of squares alone."""
        return self.problem.half_sum_of_squares(p, gains) + self.prior_cost(p)

    def residuals(self, p: FloatArray, gains: _core.FrozenGains) -> FloatArray:
        """All residuals, those of the priors last."""
        errors, _ = self._prior(p)
        return np.concatenate([self.problem.residuals(p, gains).ravel(), errors])

    def sensitivities(
        self, p: FloatArray, gains: _core.FrozenGains, columns: list[int]
    ) -> FloatArray:
        """Minus the derivatives of the residuals."""
        _, slopes = self._prior(p)
        return np.vstack([self.problem.sensitivities(p, gains, columns), slopes[:, columns]])


# Of the disturbances: what steps of 10 ms and axles without a width leave out. Beside the true
# tyres a step is 3e-7 m/s, 3e-6 m/s and 3e-6 rad/s off in a slide: ten times that per root second
# where each step errs anew, as of v_y and yaw rate, and a hundred times where all of a second err
# alike, as of v_x. Without that floor a minute of sliding is taken as one calculation, and its
# coefficients as known to the sixth figure.
_SMALLEST = np.array([1e-4, 1e-4, 1e-5, 1e-4, 3e-5, 3e-5, 3e-5])
_LARGEST = np.array([10.0, 10.0, 2.0, 20.0, 5.0, 5.0, 5.0])


def learn_noise(
    problem: _core.TyreProblem, p: FloatArray, start: FloatArray, *, rounds: int = 12
) -> tuple[FloatArray, float]:
    """Noise of maximum likelihood at fixed tyres, and the log-likelihood.

    Fisher scoring with damping on the logarithms; the likelihood never falls.

    Parameters
    ----------
    problem : TyreProblem
    p : array, shape (parameters,)
    start : array, shape (7,)
        In the order of `NOISES`.
    rounds : int
        Most steps.

    Returns
    -------
    noise : array, shape (7,)
    log_likelihood : float
    """
    low, high = np.log(_SMALLEST), np.log(_LARGEST)
    eta = np.clip(np.log(np.maximum(start, 1e-12)), low, high)
    value, gradient, information = problem.noise_score(p, as_float64(np.exp(eta)))
    damping = 1e-3
    for _ in range(rounds):
        free = ~(((eta <= low) & (gradient < 0)) | ((eta >= high) & (gradient > 0)))
        free &= np.diag(information) > 1e-9
        gained = 0.0
        for _ in range(6):
            if not free.any():
                break
            system = information[np.ix_(free, free)]
            system = system + np.diag(damping * np.diag(system) + 1e-3)
            step = np.zeros_like(eta)
            step[free] = np.clip(np.linalg.solve(system, gradient[free]), -2.0, 2.0)
            trial = np.clip(eta + step, low, high)
            try:
                there = problem.noise_score(p, as_float64(np.exp(trial)))
            except NumericalError:
                there = (-np.inf, gradient, information)
            if there[0] > value:
                gained = there[0] - value
                eta, (value, gradient, information) = trial, there
                damping = max(damping / 6.0, 1e-7)
                break
            damping *= 8.0
        if gained < 0.05:
            break
    return as_float64(np.exp(eta)), float(value)
