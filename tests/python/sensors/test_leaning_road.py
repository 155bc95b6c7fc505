"""A road that leans with its turns reads as a scale of the lateral accelerometer does."""

import numpy as np
import pytest

import sysid_vehicle as sv

G = 9.81


def log(rolls: float, leans: float) -> sv.Log:
    """Bends at varying speed: of a body that rolls, on a road with a crossfall that varies."""
    t = np.arange(0.0, 200.0, 0.04)
    rng = np.random.default_rng(11)
    noise = rng.standard_normal((5, 2 * t.size))[:, ::2]
    speed = 18.0 + 6.0 * np.sin(0.11 * t) + 2.0 * np.sin(0.31 * t)
    turns = 3.0 * np.sin(0.37 * t) * np.sin(0.053 * t)
    yaw_rate = turns / speed
    # Without superelevation: two per cent to the right, more or less of it every few seconds.
    knots = np.arange(0.0, 210.0, 8.0)
    crossfall = 0.02 + 0.012 * np.interp(t, knots, rng.standard_normal(knots.size))
    # Superelevation goes with the curvature of the road.
    bank = leans * G * (crossfall - 14.0 * yaw_rate / speed)
    return sv.read_log(
        {
            "time_s": t,
            "vx_mps": speed + 0.03 * noise[0],
            "yaw_rate_radps": yaw_rate + 0.002 * noise[1],
            "ax_mps2": np.gradient(speed, t) + 0.05 * noise[2],
            "ay_mps2": (1.0 + rolls) * (turns + bank) + 0.05 * noise[3],
            "steer_rad": 2.7 * yaw_rate / speed + 0.002 * turns + 1e-4 * noise[4],
        }
    )


def test_on_such_a_road_a_scale_of_the_accelerometer_is_no_finding() -> None:
    found = sv.check(log(0.0, 1.0))
    fault = found["gain_ay"]
    assert not fault.found
    assert not fault.told
    assert "a road that leans with its turns acts alike" in fault.why_not
    assert "corners on level ground" in fault.why_not
    assert not any("ay_mps2" in line for line in found.map_lines)
    low, high = fault.interval
    assert low < 0.0 < high


@pytest.mark.parametrize("rolls", [0.0, 0.06])
def test_on_level_ground_it_is_told(rolls: float) -> None:
    fault = sv.check(log(rolls, 0.0))["gain_ay"]
    assert fault.told
    assert fault.found == (rolls > 0.0)
    assert fault.value == pytest.approx(rolls, abs=0.01)


def test_of_ground_that_is_level_more_is_told() -> None:
    """Who says that the ground is level gets what a road might take."""
    rolling = log(0.06, 0.3)
    careful, level = sv.check(rolling)["gain_ay"], sv.check(rolling, level=True)["gain_ay"]
    assert level.std < 0.5 * careful.std
    assert level.found
