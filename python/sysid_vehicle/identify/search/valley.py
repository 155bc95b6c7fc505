"""The way down a narrow, bent valley: least squares with geodesic acceleration.

B, C, D and E copy each other where driving stays below the peak. Steps of Gauss and Newton are
tangents of that valley: either they leave it or they are short. A step that bends with the
residuals follows it (Transtrum & Sethna, arXiv:1201.5885, 2012).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ...errors import NumericalError
from .objective import Problem
from .search import Box, least_within

_LEAST_DAMPING = 1e-13
_HARDLY_DAMPED = (_LEAST_DAMPING, 1e-9, 1e-6)
_TRIALS = 14
_PROBE = 0.1  # of the step: where the second derivative is taken
_BENT = 1.5  # twice the bend over the step, beyond which the expansion means nothing
_TINY = 1e-14


@dataclass(frozen=True)
class _Slope:
    """Derivatives at a point, by the logarithm of what is positive, scaled to unit curvature."""

    to_lower: FloatArray
    to_upper: FloatArray
    scale: FloatArray
    by: FloatArray  # minus the derivatives of the residuals, shape (residuals, free)
    gradient: FloatArray  # downhill
    curvature: FloatArray

    def step(self, damping: float) -> FloatArray:
        """Minimum of the damped quadratic model over the box."""
        values, vectors = np.linalg.eigh(self.curvature + damping * np.eye(len(self.scale)))
        lower, upper = np.minimum(self.to_lower, -_TINY), np.maximum(self.to_upper, _TINY)
        return least_within(np.maximum(values, _TINY), vectors, self.gradient, lower, upper)

    def gain(self, step: FloatArray) -> float:
        """What the quadratic model promises."""
        return float(self.gradient @ step - 0.5 * step @ self.curvature @ step)

    def promises(self, gain: float) -> bool:
        """Whether the quadratic model has a step of such a gain.

        Where parameters copy each other the undamped step is lost in rounding, at a bound above
        all, and only slightly damped ones show what is to be had.
        """
        return any(self.gain(self.step(damping)) >= gain for damping in _HARDLY_DAMPED)

    def bend(self, step: FloatArray, second: FloatArray, damping: float) -> FloatArray:
        """Second-order part of a step, from the residuals' second derivative along it."""
        free = (step > self.to_lower + _TINY) & (step < self.to_upper - _TINY)
        out = np.zeros_like(step)
        normal = self.curvature[np.ix_(free, free)] + (damping + _TINY) * np.eye(int(free.sum()))
        out[free] = np.linalg.solve(normal, self.by[:, free].T @ second)
        return out


@dataclass(frozen=True)
class _Valley:
    """Residuals as a function of the free parameters, with gains that stay as they are."""

    objective: Problem
    p: FloatArray
    gains: Any
    box: Box

    def full(self, x: FloatArray) -> FloatArray:
        return self.box.put(self.p, x)

    def residuals(self, x: FloatArray) -> FloatArray | None:
        """None where the car spins in the model."""
        try:
            found = self.objective.residuals(self.full(x), self.gains).ravel()
        except NumericalError:
            return None
        return found if np.isfinite(found).all() else None

    def slope(self, x: FloatArray, residuals: FloatArray) -> _Slope:
        by = self.objective.sensitivities(self.full(x), self.gains, self.box.columns)
        by = by * self.box.units(x)
        scale = np.sqrt(np.maximum(np.einsum("ij,ij->j", by, by), 1e-12))
        by = by / scale
        lower, upper = self.box.room(x)
        return _Slope(lower * scale, upper * scale, scale, by, by.T @ residuals, by.T @ by)

    def bent(
        self, x: FloatArray, residuals: FloatArray, slope: _Slope, damping: float
    ) -> tuple[FloatArray, float] | None:
        """Give a step that follows the valley, and what its tangent promises.

        None where the valley bends too much for a step of that length.
        """
        tangent = slope.step(damping)
        probe = self.residuals(self.box.moved(x, _PROBE * tangent / slope.scale))
        if probe is None:
            return None
        second = 2.0 / _PROBE * ((probe - residuals) / _PROBE + slope.by @ tangent)
        bend = slope.bend(tangent, second, damping)
        if 2.0 * np.linalg.norm(bend) > _BENT * np.linalg.norm(tangent):
            return None
        step = np.clip(tangent + 0.5 * bend, slope.to_lower, slope.to_upper)
        return as_float64(step / slope.scale), slope.gain(tangent)


def down_the_valley(
    objective: Problem,
    p: FloatArray,
    gains: Any,
    box: Box,
    *,
    tolerance: float = 1e-4,
    rounds: int = 100,
) -> FloatArray:
    """Least squares of the prediction errors, with gains that stay as they are, to the very bottom.

    It ends where no undamped step promises as much as `tolerance`: that a damped one gains little
    says nothing where the parameters copy each other, for damping is what makes it short.

    Parameters
    ----------
    objective : Problem
    p : array, shape (parameters,)
    gains : frozen gains of the problem
    box : Box
    tolerance : float
        In nats.
    rounds : int
        Most steps.

    Returns
    -------
    array, shape (parameters,)
    """
    valley = _Valley(objective, p, gains, box)
    x = as_float64(np.clip(p[box.columns], box.lower, box.upper))
    residuals = valley.residuals(x)
    if residuals is None:
        return p
    cost, damping = 0.5 * float(residuals @ residuals), 1e-3
    for _ in range(rounds):
        slope = valley.slope(x, residuals)
        if not slope.promises(tolerance):
            break
        for _ in range(_TRIALS):
            found = valley.bent(x, residuals, slope, damping)
            if found is None:
                damping *= 4.0
                continue
            trial = box.moved(x, found[0])
            there = valley.residuals(trial)
            value = np.inf if there is None else 0.5 * float(there @ there)
            if there is not None and value < cost:
                kept = (cost - value) / max(found[1], 1e-300)
                # What keeps its promise may reach further next time.
                damping *= 0.1 if kept > 0.5 else 0.33 if kept > 0.25 else 1.5
                damping = max(damping, _LEAST_DAMPING)
                x, residuals, cost = trial, there, value
                break
            damping *= 5.0
        else:
            break
    return valley.full(x)
