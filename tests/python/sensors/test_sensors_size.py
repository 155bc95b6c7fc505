"""Sensors of small cars, and of cars whose lateral speed is not logged."""

import model_cars
import numpy as np
import pytest

import sysid_vehicle as sv

Channels = dict[str, np.ndarray]


def channels_of(log: sv.Log) -> Channels:
    return {name: np.array(log[name]) for name in log.channels if log.has(name)}


def read_at(c: Channels, forward_m: float, left_m: float) -> None:
    """Move the accelerometers to another place."""
    r = c["yaw_rate_radps"]
    dr = np.gradient(r, c["time_s"])
    c["ax_mps2"] = c["ax_mps2"] - left_m * dr - forward_m * r**2
    c["ay_mps2"] = c["ay_mps2"] + forward_m * dr - left_m * r**2


def test_two_centimetres_are_a_fault_in_a_model_car() -> None:
    car = model_cars.car()
    c = channels_of(model_cars.drives(sv.Model(car), seed=21)[1])
    read_at(c, 0.0, -0.02)
    log = sv.Log.from_arrays(c, check=False)
    found = sv.check(log, car)
    assert names(found) == ["imu_left_m"]
    low, high = found["imu_left_m"].interval
    assert low < -0.02 < high < 0.0
    assert sv.check(log)["imu_left_m"].found is False  # an ordinary car is not harmed


@pytest.fixture(scope="module")
def driven() -> Channels:
    log = sv.drive(sv.Model(sv.example_vehicle()), sv.manoeuvres.handling_course(), seed=31)
    c = channels_of(log)
    del c["vy_mps"]
    return c


def names(found: sv.SensorCheck) -> list[str]:
    return [fault.name for fault in found.found]


def checked(c: Channels) -> sv.SensorCheck:
    return sv.check(sv.Log.from_arrays(c, check=False), sv.example_vehicle())


def test_an_imu_beside_the_middle_is_no_scale_where_no_lateral_speed_is_logged(
    driven: Channels,
) -> None:
    c = dict(driven)
    read_at(c, 1.5, 0.6)
    found = checked(c)
    assert names(found) == ["imu_left_m"]
    assert found["imu_left_m"].value == pytest.approx(0.6, abs=0.1)
    low, high = found["gain_ax"].interval
    assert low < 0.0 < high


def test_a_late_lateral_acceleration_is_no_scale_where_no_lateral_speed_is_logged(
    driven: Channels,
) -> None:
    c = dict(driven)
    c["ay_mps2"] = np.interp(c["time_s"] - 0.06, c["time_s"], c["ay_mps2"])
    found = checked(c)
    assert names(found) == ["delay_ay_s"]
    assert found["delay_ay_s"].value == pytest.approx(0.06, abs=0.01)
