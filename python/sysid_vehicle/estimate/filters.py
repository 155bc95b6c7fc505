"""Kalman filters over a model written in Python: extended and unscented, both on square roots.

These are the filters of ``cpp/include/sysid/estimate/filter.hpp`` in NumPy, for models one wants to
try. The covariance is carried as its Cholesky factor and nothing is ever subtracted from it. They
are some hundred times slower than the compiled ones, which never call back into Python;
a model that proves itself is worth a C++ description of the same two functions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import scipy

from .._common.arrays import FloatArray, as_float64
from ..errors import InvalidInput, NumericalError

METHODS = ("ekf", "ukf")
# Of central differences, of the size or standard deviation of the state: rounding stays below
# 1e-11.
_STEP = 1e-4
_SUREST = 1e-12  # variance, of the largest, below which a correlation's eigenvalue is rounding


class StateModel(Protocol):
    """What a model gives; `u` is whatever is known at a sample, NaN in a measurement is missing."""

    def predict(self, u: Any, x: FloatArray) -> FloatArray:
        """State at the sample of `u` from the state one sample before."""

    def observe(self, u: Any, x: FloatArray) -> FloatArray:
        """Expected measurement."""

    def process_noise(self, u: Any) -> FloatArray:
        """Covariance of what `predict` leaves out."""

    def measurement_noise(self, u: Any) -> FloatArray:
        """Covariance of the measurement noise."""


@dataclass(frozen=True)
class FilterState:
    """A sample as a filter saw it; missing and refused readings have innovation 0."""

    predicted_mean: FloatArray
    predicted_covariance: FloatArray
    mean: FloatArray
    covariance: FloatArray
    transition: FloatArray
    innovation: FloatArray
    whitened: FloatArray  # innovations of variance 1, NaN where missing
    nis: float
    observed: int
    refused: int
    log_likelihood: float


@dataclass(frozen=True)
class FilterRun:
    """A record as a filter saw it; `n` samples."""

    steps: tuple[FilterState, ...] = field(repr=False)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in FilterState.__dataclass_fields__:
            raise AttributeError(name)
        return np.array([getattr(s, name) for s in self.steps])

    def smooth(self) -> tuple[FloatArray, FloatArray]:
        """Means (n, nx) and covariances (n, nx, nx) given all measurements (Rauch-Tung-Striebel).

        With an unscented filter the regression of the new on the old state stands for the
        transition, which is the unscented smoother (Särkkä, IEEE Trans. Automatic Control 2008).
        No variance is negative: the covariance is a sum of squares, where the textbook's difference
        of covariances loses its sign to rounding if hardly any noise enters. Where the predicted
        covariance is singular, the pseudo-inverse of its correlations gives the gain.
        """
        mean, covariance = self.mean.copy(), self.covariance.copy()
        for k in range(len(self.steps) - 2, -1, -1):
            now, after = self.steps[k], self.steps[k + 1]
            size = np.sqrt(np.diag(after.predicted_covariance))
            per_size = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
            correlation = per_size[:, None] * after.predicted_covariance * per_size
            carried = after.transition @ now.covariance
            scaled = np.linalg.lstsq(correlation, per_size[:, None] * carried, rcond=_SUREST)[0]
            gain = scaled.T * per_size
            mean[k] += gain @ (mean[k + 1] - after.predicted_mean)
            entered = after.predicted_covariance - carried @ after.transition.T
            kept = np.eye(len(gain)) - gain @ after.transition
            before = np.sqrt(np.diag(now.predicted_covariance))
            roots = [
                kept @ _root_of(now.covariance, before),
                gain @ _root_of(0.5 * (entered + entered.T), size),
                gain @ _root_of(covariance[k + 1], size),
            ]
            covariance[k] = sum(root @ root.T for root in roots)
        return mean, covariance


class StateFilter:
    """A filter over a :class:`StateModel`, one sample at a time or over a record.

    Parameters
    ----------
    model : StateModel
        The model.
    mean, covariance : array_like, shapes (nx,), (nx, nx)
        What is known at the first sample, which is not predicted to.
    method : {"ukf", "ekf"}
        Unscented, or extended with central differences for the derivatives.
    gate_probability : float, optional
        Readings less probable than this are refused; none are if left out.
    gate_patience : int
        After so many refusals in a row a reading is taken again: the filter is wrong then.
    adapt_rate : float
        Weight of one sample in the running variance of the residuals by which the measurement
        noise is rescaled within 0.1 to 100 times its own (Mohamed & Schwarz, J. Geodesy 1999).

    Raises
    ------
    InvalidInput
        If sizes do not fit, or a matrix is no covariance.
    """

    def __init__(
        self,
        model: StateModel,
        mean: FloatArray | Sequence[float],
        covariance: FloatArray,
        *,
        method: str = "ukf",
        gate_probability: float | None = None,
        gate_patience: int = 10,
        adapt_rate: float = 0.0,
    ) -> None:
        if method not in METHODS:
            raise InvalidInput(f"method: '{method}' is not known; give one of {', '.join(METHODS)}")
        if gate_probability is not None and not 0.0 < gate_probability < 1.0:
            raise InvalidInput(f"gate_probability: {gate_probability:g} lies outside 0 to 1")
        if gate_patience < 1 or not 0.0 <= adapt_rate < 1.0:
            raise InvalidInput("gate_patience must be 1 or more, adapt_rate lie in 0 to 1")
        self.model, self.method, self._adapt = model, method, adapt_rate
        self._bound = (
            None if gate_probability is None else scipy.stats.norm.isf(0.5 * gate_probability)
        )
        self._patience = gate_patience
        self.mean = as_float64(mean).copy()
        if self.mean.ndim != 1 or not np.isfinite(self.mean).all():
            raise InvalidInput("mean: expected finite numbers of shape (nx,)")
        self.samples = 0
        self._root = self._factor(self._checked(covariance, len(self.mean), "covariance"))
        self.noise_scale: FloatArray | None = None
        self._refused: FloatArray | None = None

    @property
    def covariance(self) -> FloatArray:
        """Of the state, shape (nx, nx)."""
        return np.asarray(self._root @ self._root.T)

    def step(self, u: Any, y: FloatArray | Sequence[float]) -> FilterState:
        """Predict to this sample (not before the first) and use the measurement.

        Raises
        ------
        NumericalError
            If a number is infinite or a matrix no covariance; the message gives the sample.
        """
        y = as_float64(y).copy()
        if y.ndim != 1 or np.isinf(y).any():
            self._fail("the measurement is not a vector of finite numbers (NaN marks missing)")
        n, transition = len(self.mean), np.eye(len(self.mean))
        if self.samples > 0:
            Q = self._noise(self.model.process_noise(u), n, "process noise")
            expected, transition, rest = self._line(self.model.predict, u)
            self.mean = expected
            self._root = _triangular(np.hstack([transition @ self._root, rest, _root_of(Q)]))
        if len(self.mean) != n:
            self._fail(f"predict gives {len(self.mean)} values for a state of {n}")
        before = self.mean.copy(), self.covariance
        expected, H, rest = self._line(self.model.observe, u)
        if len(expected) != len(y):
            self._fail(f"observe gives {len(expected)} values for a measurement of {len(y)}")
        R = self._noise(self.model.measurement_noise(u), len(y), "measurement noise")
        if self.noise_scale is None or self._refused is None:
            self.noise_scale, self._refused = np.ones(len(y)), np.zeros(len(y))
        scale = np.sqrt(self.noise_scale)
        R = scale[:, None] * R * scale
        refused = self._gate(y, expected, np.hstack([H @ self._root, rest, _root_of(R)]))
        there = np.isfinite(y)
        error = np.where(there, y - expected, 0.0)
        m = int(there.sum())
        noise = np.hstack([rest, _root_of(R)])[there]
        # One orthogonal transformation gives gain and new factor; nothing is subtracted.
        top = np.hstack([H[there] @ self._root, noise])
        bottom = np.hstack([self._root, np.zeros((n, noise.shape[1]))])
        lower = _triangular(np.vstack([top, bottom]))
        diagonal = np.abs(np.diag(lower)[:m])
        if not np.isfinite(lower).all() or (diagonal <= 0.0).any():
            self._fail("the innovation covariance is not positive definite")
        white = np.linalg.solve(lower[:m, :m], error[there])
        self.mean = self.mean + lower[m:, :m] @ white
        self._root = lower[m:, m:]
        if not np.isfinite(self.mean).all():
            self._fail("the state is not finite")
        if self._adapt > 0.0:
            self._follow_noise(u, y, H, R)
        whitened = np.full(len(y), np.nan)
        whitened[there] = white
        self.samples += 1
        nis = float(white @ white)
        density = -0.5 * (nis + m * math.log(2.0 * math.pi)) - float(np.log(diagonal).sum())
        return FilterState(
            *before, self.mean.copy(), self.covariance, transition, error, whitened, nis, m,
            refused, density,
        )  # fmt: skip

    def run(self, inputs: Sequence[Any], measurements: FloatArray) -> FilterRun:
        """Filter a record, with the numbers of as many steps."""
        if len(inputs) != len(measurements):
            raise InvalidInput(f"{len(inputs)} inputs for {len(measurements)} measurements")
        steps = zip(inputs, measurements, strict=True)
        return FilterRun(tuple(self.step(u, y) for u, y in steps))

    def copy(self) -> StateFilter:
        """An independent filter in the same state."""
        other = object.__new__(StateFilter)
        other.__dict__.update(self.__dict__)
        for name in ("mean", "_root", "noise_scale", "_refused"):
            value = getattr(self, name)
            setattr(other, name, None if value is None else value.copy())
        return other

    def _line(self, function: Any, u: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Value, slope, and a root of what the line leaves over the spread of the state."""
        x, n = self.mean, len(self.mean)
        if self.method == "ekf":
            steps = _STEP * np.maximum(np.abs(x), np.sqrt(np.diag(self.covariance)) + 1e-12)
            columns = [
                (as_float64(function(u, x + d)) - as_float64(function(u, x - d))) / (2.0 * h)
                for d, h in zip(np.diag(steps), steps, strict=True)
            ]
            value = as_float64(function(u, x.copy()))
            return value, np.column_stack(columns), np.zeros((len(value), 0))
        spread, weight = math.sqrt(n + 1.0), 0.5 / (n + 1.0)
        centre = as_float64(function(u, x.copy()))
        plus = np.array([as_float64(function(u, x + spread * c)) for c in self._root.T]).T
        minus = np.array([as_float64(function(u, x - spread * c)) for c in self._root.T]).T
        mean = 2.0 * weight * centre + weight * (plus + minus).sum(axis=1)
        along = weight * spread * (plus - minus)
        rest = math.sqrt(weight) * np.column_stack(
            [
                math.sqrt(2.0) * (centre - mean),
                plus - mean[:, None] - spread * along,
                minus - mean[:, None] + spread * along,
            ]
        )
        slope = np.linalg.solve(self._root.T, along.T).T
        return mean, slope, rest

    def _gate(self, y: FloatArray, expected: FloatArray, root: FloatArray) -> int:
        assert self._refused is not None
        if self._bound is None:
            return 0
        far = np.abs(y - expected) > self._bound * np.sqrt((root**2).sum(axis=1))
        drop = far & (self._refused < self._patience)
        kept = far | np.isnan(y)
        self._refused = np.where(drop, self._refused + 1, np.where(kept, self._refused, 0))
        y[drop] = np.nan
        return int(drop.sum())

    def _follow_noise(self, u: Any, y: FloatArray, H: FloatArray, R: FloatArray) -> None:
        assert self.noise_scale is not None
        left = y - as_float64(self.model.observe(u, self.mean))
        seen = (left**2 + ((H @ self._root) ** 2).sum(axis=1)) * self.noise_scale / np.diag(R)
        mixed = (1.0 - self._adapt) * self.noise_scale + self._adapt * seen
        self.noise_scale = np.where(np.isnan(y), self.noise_scale, np.clip(mixed, 0.1, 100.0))

    def _noise(self, C: FloatArray, size: int, what: str) -> FloatArray:
        try:
            return self._checked(C, size, what)
        except InvalidInput as error:
            self._fail(str(error))
            raise

    @staticmethod
    def _checked(C: FloatArray, size: int, what: str) -> FloatArray:
        C = as_float64(C)
        if C.shape != (size, size):
            raise InvalidInput(f"{what}: shape {C.shape}; expected ({size}, {size})")
        if not np.isfinite(C).all():
            raise InvalidInput(f"{what}: holds NaN or infinity")
        if np.abs(C - C.T).max(initial=0.0) > 1e-9 * np.abs(C).max(initial=0.0):
            raise InvalidInput(f"{what}: is not symmetric")
        if np.linalg.eigvalsh(C)[0] < -1e-12 * np.abs(C).max(initial=0.0):
            raise InvalidInput(f"{what}: has a negative variance")
        return C

    def _factor(self, P: FloatArray) -> FloatArray:
        try:
            return np.asarray(np.linalg.cholesky(P), dtype=np.float64)
        except np.linalg.LinAlgError:
            raise InvalidInput(
                "covariance: is singular; give every state a variance above 0"
            ) from None

    def _fail(self, what: str) -> None:
        raise NumericalError(f"{what} at sample {self.samples}")


def _triangular(array: FloatArray) -> FloatArray:
    """Lower factor L with L L' = A A'."""
    lower = np.asarray(np.linalg.qr(array.T).R).T
    signs = np.where(np.diag(lower) < 0.0, -1.0, 1.0)
    return np.asarray(lower * signs, dtype=float)


def _root_of(C: FloatArray, size: FloatArray | None = None) -> FloatArray:
    """Any root of a covariance, which may be singular.

    What rounding left below zero is cut: of the covariance, or of it scaled by standard deviations
    `size` where states of different units would round each other away.
    """
    try:
        return np.asarray(np.linalg.cholesky(C), dtype=np.float64)
    except np.linalg.LinAlgError:
        if size is None:
            size = np.ones(len(C))
        per_size = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
        values, vectors = np.linalg.eigh(per_size[:, None] * C * per_size)
        return np.asarray(size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
