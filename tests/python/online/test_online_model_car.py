"""The sideslip of a model car, at speeds at which an ordinary one parks."""

import numpy as np
import pytest
from model_cars import car, drives

import sysid_vehicle as sv
from sysid_vehicle.online import (
    SideslipObserver,
    SideslipSettings,
    cornering_stiffness,
    estimate_sideslip,
)


@pytest.fixture(scope="module")
def slow() -> sv.Log:
    exact = sv.SensorNoise(vy_mps=0.0)
    truth = sv.Model(car()).add("tyre_relaxation")
    truth = truth.with_values({"tyre_relaxation.relaxation_length_m": 0.05})
    steps = sv.manoeuvres.step_steer((2.0, 2.5, 3.0), (2.0, 4.0))
    return sv.drive(truth, steps, seed=631, noise=exact)


def test_its_settings_are_those_of_the_driving_and_of_the_car(slow: sv.Log) -> None:
    usual, here = SideslipSettings(), SideslipSettings.of(slow, car())
    assert here["stop_below_mps"] == slow.least_speed_mps < 1.3
    assert here["go_above_mps"] / here["stop_below_mps"] == pytest.approx(4.0 / 3.0)
    assert here["relaxation_m"] == pytest.approx(usual["relaxation_m"] * car().wheelbase_m / 2.0)
    # Nothing of an ordinary car at its speeds is changed.
    ordinary = sv.drive(sv.Model(sv.example_vehicle()), sv.manoeuvres.lap(20.0), seed=633)
    found = SideslipSettings.of(ordinary, sv.example_vehicle())
    same = ("stop_below_mps", "go_above_mps", "relaxation_m", "ahead_m")
    assert [found[n] for n in same] == [usual[n] for n in same]


def test_it_is_found_with_its_error(slow: sv.Log) -> None:
    run = estimate_sideslip(car(), slow)
    assert np.mean(run.mode == 1) < 0.05
    found = run.error()
    assert found is not None
    assert found.rms_deg < 0.3
    assert found.covered > 0.9


def test_in_a_control_loop_it_is_found_without_settings(slow: sv.Log) -> None:
    """The documented call: an observer that is given nothing but the car."""
    observer = SideslipObserver(car())
    names = ("steer_rad", "vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
    signals = np.column_stack([slow[name] for name in names])
    steps = [observer.step(1.0 / slow.rate_hz, *row) for row in signals]
    error = np.array([s.beta_rad for s in steps]) - np.arctan2(slow["vy_mps"], slow["vx_mps"])
    assert np.mean([s.mode == 1 for s in steps]) < 0.05
    assert np.degrees(np.sqrt(np.mean(error**2))) < 0.4


def test_small_stiffnesses_are_printed_with_their_figures() -> None:
    run = estimate_sideslip(car(), drives(sv.Model(car()), 635)[0])
    (front,) = (line for line in str(run).splitlines() if line.strip().startswith("front"))
    stiffness, std = (float(x) for x in front.split()[1:3])
    assert stiffness == pytest.approx(run.cf_npr[-1] / 1e3, rel=0.01)
    assert 0.0 < std < 0.1 * stiffness


def test_small_stiffnesses_by_least_squares_are_printed_with_their_figures() -> None:
    """They were "0.1 +- 0.0 kN/rad"."""
    run = cornering_stiffness(car(), drives(sv.Model(car()), 635)[0])
    printed = str(run).partition("front ")[2].split()
    assert float(printed[0]) == pytest.approx(run.cf_npr[-1] / 1e3, rel=0.01)
    assert float(printed[2].rstrip(",")) == pytest.approx(run.cf_std_npr[-1] / 1e3, rel=0.05)
