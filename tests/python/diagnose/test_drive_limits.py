"""Limits of proposed drives that follow from the size of a car."""

from typing import Any

import numpy as np
import pytest

from sysid_vehicle import DriveLimits, Model, NumericalError
from sysid_vehicle.diagnose.experiment.limits import menu
from sysid_vehicle.manoeuvres import Knots, Manoeuvre
from sysid_vehicle.simulate import SensorNoise, drive_truth


def test_a_lorry_is_no_faster_than_a_car(start: Model) -> None:
    car = start.vehicle
    lorry = car.replace(lf_m=2.4, lr_m=2.4, mass_kg=14000.0, yaw_inertia_kgm2=9e4)
    kart = car.replace(lf_m=0.6, lr_m=0.45, mass_kg=160.0, yaw_inertia_kgm2=20.0)
    assert DriveLimits.usual(car) == DriveLimits()
    assert DriveLimits.usual(kart).speed_mps < 30.0
    assert DriveLimits.usual(lorry).speed_mps == 25.0  # as its limiter has it
    assert DriveLimits.usual(lorry, speed_mps=28.0).speed_mps == 28.0


def test_a_high_vehicle_is_not_tipped_over(start: Model) -> None:
    lorry = start.vehicle.replace(cg_height_m=1.35, track_front_m=2.0, track_rear_m=1.85)
    assert DriveLimits.usual(lorry).lateral_mps2 == pytest.approx(0.6 * 9.80665 * 1.85 / 2.7)
    assert DriveLimits.usual(lorry, lateral_mps2=5.0).lateral_mps2 == 5.0
    assert DriveLimits.usual(lorry.replace(cg_height_m=0.0)).lateral_mps2 == 8.5


def test_what_is_given_up_on_the_way_would_not_have_fitted(start: Model) -> None:
    """Whatever stays on its ground is driven to the end, and as it is without limits."""
    ground = DriveLimits(20.0, 6.0, area_m=(90.0, 50.0))
    ended = []
    for m in (m for alternatives in menu(ground, start.vehicle) for m in alternatives[::4]):
        ends = [
            _driven(start, m, farthest_m=farthest_m) for farthest_m in (np.inf, ground.farthest_m)
        ]
        if isinstance(ends[1], NumericalError):
            assert not ground.hold(ends[0])
            ended.append(str(ends[1]))
        else:
            np.testing.assert_array_equal(ends[1].states, ends[0].states)
    assert 0 < len(ended) < 60
    assert all("more than 102.956 m from where it began" in told for told in ended)


def _driven(car: Model, m: Manoeuvre, farthest_m: float) -> Any:
    quiet = SensorNoise.none()
    try:
        return drive_truth(car, m, seed=0, noise=quiet, rate_hz=20.0, farthest_m=farthest_m)
    except NumericalError as failure:
        return failure


def test_no_manoeuvre_is_tried_twice(start: Model) -> None:
    for alternatives in menu(DriveLimits(20.0, 6.0, area_m=(60.0, 40.0)), start.vehicle):
        assert len({str(m) for m in alternatives}) == len(alternatives)


def first_rise_s(car: Model) -> float:
    """How long the first step of the first step steer of the menu rises."""
    vehicle = car.vehicle
    manoeuvres = [several[0] for several in menu(DriveLimits.usual(vehicle), vehicle)]
    curve = next(m for m in manoeuvres if m.name == "step_steer").lateral_mps2
    assert isinstance(curve, Knots)
    moved = [i for i, value in enumerate(curve.value) if value != 0.0]
    return float(curve.time_s[moved[0]] - curve.time_s[moved[0] - 1])


def test_steps_of_a_long_vehicle_rise_more_slowly(start: Model) -> None:
    car = start.vehicle
    bus = car.replace(lf_m=3.5, lr_m=2.5, mass_kg=14000.0, yaw_inertia_kgm2=2e5)
    assert first_rise_s(start) == pytest.approx(0.2)
    assert first_rise_s(Model(bus)) == pytest.approx(0.2 * (6.0 / 3.5) ** 0.5)
