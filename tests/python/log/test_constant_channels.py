"""Channels that hold one number while the car corners."""

import numpy as np
import pytest

from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.log import Log
from sysid_vehicle.log.checks import excitation_note


def test_a_lateral_speed_that_nobody_measures_is_no_measurement() -> None:
    time = 0.01 * np.arange(2000)
    ay = 4.0 * np.sin(0.5 * time)
    speed = 20.0 + 2.0 * np.sin(0.3 * time)
    data = {
        "time_s": time,
        "vx_mps": speed,
        "ax_mps2": 0.6 * np.cos(0.3 * time),
        "ay_mps2": ay,
        "yaw_rate_radps": ay / speed,
        "steer_rad": 0.009 * ay,
    }
    with pytest.warns(SysidWarning, match=r"vy_mps: constant \(0\) .*treated as absent"):
        log = Log.from_arrays({**data, "vy_mps": np.zeros(2000)}, name="lap")
    assert "vy_mps" not in log
    assert tuple(log) == log.channels


def test_a_stuck_steering_angle_is_no_want_of_corners() -> None:
    ay = 4.0 * np.sin(0.5 * 0.01 * np.arange(1000))
    steer = np.full(ay.size, 0.01)
    said = excitation_note({"ay_mps2": ay, "steer_rad": steer}, 100.0)
    assert said.startswith("steer_rad: constant (0.01 rad) over the whole log while")
    assert said.endswith("check the sensor and the column")
    straight = excitation_note({"ay_mps2": 0.1 * ay, "steer_rad": steer}, 100.0)
    assert straight.endswith("drive corners")
