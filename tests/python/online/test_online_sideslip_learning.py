"""What a calibration drive teaches the sideslip observers, and what vibration must not do."""

import dataclasses
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.online import (
    calibrate_sideslip,
    estimate_sideslip,
    fitted_vehicle,
)
from sysid_vehicle.online.sideslip_calibration import _score as log_density


@pytest.fixture(scope="module")
def vehicle():
    return sv.example_vehicle()


@pytest.fixture(scope="module")
def log(vehicle):
    exact = sv.SensorNoise(vy_mps=0.0)  # the truth that the observer is judged by
    course = sv.manoeuvres.handling_course()
    return sv.drive(sv.Model(vehicle), course, seed=1, noise=exact).between(0.0, 40.0)


@pytest.fixture(scope="module")
def wrong(vehicle):
    """The car with tyres that grip less, and saturate otherwise, than they do."""
    tyre = {"C": 1.1, "D": 0.8}
    return dataclasses.replace(
        vehicle,
        tyre_front=vehicle.tyre_front.replace(**tyre),
        tyre_rear=vehicle.tyre_rear.replace(**tyre),
    )


def test_vibration_of_the_longitudinal_accelerometer_takes_no_grip(vehicle, log):
    rng = np.random.default_rng(0)
    columns = {name: log[name] for name in log.channels}
    columns["ax_mps2"] = log["ax_mps2"] + 1.5 * rng.standard_normal(log.n)
    shaken = estimate_sideslip(vehicle, sv.Log.from_arrays(columns, name="shaken", check=False))
    quiet = estimate_sideslip(vehicle, log)
    assert shaken.error().rms_deg < 1.5 * quiet.error().rms_deg
    assert shaken.error().covered > 0.85


def test_a_calibration_drive_teaches_what_to_trust(wrong, log):
    drive = log.between(0.0, 10.0)
    found = calibrate_sideslip(wrong, drive, runs=4)
    assert found.score_after > found.score_before
    assert "log density" in str(found)
    again = calibrate_sideslip(wrong, drive, runs=4)
    assert dict(again.settings) == dict(found.settings)


@pytest.fixture(scope="module")
def noisy(log):
    """The same drive, its lateral speed with the noise of an antenna pair."""
    columns = {name: np.array(log[name]) for name in log.channels}
    columns["vy_mps"] += 0.1 * np.random.default_rng(2).standard_normal(log.n)
    return sv.Log.from_arrays(columns, name="noisy", check=False)


def test_the_band_does_not_answer_for_noise_of_the_measured_sideslip(vehicle, log, noisy):
    run = estimate_sideslip(vehicle, noisy)
    exact, told = estimate_sideslip(vehicle, log).error(), run.error()
    speed = np.hypot(log["vx_mps"], log["vy_mps"])
    assert told.noise_deg == pytest.approx(
        np.degrees(np.sqrt(np.mean((0.1 / speed) ** 2))), rel=0.1
    )
    assert told.noise_deg > 1.5 * exact.rms_deg
    assert told.covered > 0.9
    assert "of it noise of the measured one" in str(run)
    truth = np.arctan2(log["vy_mps"], log["vx_mps"])
    assert run.error(truth) == dataclasses.replace(exact, noise_deg=0.0)


def test_what_a_calibration_maximises_answers_for_no_noise_of_the_measured(vehicle, log, noisy):
    """The band that scores best is no wider than by exact sideslip."""
    wider = np.geomspace(0.05, 5.0, 47)

    def best(measured):
        run = estimate_sideslip(vehicle, measured.between(0.0, 20.0), judge=False)
        bands = [dataclasses.replace(run, beta_std_rad=w * run.beta_std_rad) for w in wider]
        return wider[np.argmax([log_density(band) for band in bands])]

    exact = best(log)
    assert wider[0] < exact < wider[-1]
    assert best(noisy) < 1.2 * exact


def test_a_calibration_does_not_learn_the_noise_of_the_measured_sideslip(vehicle, log, noisy):
    found = calibrate_sideslip(vehicle, noisy.between(0.0, 8.0), runs=20)
    rest = log.between(20.0, 30.0)
    before = estimate_sideslip(vehicle, rest, settings=found.before.settings)
    after = estimate_sideslip(vehicle, rest, settings=found.settings)
    assert found.score_after > found.score_before
    assert after.error().rms_deg < 1.2 * before.error().rms_deg
    assert np.mean(after.beta_std_rad) < 1.05 * np.mean(before.beta_std_rad)  # 1.18 with it


def test_a_drive_without_sideslip_teaches_nothing(vehicle, log):
    columns = {name: log[name] for name in log.channels if name != "vy_mps"}
    blind = sv.Log.from_arrays(columns, name="blind", check=False)
    with pytest.raises(InvalidInput, match="calibrate on a drive that has it"):
        calibrate_sideslip(vehicle, blind)
    with pytest.raises(InvalidInput, match="one run at least"):
        calibrate_sideslip(vehicle, log, runs=0)


def test_a_fit_gives_its_car(vehicle):
    model = sv.Model(vehicle).with_values({"B_front": 7.5, "D_rear": 1.25})
    car = fitted_vehicle(SimpleNamespace(model=model))
    assert car.tyre_front.B == 7.5
    assert car.tyre_rear.D == 1.25
    assert car.yaw_inertia_kgm2 == vehicle.yaw_inertia_kgm2
    assert car.tyre_front.C == vehicle.tyre_front.C


def test_a_car_without_what_the_fit_found_is_warned_of(vehicle):
    """Downforce and heat of the tyres were left out with no word."""
    found = sv.Model(vehicle).add("mass", "aero_downforce", "tyre_temperature")
    found = found.with_values({"mass.relative_error": 0.1, "aero_downforce.cl_a_front_m2": 2.0})
    with pytest.warns(SysidWarning, match=r"effects \(aero_downforce, tyre_temperature\): the obs"):
        car = fitted_vehicle(SimpleNamespace(model=found))
    assert car.mass_kg == pytest.approx(1.1 * vehicle.mass_kg)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fitted_vehicle(SimpleNamespace(model=sv.Model(vehicle).add("mass").with_nuisances()))


def test_settings_on_trial_warn_of_nothing(vehicle, log):
    """Of tyres that are softer than told it was warned once for every run, with other figures."""
    stiff = {"B": 3.0 * vehicle.tyre_front.B}
    told = dataclasses.replace(
        vehicle,
        tyre_front=vehicle.tyre_front.replace(**stiff),
        tyre_rear=vehicle.tyre_rear.replace(**stiff),
        yaw_inertia_kgm2=None,
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SysidWarning)
        calibrate_sideslip(told, log.between(0.0, 15.0), runs=5)
    said = [str(w.message) for w in caught]
    assert sum("yaw_inertia_kgm2 is not given" in text for text in said) == 1
    assert sum("cornering stiffness" in text for text in said) == 1


def test_a_drive_that_is_too_slow_teaches_nothing(vehicle, log):
    columns = {name: log[name] for name in log.channels} | {"vx_mps": 0.01 * log["vx_mps"]}
    slow = sv.Log.from_arrays(columns, name="slow", check=False)
    with (
        pytest.warns(SysidWarning, match="no sideslip was estimated"),
        pytest.raises(InvalidInput, match="slow: no sideslip is estimated"),
    ):
        calibrate_sideslip(vehicle, slow)
