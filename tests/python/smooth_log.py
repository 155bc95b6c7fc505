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
