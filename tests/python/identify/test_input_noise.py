"""Noise of the steering angle speaks for lags, which filter it: models are compared without."""

import pytest

import sysid_vehicle as sv
from sysid_vehicle.identify import Fit, lost_to_input_noise, refine, with_exact_inputs

LATE_S = 0.03
TWO = {"steer_delay": "delay_s", "steer_lag": "time_constant_s"}


def start() -> sv.Model:
    return sv.Model(sv.example_vehicle())


def late(effect: str) -> sv.Model:
    return start().add(effect).with_values({f"{effect}.{TWO[effect]}": LATE_S})


def log(effect: str, steer_rad: float, rate_hz: float = 100.0) -> sv.Log:
    noise = sv.SensorNoise(steer_rad=steer_rad)
    return sv.drive(late(effect), sv.manoeuvres.lap(), seed=71, noise=noise, rate_hz=rate_hz)


def fitted(log: sv.Log, *effects: str) -> dict[str, Fit]:
    base = sv.identify(start(), log, starts=1)
    return {e: refine(late(e), base.driving, base.noise) for e in effects}


def test_a_lag_is_likelier_than_the_delay_that_is_there_and_not_with_exact_inputs() -> None:
    noisy, clean = (fitted(log("steer_delay", std), *TWO) for std in (2e-4, 0.0))
    delay, lag = (noisy[e] for e in TWO)
    assert lag.log_likelihood > delay.log_likelihood + 5.0
    assert with_exact_inputs(delay) > with_exact_inputs(lag)
    # Where the steering angle is exact the delay is as far ahead as it is said to be.
    told = with_exact_inputs(delay) - with_exact_inputs(lag)
    there = clean["steer_delay"].log_likelihood - clean["steer_lag"].log_likelihood
    assert told == pytest.approx(there, abs=6.0)


def test_exact_inputs_take_nothing() -> None:
    # Drive and brake follow the curves of the manoeuvre, with no noise of their own.
    fit = fitted(log("steer_lag", 0.0, 50.0), "steer_lag")["steer_lag"]
    assert lost_to_input_noise(fit, fit.driving) < 0.5
    assert with_exact_inputs(fit) == pytest.approx(fit.log_likelihood, abs=0.5)


def test_the_study_says_that_a_smooth_lap_tells_a_delay_from_no_lag() -> None:
    course = sv.drive(
        late("steer_delay"), sv.manoeuvres.handling_course(30.0), seed=72, rate_hz=50.0
    )
    lap = log("steer_delay", 2e-4, 50.0)
    near = [*TWO, "tyre_relaxation", "steer_compliance", "yaw_inertia", "sensor_delay"]
    study = sv.improve(start(), lap, course, candidates=near, starts=1, sensors=False)
    (added,) = study.added
    assert {added.id, *added.confounded_with} >= {"steer_delay"}
    assert added.id == "steer_delay" or added.grade == "plausible"
