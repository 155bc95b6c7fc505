"""What a regression of accelerations on slip angles leaves out, where log and vehicle file tell it.

Load that moves between the axles, side force of driven or braked wheels that are turned, and tyres
that bend.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from .._common.arrays import FloatArray, as_float64
from ..errors import warn
from ..log import Log
from ..log.laws.regression import SURE, regress
from ..tyre import Tyre, magic_formula
from ..vehicle import Vehicle

_STIFFNESSES = np.geomspace(1.5, 80.0, 33)  # over load [1/rad]: what tyres have
# Lateral accelerations at which a steering angle is compared with the path, and the least of it; of
# logs with more than that share beyond the hard one the ratio is up to 1.5 in right ones.
_GENTLE_MPS2, _EXCITED_MPS2, _HARD_MPS2, _HARD_SHARE = 4.0, 0.5, 5.0, 0.002
# Square of the speed over the wheelbase up to which the path turns the wheels more than slip does;
# beyond, right logs of fast lane changes tell 1.1 to 1.4.
_SLOW_MPS2 = 100.0
_WRONG_STEER = 1.2  # a v_y that is measured half a metre elsewhere does as much
_FEWEST_ROWS = 60
_LEAST_RATIO = 0.5  # of secant and slope; beyond no stiffness is told
_LEAST_LOAD = 0.2  # of the static load
_MOST_ROLL = 0.1  # of gravity that an accelerometer feels as the body rolls, per lateral one


def along_the_car(vehicle: Vehicle, log: Log) -> tuple[FloatArray, FloatArray]:
    """Acceleration [m/s2] and force of all wheels [N] along the car, shape (n,); 0 if unknown.

    Where the log has one of them, it stands for the other, with the drag of the vehicle file.
    """
    drag = 0.5 * vehicle.air_density_kgpm3 * vehicle.drag_area_m2 * np.square(log["vx_mps"])
    if log.has("fx_n"):
        force = log["fx_n"]
        a_x = log["ax_mps2"] if log.has("ax_mps2") else (force - drag) / vehicle.mass_kg
    elif log.has("ax_mps2"):
        a_x = log["ax_mps2"]
        force = vehicle.mass_kg * a_x + drag
    else:
        a_x = force = np.zeros(log.n)
    return a_x, force


def load_shares(vehicle: Vehicle, ax_mps2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Loads of the axles over those at rest; a tyre's force goes with its load.

    Parameters
    ----------
    ax_mps2 : ndarray, shape (n,)
        Acceleration along the car; what is missing moves no load.
    """
    moved = vehicle.mass_kg * np.nan_to_num(ax_mps2) * vehicle.cg_height_m / vehicle.wheelbase_m
    front, rear = vehicle.static_loads_n
    return (
        as_float64(np.maximum(1.0 - moved / front, _LEAST_LOAD)),
        as_float64(np.maximum(1.0 + moved / rear, _LEAST_LOAD)),
    )


def pulled_sideways(vehicle: Vehicle, force_n: FloatArray, steer_rad: FloatArray) -> FloatArray:
    """Side force [N] that turned front wheels have from drive and brake force, shape (n,)."""
    share = np.where(force_n < 0.0, vehicle.brake_front_share, vehicle.drive_front_share)
    return as_float64(np.nan_to_num(share * force_n * np.sin(steer_rad)))


def felt_beside(smooth: Sequence[FloatArray], rate_hz: float) -> float:
    """How much more an accelerometer reads than the car is accelerated sideways, as a share.

    It is fixed to the body and feels gravity as that rolls, usually by 0.03 to 0.08, and as the
    road leans. The speed times the yaw rate, which holds little noise, is the instrument.

    Parameters
    ----------
    smooth : sequence of 4 ndarray, shape (n,)
        v_x, v_y [m/s], yaw rate [rad/s], a_y [m/s2], smoothed alike.
    rate_hz : float
    """
    vx_mps, vy_mps, yaw_rate_radps, ay_mps2 = smooth
    turned = vx_mps * yaw_rate_radps
    moved = np.gradient(vy_mps, 1.0 / rate_hz) + turned
    known = np.isfinite(moved) & np.isfinite(ay_mps2)
    by = float(moved[known] @ turned[known])
    return float(ay_mps2[known] @ turned[known]) / by - 1.0 if by > 0.0 else 0.0


def of_roll(felt: float) -> float:
    """What of that is taken for roll of the body; more is a road that leans, or a wrong scale."""
    return min(max(felt, 0.0), _MOST_ROLL)


def times_road_wheels(
    vehicle: Vehicle, smooth: Sequence[FloatArray], rate_hz: float, width: int
) -> tuple[float, float] | None:
    """Steering angle over that of the road wheels, and its standard deviation; None if not told.

    The path of the front axle has the angle ``(v_y + l_f r) / v_x``; the wheels are turned by so
    much, and by the slip that the side force asks for, in a curve of any tyre. The angle of the
    path, which is noisy, is the side that stays.

    Parameters
    ----------
    vehicle : Vehicle
    smooth : sequence of 5 ndarray, shape (n,)
        v_x, v_y [m/s], yaw rate [rad/s], a_y [m/s2], steering angle [rad], smoothed alike.
    rate_hz : float
    width : int
        Samples of the window of smoothing: nearer ones hold the same noise.
    """
    v_x, v_y, rate, a_y, steer = smooth
    path = (v_y + vehicle.lf_m * rate) / v_x
    turning = vehicle.usual_inertia_kgm2 / vehicle.mass_kg * np.gradient(rate, 1.0 / rate_hz)
    force = (vehicle.lr_m * a_y + turning) / vehicle.wheelbase_m
    columns = np.column_stack([steer, force, force**3, np.ones(force.size)])
    known = np.isfinite(path) & np.isfinite(columns).all(axis=1) & (np.abs(a_y) < _GENTLE_MPS2)
    known &= np.square(v_x) < _SLOW_MPS2 * vehicle.wheelbase_m
    driven = np.isfinite(path) & np.isfinite(a_y)
    if np.count_nonzero(driven & (np.abs(a_y) > _HARD_MPS2)) > _HARD_SHARE * driven.sum():
        return None  # bodies that roll and tyres that slide turn the car otherwise
    rows = np.flatnonzero(known)[:: max(width // 2, 1)]
    if rows.size < _FEWEST_ROWS or float(np.std(a_y[rows])) < _EXCITED_MPS2:
        return None
    none, free = np.zeros(4), np.full(4, np.inf)
    found = regress(path[rows], columns[rows], none, free)
    share, deviation = float(found.coefficients[0]), float(found.deviations[0])
    if share <= SURE * deviation:
        return None
    return 1.0 / share, deviation / share**2


def warn_of_steering(log: Log, times: tuple[float, float] | None) -> None:
    """Say that the steering angle is surely not that of the road wheels."""
    if times is None:
        return
    ratio, deviation = times
    if abs(np.log(ratio)) > np.log(_WRONG_STEER) + SURE * deviation / ratio:
        warn(
            f"{log.name}: steer_rad is {ratio:.3g} +- {2.0 * deviation:.1g} times that of road "
            f"wheels by vy_mps and yaw_rate_radps, over the whole log, and the front stiffness is "
            f"wrong with it: a commanded angle or that of the steering wheel needs another ratio, "
            f"factor = {1.0 / ratio:.3g} times the present one in the channel map; else check lf_m "
            f"and where vy_mps is measured"
        )


def straightness(
    tyre: Tyre, load_n: float, slip_rad: FloatArray, used: FloatArray, secant_npr: FloatArray
) -> FloatArray:
    """Secant over slope at no slip of the tyre that has these secants, shape (n,).

    The tyre has friction and shape of `tyre`, and the stiffness that gives it the secants.

    Parameters
    ----------
    tyre : Tyre
        C, D, E of the axle.
    load_n : float
        Load of the axle.
    slip_rad, used, secant_npr : ndarray, shape (n,)
        Slip angles, above 0.5 where used, and the stiffness [N/rad] of the regression so far.
    """
    weight = np.where((used > 0.5) & np.isfinite(slip_rad), slip_rad**2, 0.0)
    slip = np.where(weight > 0.0, slip_rad, 1.0)
    total = np.maximum(np.cumsum(weight), 1e-12)
    sought = secant_npr / load_n
    ratio = np.ones(slip.size)
    below, ratio_below = np.zeros(slip.size), np.ones(slip.size)
    for stiffness in _STIFFNESSES:
        b = float(stiffness) / (tyre.C * tyre.D)
        friction = magic_formula(slip, b, tyre.C, tyre.D, tyre.E)
        secant = np.cumsum(weight * friction / slip) / total
        ratio_here = np.where(total > 1e-12, secant / stiffness, 1.0)
        secant = stiffness * ratio_here
        share = np.clip((sought - below) / np.maximum(secant - below, 1e-12), 0.0, 1.0)
        ratio = np.where(sought > below, ratio_below + share * (ratio_here - ratio_below), ratio)
        below, ratio_below = np.maximum(secant, below), ratio_here
    return as_float64(np.maximum(ratio, _LEAST_RATIO))


def parabolas(y: FloatArray, width: int) -> FloatArray:
    """Local parabolas over `width` samples; NaN where too much is missing.

    Holes of up to half a window are interpolated first: the parabolas hardly feel them. Longer ones
    stay, and so do stretches between them that are shorter than a window.
    """
    out = np.full(y.size, np.nan)
    known = np.flatnonzero(np.isfinite(y))
    if known.size == 0:
        return out
    cuts = np.flatnonzero(np.diff(known) > width // 2 + 1) + 1
    for part in np.split(known, cuts):
        rows = np.arange(part[0], part[-1] + 1)
        if rows.size >= width:
            dense = np.interp(rows, part, y[part])
            out[rows] = scipy.signal.savgol_filter(dense, width, 2)
    return out
