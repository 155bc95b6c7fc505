"""Limits of proposed drives that follow from the size of a car."""

import pytest

from sysid_vehicle import DriveLimits, Model


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
