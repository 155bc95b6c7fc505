"""Sideslip angles, which many sensors give in place of the lateral speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..._common.arrays import FloatArray, as_float64

SIDESLIP = "sideslip_rad"
"""A column of this name holds the sideslip angle at the CG [rad], positive to the left."""

_LARGEST_RAD = 1.4  # beyond, the car has no forward speed to speak of: the angle is noise

# What a lateral speed is made of at low lateral acceleration, v_y = l_r r - K_r v a_y + e v: the
# distance of the sensor from the rear axle [m], the slip of the rear tyres over a_y [rad s^2/m],
# and how far the sensor is turned [rad].
_USUAL = np.array([1.4, -0.004, 0.0])
_SPREAD = np.array([0.9, 0.003, 0.02])
_LASTS_S = 1.0  # what that leaves out: manoeuvres, late sensors
_TELLS = 6.0  # twice nats, by which the other sign has to be likelier


def lateral_speed(time_s: FloatArray, vx_mps: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """Return ``vx tan(angle)`` [m/s], shape (n,), where the angle is known.

    A speed that was sampled at other times than the angle is interpolated.
    """
    known = np.isfinite(vx_mps) & np.isfinite(time_s)
    speed = vx_mps
    if np.count_nonzero(known) > 1 and (np.diff(time_s[known]) > 0.0).all():
        speed = np.where(known, vx_mps, np.interp(time_s, time_s[known], vx_mps[known]))
    with np.errstate(invalid="ignore"):
        forward = np.abs(angle_rad) < _LARGEST_RAD
    return as_float64(np.where(forward, speed * np.tan(np.where(forward, angle_rad, 0.0)), np.nan))


def usual_sideslip(speed: FloatArray, yaw: FloatArray) -> FloatArray:
    """Return the size of the sideslip angle [rad] that a usual car has, shape (n,).

    Of both parts: far more than their difference it is not, and seldom far less.
    """
    return as_float64(np.hypot(_USUAL[0] * yaw / speed, _USUAL[1] * speed * yaw))


def against_the_rear_axle(
    lateral: FloatArray, speed: FloatArray, yaw: FloatArray, apart_s: float
) -> bool:
    """Tell whether a lateral speed is clearly of the wrong sign, by what the rear axle does.

    Parameters
    ----------
    lateral, speed, yaw : ndarray, shape (n,)
        Lateral and longitudinal speed [m/s], yaw rate [rad/s], at low lateral acceleration.
    apart_s : float
        Between these samples [s].
    """
    right, turned = _costs(lateral, speed, yaw, apart_s, (1.0, -1.0))
    return turned < right - _TELLS


def factor_by_the_rear_axle(
    column: FloatArray,
    speed: FloatArray,
    yaw: FloatArray,
    apart_s: float,
    tried: Sequence[float],
) -> float | None:
    """The factor that makes a lateral speed of a column, where one is clearly the likeliest.

    Parameters
    ----------
    column, speed, yaw, apart_s
        As for `against_the_rear_axle`, the lateral speed in a unit and of a sign not known.
    tried : sequence of float
        Factors, all positive.
    """
    costs = _costs(column, speed, yaw, apart_s, [s * f for f in tried for s in (1.0, -1.0)])
    of_each = np.min(np.reshape(costs, (-1, 2)), axis=1)
    first, second = np.sort(of_each)[:2]
    return tried[int(np.argmin(of_each))] if first < second - _TELLS else None


def _costs(
    column: FloatArray,
    speed: FloatArray,
    yaw: FloatArray,
    apart_s: float,
    factors: Sequence[float],
) -> list[float]:
    """Twice the negative logarithm of the probability of a column, for each factor."""
    design = np.column_stack([yaw, speed**2 * yaw, speed])
    inverse = np.linalg.pinv(design.T @ design)
    found = inverse @ (design.T @ column)
    residual = column - design @ found
    free = max(len(column) * min(apart_s / _LASTS_S, 1.0) - len(found), 1.0)
    noise = inverse * float(residual @ residual) / free

    def cost(factor: float) -> float:
        covariance = np.diag(_SPREAD**2) + factor**2 * noise
        off = factor * found - _USUAL
        # The factor is that of a density, too: what is found is made of the column by it.
        room = np.linalg.slogdet(covariance)[1] - 2.0 * len(found) * np.log(abs(factor))
        return float(off @ np.linalg.solve(covariance, off) + room)

    return [cost(factor) for factor in factors]
