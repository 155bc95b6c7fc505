"""The wheelbase that the steering answers to: units of the steering angle, and cars on a scale."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..._common.arrays import FloatArray
from ..channels import DEG
from .laws import (
    CLEARLY,
    EXCITED,
    LINEAR_MPS2,
    MIN_WINDOWS,
    OFFSET,
    Contradiction,
    Drive,
    Implausible,
    cosine,
    fit,
    spread_of,
    wrong_sign,
)
from .regression import Regression, size_of

# The wheelbase that answers, from karts to coaches [m], what understeer adds [m/(m/s)^2], how far
# they vary, and the deviations from them at which the steering angle is none of road wheels.
_WHEELBASE_M, _WHEELBASE_STD = 2.9, 0.45
_UNDERSTEER, _UNDERSTEER_STD = 0.002, 0.003
_NOT_A_WHEELBASE = 3.5
# Change of the lateral speed over a window, and sideslip, that a car has which does not slide; and
# the share of windows that must be left to tell of the steering.
_GRIP_MPS2, _GRIP_RAD, _GRIP_SHARE = 2.5, 0.15, 0.2
_MODEL_CAR_M = 0.1  # the shortest wheelbase of a car on a scale, 1:24
_NO_DRIVER_M = 0.9  # karts for children have more
_FASTEST = 0.9  # quantile of the speeds, at which oversteer takes most from the steering
_STEERED = 0.5  # coherence from which a wheelbase is told
_LEAST_OFFSET_RAD = 1e-6  # a steering angle that stays at zero has no size


class _Steering(NamedTuple):
    """The steering angle regressed on the curvature of the path, in windows without a slide."""

    ay: FloatArray
    steer: FloatArray
    rows: np.ndarray
    answer: Regression
    alone: float


def _steering(drive: Drive) -> _Steering | None:
    """The law of the steering, whose first coefficient is a wheelbase; None where nothing tells."""
    c = drive.motion.channels
    ay = drive.mean(c["ay_mps2"])
    speed = np.maximum(np.abs(c["vx_mps"]), 1.0)
    curvature, steer = drive.mean(c["yaw_rate_radps"] / speed), drive.mean(c["steer_rad"])
    if size_of(ay) < EXCITED:
        return None
    grip = _in_grip(drive)
    if not _enough(grip):
        return None
    gentle = grip & (np.abs(ay) < LINEAR_MPS2)
    if np.count_nonzero(gentle) > max(MIN_WINDOWS, 0.2 * ay.size) and size_of(ay[gentle]) > EXCITED:
        rows = gentle
    else:
        rows = grip
    yaw = drive.change(c["yaw_rate_radps"])
    columns = [curvature[rows], yaw[rows], np.ones(np.count_nonzero(rows))]
    # On a circle of one radius only a small offset keeps the slope from being anything.
    offset = max(OFFSET * size_of(steer[rows]), _LEAST_OFFSET_RAD)
    answer = fit(steer[rows], columns, [np.inf, np.inf, offset])
    return _Steering(ay, steer, rows, answer, cosine(curvature[rows], steer[rows]))


def longest_wheelbase(drive: Drive, understeer: float) -> tuple[float, str] | None:
    """The longest wheelbase [m] that turns so by so little steering, and where; None if not told.

    However hard the car is driven, as long as it does not slide. Less steering than the wheelbase
    asks for is oversteer, of which a car has so much at most.

    Parameters
    ----------
    drive : Drive
    understeer : float
        Size of the largest gradient, either way [rad per m/s2].
    """
    law = _steering(drive)
    if law is None or law.answer.coherence < _STEERED:
        return None
    base, deviation = float(law.answer.coefficients[0]), float(law.answer.deviations[0])
    if base <= 3.0 * deviation:
        return None
    fast = float(np.quantile(drive.mean(drive.motion.channels["vx_mps"])[law.rows], _FASTEST))
    place = drive.place(np.where(law.rows, law.steer, 0.0))
    return base + 3.0 * deviation + understeer * fast**2, place


def is_model_car(drive: Drive, wheelbase_m: float | None = None) -> bool:
    """Whether the wheelbase is that of a car which carries no driver, or the steering says so."""
    if wheelbase_m is not None:
        return wheelbase_m < _NO_DRIVER_M
    told = _steering(drive)
    if told is None or told.answer.coherence < _STEERED:
        return False
    return 0.0 < float(told.answer.coefficients[0]) < _NO_DRIVER_M


def check_steering(drive: Drive) -> list[Contradiction]:
    """Compare the steering angle with the path curvature: the wheelbase that would answer so."""
    c = drive.motion.channels
    law = _steering(drive)
    if law is None:
        return []
    ay, steer, rows, answer, alone = law
    if answer.coherence < 0.25 and abs(alone) < 0.45 and spread_of(ay[rows]) > CLEARLY:
        raise Implausible(
            "steer_rad",
            f"steer_rad: does not turn with yaw_rate_radps and ay_mps2, {drive.place(ay)}; check "
            f"that the column holds the steering angle, in the order of time",
        )
    base, deviation = float(answer.coefficients[0]), float(answer.deviations[0])
    if base < -3.0 * deviation and alone < -0.5 and answer.coherence > 0.3:
        text = "moves against both yaw_rate_radps and ay_mps2"
        raise wrong_sign("steer_rad", text, steer, drive)
    if base <= 0.0 or answer.coherence < _STEERED:
        return []
    speed_2 = float(np.median(drive.mean(c["vx_mps"]))) ** 2
    expected = _WHEELBASE_M + _UNDERSTEER * speed_2
    spread = math.hypot(_WHEELBASE_STD * _WHEELBASE_M, _UNDERSTEER_STD * speed_2) / expected
    off = abs(math.log(base / expected)) / math.hypot(spread, deviation / base)
    if off < _NOT_A_WHEELBASE or 0.2 < base / expected < 5.0:
        return []
    ratio = base / expected
    i = int(np.argmax(np.abs(steer)))
    told = (
        f"steer_rad: {steer[i]:.4g} at t = {drive.motion.times_s[drive.rows][i]:.6g} s is "
        f"{'large' if ratio > 1.0 else 'small'} for the yaw rate: a wheelbase of {base:.3g} m "
        f"would answer so"
    )
    if ratio < 1.0:
        fits = f"check its unit; factor = {1.0 / ratio:.2g} would make it fit a car of usual size"
        if base > _MODEL_CAR_M:
            text = f"{told}; if this is no model car, {fits}"
            return [Contradiction("steer_rad", text, by_the_car=True)]
        raise Implausible("steer_rad", f"{told}; {fits}")
    low, high = math.exp(-spread) / ratio, math.exp(spread) / ratio
    what = (
        f"if it is the angle of the steering wheel, put factor = 1 / steering ratio (about "
        f"{low:.1g} to {high:.1g}) in the channel map"
        if ratio < 32.0
        else f"if it is in degrees, put factor = {DEG} in the channel map"
        if ratio < 200.0
        else f"if it is the angle of the steering wheel in degrees, put factor = {DEG} / steering "
        f"ratio in the channel map"
    )
    raise Implausible("steer_rad", f"{told}; {what}")


def _in_grip(drive: Drive) -> np.ndarray:
    """Windows in which the car does not slide: there the driver may steer against the turn."""
    c = drive.motion.channels
    slides = drive.mean(c["ay_mps2"]) - drive.mean(c["vx_mps"] * c["yaw_rate_radps"])
    grip: np.ndarray = np.abs(slides) < _GRIP_MPS2
    if "vy_mps" in c:
        speed = np.maximum(np.abs(drive.mean(c["vx_mps"])), 1.0)
        grip &= np.abs(drive.mean(c["vy_mps"])) < _GRIP_RAD * speed
    return grip


def _enough(grip: np.ndarray) -> bool:
    return bool(np.count_nonzero(grip) >= max(MIN_WINDOWS, _GRIP_SHARE * grip.size))


def gripping(drive: Drive) -> Drive | None:
    """The windows without a slide; None where they are too few."""
    grip = _in_grip(drive)
    if not _enough(grip):
        return None
    rows = drive.rows.copy()
    rows[drive.rows] = grip
    return Drive(drive.motion, rows)
