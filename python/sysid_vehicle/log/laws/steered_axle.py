"""Which axle steers: where along the car the point lies that follows the path.

An axle that does not steer slips by its force alone, so that on a gentle drive the car follows its
path there. With the distance ``d`` from that axle to the place of a sensor ahead of it and the
compliance ``K`` of the axle, an accelerometer reads

``ay - vx yaw_rate = d d(yaw_rate)/dt - K d(vx ay)/dt``

and a sensor of the lateral speed ``vy / vx = d yaw_rate / vx - K ay + J d(yaw_rate)/dt``. Of a car
that steers its front axle ``d`` is positive, unless the sensors lie behind its rear axle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .laws import LINEAR_MPS2, Drive, fit, ones
from .motion import Motion
from .regression import SURE, Regression, size_of

_SLOW_MPS = 1.5  # below, the lateral speed over the speed is noise
_MANY = 60  # windows: in one corner a curvature and an acceleration say the same
_CLOSELY = 0.25  # coherence
_EXCITED_MPS2 = 0.1  # of what the accelerometer reads beside the turning of the path
_COMPLIANCE, _COMPLIANCE_STD = 0.008, 0.006  # rad per m/s2, of the tyres of an axle
_SCALE_STD, _BIAS_MPS2 = 0.1, 0.5  # of the accelerometer, gravity by roll and slopes included
_LEAST_STD = 0.04  # of the distance, over the wheelbase: delays and roll bend it


class Ahead(NamedTuple):
    """How far ahead of the sensors the car follows its path [m], and bounds that surely hold."""

    metres: float
    low: float
    high: float


def path_ahead(motion: Motion, wheelbase_m: float) -> Ahead | None:
    """How far ahead of the sensors of lateral motion the car follows its path.

    Of two sensors the one counts that is least behind it. None where the drive does not tell.
    """
    c = motion.channels
    # What steers its rear axle is slow, and a point that follows the path does so at any speed.
    gentle = np.abs(motion.mean(c["ay_mps2"])) < LINEAR_MPS2
    drive = Drive(motion, motion.usable & gentle & (motion.mean(c["vx_mps"]) > _SLOW_MPS))
    if np.count_nonzero(drive.rows) < _MANY:
        return None
    told = [_by_acceleration(drive)]
    if "vy_mps" in c:
        told.append(_by_speed(drive))
    if any(law is None or law.coherence < _CLOSELY for law in told):
        return None
    least_std = _LEAST_STD * wheelbase_m
    return min(_ahead(law, least_std) for law in told if law is not None)


def steered_behind(motion: Motion, lf_m: float, lr_m: float) -> str:
    """What is said of a car that follows its path about where its front axle is; empty elsewhere.

    That axle does not steer then, or the sensors lie behind the rear axle, which reads the same.
    """
    ahead = path_ahead(motion, lf_m + lr_m)
    if ahead is None or ahead.low < 0.5 * lf_m:
        return ""
    sensors = "ay_mps2 and vy_mps" if "vy_mps" in motion.channels else "ay_mps2"
    return (
        f"looks steered at the rear axle: in gentle turns the car follows its path "
        f"{ahead.metres:.2g} m ({ahead.low:.2g} to {ahead.high:.2g}) ahead of the place of "
        f"{sensors}, where the front axle is (lf_m = {lf_m:g}), and not at the rear axle, "
        f"{lr_m:g} m behind it. The models steer the front axle: tyres and effects that are fitted "
        f"to this log mean nothing; docs/howto/own_effect.md has an effect that steers the rear "
        f"axle. If the front wheels steer, the sensors lie {ahead.metres + lr_m:.2g} m behind the "
        f"centre of gravity: add {'ins' if sensors != 'ay_mps2' else 'imu'}_lever_arm to the "
        f"model, or give readings at the centre of gravity"
    )


def _by_acceleration(drive: Drive) -> Regression | None:
    c = drive.motion.channels
    ay, turn = drive.mean(c["ay_mps2"]), drive.mean(c["vx_mps"] * c["yaw_rate_radps"])
    swing = drive.change(c["yaw_rate_radps"])
    if size_of(ay - turn) < _EXCITED_MPS2:
        return None
    columns = [swing, drive.change(c["vx_mps"] * c["ay_mps2"]), turn, ones(drive)]
    spread = [np.inf, _COMPLIANCE_STD, _SCALE_STD, _BIAS_MPS2]
    return fit(ay, columns, spread, [0.0, -_COMPLIANCE, 1.0, 0.0])


def _by_speed(drive: Drive) -> Regression:
    c = drive.motion.channels
    speed = drive.mean(c["vx_mps"])
    curvature, side = drive.mean(c["yaw_rate_radps"]) / speed, drive.mean(c["vy_mps"]) / speed
    columns = [curvature, drive.mean(c["ay_mps2"]), drive.change(c["yaw_rate_radps"]), ones(drive)]
    return fit(side, columns, [np.inf] * 4)


def _ahead(law: Regression, least_std: float) -> Ahead:
    metres = -float(law.coefficients[0])
    reach = SURE * math.hypot(float(law.deviations[0]), least_std)
    return Ahead(metres, metres - reach, metres + reach)
