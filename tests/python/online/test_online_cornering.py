"""Cornering stiffness by least squares: no bias by what it leaves out."""

import dataclasses
import re
import warnings

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.online import cornering_stiffness
from sysid_vehicle.online.cornering_forces import felt_beside, straightness
from sysid_vehicle.online.sideslip import static_stiffness

GENERIC = sv.Tyre()


def car(stiffness: float, friction: float, drive_front_share: float) -> sv.Vehicle:
    tyres = {
        f"tyre_{axle}": sv.Tyre(B=factor * stiffness / (1.4 * friction), C=1.4, D=friction, E=0.0)
        for axle, factor in (("front", 1.0), ("rear", 1.2))
    }
    return dataclasses.replace(sv.example_vehicle(), drive_front_share=drive_front_share, **tyres)


def told(vehicle: sv.Vehicle, log: sv.Log) -> np.ndarray:
    """Stiffness over that of the truth, front and rear, and its standard deviation."""
    run = cornering_stiffness(vehicle, log, forgetting=1.0)
    return np.array([[run.cf_npr[-1], run.cr_npr[-1]], [run.cf_std_npr[-1], run.cr_std_npr[-1]]])


@pytest.mark.parametrize("lateral", [2.0, 5.0])
@pytest.mark.parametrize("drive_front_share", [0.0, 1.0])
def test_bent_tyres_moved_load_and_driven_wheels_leave_no_bias(
    lateral: float, drive_front_share: float
) -> None:
    true = car(18.0, 1.1, drive_front_share)
    course = sv.manoeuvres.handling_course(40.0, lateral, 20.0)
    log = sv.drive(sv.Model(true), course, seed=3, noise=sv.SensorNoise().scaled(0.01))
    value, std = told(true, log) / np.array(static_stiffness(true))
    np.testing.assert_allclose(value, 1.0, atol=0.003)
    generic = dataclasses.replace(true, tyre_front=GENERIC, tyre_rear=GENERIC)
    value, std = told(generic, log) / np.array(static_stiffness(true))
    np.testing.assert_allclose(value, 1.0, atol=0.02)
    assert (np.abs(value - 1.0) < 2.0 * std).all()


def test_without_a_wheel_force_the_acceleration_stands_for_it() -> None:
    true = car(15.0, 1.0, 1.0)
    log = sv.drive(sv.Model(true), sv.manoeuvres.lap(40.0, 3.0, 14.0), seed=4)
    both, alone = told(true, log), told(true, log.without("fx_n"))
    np.testing.assert_allclose(alone[0], both[0], rtol=0.01)
    np.testing.assert_allclose(alone[0], static_stiffness(true), rtol=0.01)


def test_gravity_that_an_accelerometer_feels_as_the_body_rolls_is_no_stiffness() -> None:
    true = sv.example_vehicle()
    log = sv.drive(sv.Model(true), sv.manoeuvres.lap(40.0, 4.0, 22.0), seed=5)
    columns = {name: log[name] for name in log.channels}
    columns["ay_mps2"] = 1.07 * columns["ay_mps2"]
    rolled = sv.Log.from_arrays(columns, name="rolled")
    value, std = told(true, rolled) / told(true, log)[0]
    np.testing.assert_allclose(value, 1.0, atol=0.005)
    # A road that leans with its turns looks the same: the interval holds both.
    assert (std > 0.06).all()


def test_what_an_accelerometer_feels_beside_the_motion() -> None:
    rng, time_s = np.random.default_rng(6), 0.01 * np.arange(4000)
    v_x, rate = np.full(4000, 20.0), 0.2 * np.sin(0.6 * time_s)
    v_y = 0.4 * np.sin(0.6 * time_s - 0.3)
    moved = 0.24 * np.cos(0.6 * time_s - 0.3) + v_x * rate
    v_y += 0.02 * rng.standard_normal(4000)
    assert felt_beside((v_x, v_y, rate, 1.05 * moved), 100.0) == pytest.approx(0.05, abs=0.002)
    v_y[100:400] = np.nan
    assert felt_beside((v_x, v_y, rate, 1.05 * moved), 100.0) == pytest.approx(0.05, abs=0.002)
    assert felt_beside((v_x, v_y, 0.0 * rate, moved), 100.0) == 0.0


def test_secant_over_slope_is_that_of_the_tyre_which_has_the_secant() -> None:
    tyre, load = sv.Tyre(B=13.0, C=1.35, D=0.95, E=-0.2), 4000.0
    slip, used = 0.03 * np.sin(np.arange(500) * 0.1), np.ones(500)
    used[::7] = 0.0
    weight = np.where(used > 0.5, slip**2, 0.0)
    force = load * tyre.friction(slip)
    secant = np.cumsum(np.where(used > 0.5, slip * force, 0.0))[2:] / np.cumsum(weight)[2:]
    other = tyre.replace(B=4.0)  # the file's stiffness does not matter
    ratio = straightness(other, load, slip[2:], used[2:], secant)
    slope = tyre.cornering_stiffness_per_load * load
    np.testing.assert_allclose(secant[-1] / ratio[-1], slope, rtol=0.002)
    assert (straightness(other, load, slip, np.zeros(500), np.full(500, 1e4)) == 1.0).all()
    assert np.isfinite(straightness(other, load, slip, used, np.full(500, -1e4))).all()


@pytest.mark.parametrize("lateral", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("times", [0.7, 1.4])
def test_a_steering_angle_that_is_not_of_the_road_wheels_is_told(
    lateral: float, times: float
) -> None:
    vehicle = sv.example_vehicle()
    log = sv.drive(sv.Model(vehicle), sv.manoeuvres.lap(60.0, lateral, 16.0), seed=7)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cornering_stiffness(vehicle, log)
    columns = {name: log[name] for name in log.channels}
    columns["steer_rad"] = times * columns["steer_rad"]
    other = sv.Log.from_arrays(columns, name="run", check=False)
    with pytest.warns(sv.SysidWarning) as heard:
        cornering_stiffness(vehicle, other)
    told = (re.search(r"run: steer_rad is ([\d.]+) .* that of road", str(w.message)) for w in heard)
    (found,) = (float(match[1]) for match in told if match is not None)
    assert found == pytest.approx(times, rel=0.02)


def test_the_angle_of_the_steering_wheel_is_refused() -> None:
    vehicle = sv.example_vehicle()
    log = sv.drive(sv.Model(vehicle), sv.manoeuvres.lap(60.0, 8.5, 34.0), seed=8)
    columns = {name: log[name] for name in log.channels}
    columns["steer_rad"] = 16.0 * columns["steer_rad"]
    with pytest.raises(sv.InvalidInput, match=r"steer_rad is 1\d\.?\d* times .* steering ratio"):
        cornering_stiffness(vehicle, sv.Log.from_arrays(columns, name="run", check=False))
