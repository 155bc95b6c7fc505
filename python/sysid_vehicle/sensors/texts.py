"""Sentences about sensors, and lines for the channel map."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from .kinematics.equations import SLIPS, SWINGS

DEG = math.pi / 180.0

_NEEDS_EXCITATION = {
    "delay_vx_s": "the car hardly accelerates or brakes",
    "delay_vy_s": "the lateral speed hardly changes",
    "delay_ay_s": "the car hardly changes its lateral acceleration",
    "gain_yaw_rate": "the car hardly turns",
    "gain_ax": "the car hardly accelerates or brakes",
    "gain_ay": "the car hardly corners",
    "bias_yaw_rate_radps": "the speed hardly changes; a bias then acts like a banked road",
    "bias_vy_mps": "the car hardly turns",
    "imu_forward_m": "the yaw rate changes too slowly",
    "imu_left_m": "the yaw rate changes too slowly",
    "imu_turn_rad": "the car hardly corners",
}
_WOULD_TELL = {
    "delay_vx_s": "firm braking and acceleration",
    "delay_vy_s": "quick steering of several frequencies",
    "delay_ay_s": "quick steering at several speeds",
    "gain_yaw_rate": "the heading before and after whole turns, not in the log,",
    "gain_ax": "firm braking and acceleration",
    "gain_ay": "corners at several speeds",
    "bias_yaw_rate_radps": "braking and acceleration through a wide range of speeds",
    "bias_vy_mps": "corners at several speeds",
    "imu_forward_m": "quick steering",
    "imu_left_m": "quick steering",
    "imu_turn_rad": "firm cornering, and braking on straights",
}
_OTHER = {
    "delay.speeds": "a delay of the speeds",
    "delay.vx_mps": "a delay of vx_mps",
    "delay.vy_mps": "a delay of vy_mps",
    "delay.ay_mps2": "a delay of ay_mps2",
    "gain.yaw_rate_radps": "the scale of yaw_rate_radps",
    "gain.ax_mps2": "the scale of ax_mps2",
    "gain.ay_mps2": "the scale of ay_mps2",
    "bias.yaw_rate_radps": "a bias of yaw_rate_radps",
    "bias.vy_mps": "a bias of vy_mps",
    "arm_x": "an IMU ahead of the speed sensor",
    "arm_y": "an IMU left of the speed sensor",
    "turn": "a turned IMU",
    "swing.slow": "an IMU above the speed sensor, on a body that rolls,",
    "swing.quick": "an IMU above the speed sensor, on a body that rolls,",
    "slip.driven": "slip of the wheels whose speed is logged",
    "slip.braked": "slip of the wheels whose speed is logged",
    "lean.ax_mps2": "a body that pitches late",
    "lean.ay_mps2": "a body that rolls late",
    "lean": "a road that leans with its turns",
    "climb": "a road on which the car slows where it climbs",
}
# What tells it, in place of other driving.
_ELSEWHERE = {
    "lean": "corners on level ground (`level=True`, `--level-ground`)",
    "climb": "level ground (`level=True`, `--level-ground`), or firm braking and acceleration,",
}
ON_CORRECTION = (
    "delay of steer_rad: kinematics does not know the steering",
    "delay of ax_mps2 against yaw_rate_radps: the two meet in vy_mps * yaw_rate_radps alone",
    "place of the centre of gravity: kinematics knows only where the IMU is from the speed sensor",
    "scale of the speeds: they are the yardstick of length",
    "bias of ax_mps2 and ay_mps2: a road that is not level looks the same",
)


def why_not(
    name: str,
    *,
    absent: Sequence[str] = (),
    alone: float = 0.0,
    other: str = "",
    there: bool = False,
) -> str:
    """Why a fault cannot be told: channels are missing, the driving is dull, or another acts so.

    It says what driving would tell it, too.
    `there` says that one of these two is there.
    """
    if absent:
        return f"because {' and '.join(absent)} {'is' if len(absent) == 1 else 'are'} not logged"
    would = f"; {_ELSEWHERE.get(other, _WOULD_TELL[name])} would tell it"
    if alone:
        return f"because {_NEEDS_EXCITATION[name]}{would}"
    both = "; one of the two is there" if there else ""
    return f"because {_OTHER[other]} acts alike in this driving{both}{would}"


def swings(faults: Mapping[str, float]) -> tuple[str, ...]:
    """What is said where the body's roll swings."""
    said = (
        "ay_mps2: it reads as where the roll of the body swings and the IMU is higher or lower "
        "than the speed sensor; speeds that were smoothed, as those of a differentiated position, "
        "look like that, too; the faults are told beside it"
    )
    return (said,) if {*SWINGS} & {*faults} else ()


def slips(faults: Mapping[str, float]) -> tuple[str, ...]:
    """What is said where the wheels slip whose speed is logged."""
    if not {*SLIPS} <= {*faults}:
        return ()
    driven, braked = (100.0 * max(faults[name], 0.0) for name in SLIPS)
    said = (
        f"vx_mps: it reads as the speed of wheels that slip by {driven:.2g} % per m/s2 when driven "
        f"and {braked:.2g} % per m/s2 when braked; the faults are told beside it; a speed over "
        f"ground, or of wheels that are neither driven nor braked, is free of it"
    )
    return (said,)


def gradient(gain: float) -> float:
    """Attitude per lateral or longitudinal acceleration that would give this gain [deg/g]."""
    return gain / DEG


def map_line(channel: str, delay_s: float, gain: float, bias: float) -> str:
    """The entry of a channel map that puts a channel right.

    The logged value is ``(1 + gain) true + bias``, `delay_s` late.
    """
    parts = ["column = ..."]
    if gain:
        parts.append(f"factor = {1.0 / (1.0 + gain):.5g}")
    if bias:
        parts.append(f"offset = {-bias / (1.0 + gain):.4g}")
    if delay_s:
        parts.append(f"delay_s = {delay_s:.3g}")
    return f"{channel} = {{ {', '.join(parts)} }}"
