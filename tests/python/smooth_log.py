"""Logs of smooth functions of time, for tests of what a log holds."""

import numpy as np

from sysid_vehicle.log import Log

Columns = dict[str, np.ndarray]


def columns(time_s: np.ndarray) -> Columns:
    """Smooth functions of time, no car: only for tests without the checks of a car."""
    return {
        "time_s": time_s,
        "vx_mps": 20.0 + 0.5 * time_s,
        "yaw_rate_radps": 0.1 * np.sin(time_s),
        "ay_mps2": 2.0 * np.sin(time_s),
        "ax_mps2": np.full_like(time_s, 0.5),
        "steer_rad": 0.05 * np.sin(time_s),
    }


def make(data: Columns, **options: object) -> Log:
    return Log.from_arrays(data, name="run 1", check=False, **options)  # type: ignore[arg-type]


def drift(time_s: np.ndarray) -> Columns:
    """Motion of a car that slides by up to 35 degrees and is steered against it."""
    speed = 13.0 + 2.0 * np.sin(0.31 * time_s)
    course = 2.2 * np.sin(0.27 * time_s) + 0.3 * np.sin(0.83 * time_s + 1.0)
    slide = 0.42 * np.sin(0.63 * time_s) + 0.2 * np.sin(1.57 * time_s + 0.5)
    turn = np.gradient(course, time_s)
    rate = turn - np.gradient(slide, time_s)
    along, across = speed * np.cos(slide), speed * np.sin(slide)
    felt = np.gradient(along, time_s) - across * rate
    return {
        "time_s": time_s,
        "vx_mps": along,
        "vy_mps": across,
        "yaw_rate_radps": rate,
        "ax_mps2": felt,
        "ay_mps2": np.gradient(across, time_s) + along * rate,
        "steer_rad": slide + 2.6 * turn / speed,
        "fx_n": 1400.0 * felt + 0.5 * speed**2,
    }
