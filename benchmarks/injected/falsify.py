"""Measured logs and vehicle files, falsified by known amounts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import sysid_vehicle as sv

Channels = dict[str, np.ndarray]


@dataclass(frozen=True)
class Injection:
    """What is done to a log, and what a check of the sensors should say then.

    Attributes
    ----------
    fault : str
        Name of the fault, or the channel whose offset moves.
    size : float
        By which it should differ from the check of the log as it was.
    """

    what: str
    fault: str
    size: float
    act: Callable[[Channels], None]


def falsified(log: sv.Log, act: Callable[[Channels], None]) -> sv.Log:
    columns = {c: np.array(log[c]) for c in log.channels}
    act(columns)
    return sv.Log.from_arrays(columns, name=f"{log.name}, falsified", check=False)


def _add(channel: str, value: float) -> Callable[[Channels], None]:
    def act(c: Channels) -> None:
        c[channel] = c[channel] + value

    return act


def _scale(channel: str, factor: float) -> Callable[[Channels], None]:
    def act(c: Channels) -> None:
        c[channel] = factor * c[channel]

    return act


def _late(channel: str, seconds: float) -> Callable[[Channels], None]:
    def act(c: Channels) -> None:
        known = np.isfinite(c[channel])
        c[channel] = np.interp(c["time_s"] - seconds, c["time_s"][known], c[channel][known])

    return act


def _yaw(c: Channels) -> tuple[np.ndarray, np.ndarray]:
    """Yaw rate, and its derivative over a tenth of a second: noise must not become acceleration."""
    known = np.isfinite(c["yaw_rate_radps"])
    r = np.interp(c["time_s"], c["time_s"][known], c["yaw_rate_radps"][known])
    step = float(np.median(np.diff(c["time_s"])))
    width = max(round(0.05 / step), 1)
    kernel = np.hanning(2 * width + 1)
    smooth = np.convolve(np.pad(r, width, mode="edge"), kernel / kernel.sum(), mode="valid")
    return r, np.gradient(smooth, c["time_s"])


def _imu(c: Channels) -> None:
    r, dr = _yaw(c)
    c["ay_mps2"] = c["ay_mps2"] + 0.6 * dr
    c["ax_mps2"] = c["ax_mps2"] - 0.6 * r**2


def _speed_ahead(c: Channels) -> None:
    c["vy_mps"] = c["vy_mps"] + 0.5 * _yaw(c)[0]


TURN_RAD = float(np.radians(1.5))


def _speed_turned(c: Channels) -> None:
    vx, vy = c["vx_mps"], c["vy_mps"]
    c["vx_mps"] = np.cos(TURN_RAD) * vx + np.sin(TURN_RAD) * vy
    c["vy_mps"] = np.cos(TURN_RAD) * vy - np.sin(TURN_RAD) * vx


KINEMATIC = (
    Injection("gyro bias 0.01 rad/s", "bias_yaw_rate_radps", 0.01, _add("yaw_rate_radps", 0.01)),
    Injection("gyro scale 5 %", "gain_yaw_rate", 0.05, _scale("yaw_rate_radps", 1.05)),
    Injection("a_y bias 0.3 m/s2", "ay_mps2", 0.3, _add("ay_mps2", 0.3)),
    Injection("a_y scale 6 %", "gain_ay", 0.06, _scale("ay_mps2", 1.06)),
    Injection("a_y 50 ms late", "delay_ay_s", 0.05, _late("ay_mps2", 0.05)),
    Injection("IMU 0.6 m forward", "imu_forward_m", 0.6, _imu),
    Injection("speed sensor 0.5 m forward", "imu_forward_m", -0.5, _speed_ahead),
    Injection("speed sensor turned 1.5 deg", "imu_turn_rad", -TURN_RAD, _speed_turned),
)


@dataclass(frozen=True)
class Falsified:
    """What is done to the steering of a log or to a vehicle file, and the effect that undoes it.

    Attributes
    ----------
    effect : str
        Full name of the parameter that tells it.
    size : float
        By which it should differ from the study of the log and the car as they were.
    """

    what: str
    effect: str
    size: float
    act: Callable[[Channels], None] | None = None
    car: Callable[[sv.Vehicle], sv.Vehicle] | None = None


def _low_inertia(car: sv.Vehicle) -> sv.Vehicle:
    known = car.yaw_inertia_kgm2 or car.mass_kg * car.lf_m * car.lr_m
    return car.replace(yaw_inertia_kgm2=0.75 * known)


def _cg_back(car: sv.Vehicle) -> sv.Vehicle:
    return car.replace(lf_m=car.lf_m + 0.12, lr_m=car.lr_m - 0.12)


def _sensors_back(c: Channels) -> None:
    """Readings where the falsified file has the CG: places in the body were measured right."""
    r, dr = _yaw(c)
    c["ay_mps2"] = c["ay_mps2"] - 0.12 * dr
    for channel, change in (("ax_mps2", 0.12 * r**2), ("vy_mps", -0.12 * r)):
        if channel in c:
            c[channel] = c[channel] + change


DYNAMIC = (
    Falsified("steering 8 mrad off", "steer_offset.offset_rad", -0.008, _add("steer_rad", 0.008)),
    Falsified("steering ratio 10 %", "steer_ratio.ratio_error", 1.0 / 1.1 - 1.0,
              _scale("steer_rad", 1.1)),
    Falsified("steering 60 ms early", "steer_delay.delay_s", 0.06, _late("steer_rad", -0.06)),
    Falsified("steering 40 ms late", "steer_delay.delay_s", -0.04, _late("steer_rad", 0.04)),
    Falsified("yaw inertia 25 % low", "yaw_inertia.relative_error", 1.0 / 0.75 - 1.0,
              car=_low_inertia),
    Falsified("CG 0.12 m back", "cg_position.shift_rearward_m", -0.12, _sensors_back,
              car=_cg_back),
)  # fmt: skip
