"""What the Magic Formula's coefficients mean together, with derivatives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy

from ..._common.arrays import FloatArray, as_float64
from ...tyre import Tyre, magic_formula

_PEAKLESS = 1.0 + 1e-6
_RELATIVE = 1e-12  # error of the slip at the peak


def friction(slip_rad: FloatArray, bcde: FloatArray) -> FloatArray:
    """Lateral force over load; shape of `slip_rad`."""
    return magic_formula(slip_rad, *map(float, bcde))


def stiffness(bcde: FloatArray) -> float:
    """Cornering stiffness over load, B C D [1/rad]."""
    return float(bcde[0] * bcde[1] * bcde[2])


def top(bcde: FloatArray) -> float:
    """Highest friction, D (below it, where C is too small for a peak)."""
    return float(bcde[2] * np.sin(0.5 * np.pi * min(bcde[1], 1.0)))


def peak_slip(bcde: FloatArray) -> float:
    """Slip angle of the peak [rad]; infinite where there is none."""
    b, c, _, e = map(float, bcde)
    if c <= _PEAKLESS:
        return np.inf
    wanted = np.tan(0.5 * np.pi / c)

    def beyond(x: float) -> float:
        # Of x less e x nothing would be left where E is near 1, and the root finder would stray.
        return float((1.0 - e) * x + e * np.arctan(x) - wanted)

    # For E below 1 it grows without end and has one root.
    high = 1.0
    while beyond(high) < 0.0:
        high *= 2.0
        if high > 1e9:
            return np.inf
    return float(scipy.optimize.brentq(beyond, 0.0, high, xtol=1e-15 * high, rtol=_RELATIVE)) / b


def of_usual_shape(bcde: FloatArray) -> FloatArray:
    """The tyre of usual C, D and E that has the same stiffness."""
    usual = Tyre()
    return as_float64([stiffness(bcde) / (usual.C * usual.D), usual.C, usual.D, usual.E])


def look_alike(bcde: FloatArray, e: float) -> FloatArray:
    """The tyre of curvature factor `e` that has the same stiffness, the same peak at the same slip.

    B, C, D, E copy each other along these. Where no such tyre exists B, C and D stay.
    """
    b, c, d, _ = map(float, bcde)
    wanted = peak_slip(bcde)
    low, high = _PEAKLESS + 1e-3, 3.0

    def peak_at(shape: float) -> float:
        return peak_slip(np.array([b * c / shape, shape, d, e])) - wanted

    if not np.isfinite(wanted) or not peak_at(low) > 0.0 > peak_at(high):
        return np.array([b, c, d, e])
    shape = float(scipy.optimize.brentq(peak_at, low, high))
    return np.array([b * c / shape, shape, d, e])


COMBINATIONS: dict[str, tuple[Callable[[FloatArray], float], str]] = {
    "BCD": (stiffness, "1/rad"),
    "peak": (top, "1"),
    "peak_slip": (peak_slip, "rad"),
}
"""Name, function of B, C, D, E, and unit."""


def slope_of(function: Callable[[FloatArray], float | FloatArray], bcde: FloatArray) -> FloatArray:
    """Central differences by B, C, D, E along the last axis; NaN where one does not exist."""
    slopes = []
    for i in range(4):
        step = 1e-5 * max(abs(float(bcde[i])), 0.1)
        high, low = bcde.copy(), bcde.copy()
        high[i] += step
        low[i] -= step
        with np.errstate(invalid="ignore"):
            slopes.append((function(high) - function(low)) / (2.0 * step))
    return np.stack(slopes, axis=-1)
