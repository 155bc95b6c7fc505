"""Channels that hold the size of what they measure, where others say which way the car turns.

Buses send size and sign apart. On a road that turns one way more than the other a size follows the
other channels well enough to pass for the channel itself.
"""

from __future__ import annotations

import numpy as np

from ..._common.arrays import FloatArray
from .laws import EXCITED, Drive, Implausible
from .regression import size_of

_ONE_WAY = 0.02  # of the size of the readings: a channel that hardly goes below zero
_BOTH_WAYS = 0.1  # of what moves a channel: the least that is against it
_AS_LARGE = 0.5  # of what moves it, where that is against it
_CLOSELY = 0.8  # correlation of a size with that of what moves it


def check_sizes(drive: Drive) -> None:
    """Refuse a yaw rate, a lateral acceleration or a steering angle without its sign.

    Raises
    ------
    Implausible
        For the first of them that is never negative and follows the size of another one.
    """
    c = drive.motion.channels
    speed = np.maximum(drive.mean(c["vx_mps"]), 1.0)
    # As curvatures of the path, up to factors: what is compared is alike at every speed.
    curvature = {
        "yaw_rate_radps": drive.mean(c["yaw_rate_radps"]) / speed,
        "ay_mps2": drive.mean(c["ay_mps2"]) / speed**2,
        "steer_rad": drive.mean(c["steer_rad"]),
    }
    if size_of(drive.mean(c["ay_mps2"])) < EXCITED:
        return
    followed = {
        "yaw_rate_radps": {"ay_mps2": "ay_mps2 / vx_mps", "steer_rad": "steer_rad * vx_mps"},
        "ay_mps2": {"yaw_rate_radps": "vx_mps * yaw_rate_radps", "steer_rad": "steer_rad"},
        "steer_rad": {"yaw_rate_radps": "yaw_rate_radps / vx_mps", "ay_mps2": "ay_mps2"},
    }
    for channel, others in followed.items():
        for other, told in others.items():
            if _is_size_of(curvature[channel], curvature[other]):
                raise Implausible(
                    channel,
                    f"{channel}: is never negative, though its size follows {told}, "
                    f"{drive.place(np.minimum(curvature[other], 0.0))}: where a bus sends size and "
                    f"sign apart, name the column of the sign in the channel map, "
                    f"sign = 'its name'",
                )


def _is_size_of(values: FloatArray, driver: FloatArray) -> bool:
    """Whether values are never negative, and follow the size of what goes both ways."""
    size, driving = size_of(values), size_of(driver)
    if float(values.min()) < -_ONE_WAY * size or not size > 0.0:
        return False
    against = driver < -_BOTH_WAYS * driving
    if size_of(np.minimum(driver, 0.0)) < _BOTH_WAYS * driving or not np.any(against):
        return False
    # On a road that leans acceleration and steering are against it where the car goes straight.
    there = float(np.median(values[against])) / size
    if there < _AS_LARGE * float(np.median(-driver[against])) / driving:
        return False
    # Single windows, as those in which the speed is lost, decide nothing.
    values, driver = np.clip(values, 0.0, size), np.clip(driver, -driving, driving)
    alike = float(np.corrcoef(values, np.abs(driver))[0, 1])
    return alike > max(_CLOSELY, float(np.corrcoef(values, driver)[0, 1]))
