"""What the driving is said to predict of the errors ahead."""

from dataclasses import replace

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import refine
from sysid_vehicle.study.judge.structure import structure


def straight_on(seed: int) -> sv.Log:
    """Noise of all sensors on a car that keeps its speed and its course."""
    normal = np.random.default_rng(seed).standard_normal
    noise = {"vy_mps": 0.03, "yaw_rate_radps": 0.0025, "ax_mps2": 0.06, "ay_mps2": 0.06}
    columns = {name: std * normal(4000) for name, std in noise.items()}
    columns |= {"time_s": 0.01 * np.arange(4000), "vx_mps": 20.0 + 0.03 * normal(4000)}
    return sv.Log.from_arrays({**columns, "steer_rad": 0.0002 * normal(4000)}, check=False)


def test_nothing_is_said_of_a_drive_in_which_nothing_happens() -> None:
    """Readings of the speed hold the error of the speed, at constant speed little else."""
    with pytest.warns(sv.SysidWarning):
        fit = sv.identify(sv.Model(sv.example_vehicle()), straight_on(530217), starts=1)
    found = structure(fit, Driving.of(straight_on(530218)))
    assert "error of v_x 1 s ahead" in found.test
    assert found.anywhere < 0.05, found.strongest


def test_a_missing_drag_is_seen_in_the_speed_ahead() -> None:
    car = sv.Model(sv.example_vehicle())
    draggy = car.add("aero_drag").with_values({"aero_drag.drag_area_m2": 0.45})
    drives = [sv.drive(draggy, sv.manoeuvres.lap(), seed=s, rate_hz=50.0) for s in (530219, 530220)]
    found = structure(sv.identify(car, drives[0], starts=1), Driving.of(drives[1]))
    assert found.test["error of v_x 1 s ahead"].low > 0.8
    assert found.test["error of v_x 5 s ahead"].low > 0.8


def test_a_driver_who_holds_the_speed_on_slopes_is_no_structure() -> None:
    """The pull follows every slope of the road, and no model could know it from that."""
    car, hilly = sv.Model(sv.example_vehicle()), sv.RoadDisturbance(slope_rad=0.026)
    wander = sv.manoeuvres.Knots(
        (0.0, 25.0, 50.0, 75.0, 100.0), (20.0, 24.0, 18.0, 25.0, 21.0), True
    )
    road = sv.manoeuvres.Manoeuvre(
        "road", "slopes", 100.0, wander, lambda t: 2.0 * np.sin(0.5 * t), True
    )
    drives = [sv.drive(car, road, seed=s, rate_hz=25.0, disturbance=hilly) for s in (1, 2)]
    # Noise that has learned the road leaves little: that of a fit which knows of none.
    fit = sv.identify(car, drives[0], starts=1)
    level = replace(fit.noise, road=(0.0, 0.0))
    found = structure(refine(fit.model, fit.driving, level), Driving.of(drives[1]))
    along = {name: e.low for name, e in found.test.items() if "v_x" in name or "a_x" in name}
    assert len(along) == 4
    assert max(along.values()) < 0.05, along
