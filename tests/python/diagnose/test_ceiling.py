"""How much of what is missing any function of the driving could explain."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Fit, Log, Model, RoadDisturbance, ceiling, drive, manoeuvres
from sysid_vehicle.diagnose import Ceiling, Explainable
from sysid_vehicle.diagnose.unexplained.ceiling import _ago, _features, _share, ridge
from sysid_vehicle.estimate import Driving
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study.judge.structure import structure


def test_a_wrong_answer_to_the_steering_can_be_explained(fit: Fit, course: Log) -> None:
    late = fit.model.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.15})
    found = ceiling(replace(fit, model=late), course)
    moment = next(f for f in found.forces if f.target == "M_z")
    assert moment.share > 0.6
    assert moment.low < moment.share < moment.high
    assert moment in found.structure
    assert "of the missing M_z" in str(found)
    assert found.to_dict()["M_z"]["unit"] == "N m"


def test_nothing_is_explainable_beside_the_right_model(fit: Fit, course: Log) -> None:
    found = ceiling(fit, course)
    assert [f.target for f in found.forces] == ["F_y", "M_z"]
    assert found.structure == ()
    assert "no function of steering, speed and acceleration history is shown" in str(found)


def test_a_force_that_is_always_there_is_no_structure(truth: Model, fit: Fit) -> None:
    """A steady wind: its mean is known from the training data, and taken off elsewhere."""
    windy = truth.add("side_wind").with_values({"side_wind.side_force_n": 600.0})
    logs = [
        drive(windy, course, seed=7, rate_hz=50.0)
        for course in (manoeuvres.lap(40.0), manoeuvres.handling_course(40.0))
    ]
    side = next(f for f in ceiling(fit, logs[1], logs[0]).forces if f.target == "F_y")
    assert side.rms < 200.0


def test_disturbances_of_the_road_are_not_explainable(truth: Model, fit: Fit) -> None:
    rough = RoadDisturbance(fy_n=400.0, mz_nm=200.0)
    logs = [
        drive(truth, manoeuvres.lap(40.0), seed=s, disturbance=rough, rate_hz=50.0) for s in (5, 6)
    ]
    found = ceiling(fit, logs[1], logs[0])
    assert all(f.rms > 100.0 for f in found.forces)
    assert all(f.share < 0.15 for f in found.forces)
    assert found.structure == ()


def test_what_depends_on_the_driving_is_shown_on_both_data_sets(fit: Fit, course: Log) -> None:
    driving = Driving.of(course)
    right = structure(fit, driving)
    assert "missing F_y" in right.train.keys() & right.test.keys()
    assert right.anywhere < USUAL.explainable
    late = fit.model.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.15})
    wrong = structure(replace(fit, model=late), driving)
    assert USUAL.explainable < wrong.everywhere <= wrong.anywhere < 1.0
    assert wrong.strongest.endswith("on validation data")
    assert wrong.to_dict()["test"]["missing M_z"][0] == wrong.test["missing M_z"].share
    # What one data set shows alone is not shown everywhere.
    assert (
        replace(right, test=wrong.test).everywhere < 0.1 < replace(right, test=wrong.test).anywhere
    )
    lost = replace(fit, model=fit.model.with_values({"B_front": float("nan")}))
    assert structure(lost, driving).everywhere == 0.0


def test_what_disturbs_at_random_has_no_structure(truth: Model, fit: Fit) -> None:
    rough = RoadDisturbance(fy_n=400.0, mz_nm=200.0)
    logs = [
        drive(truth, manoeuvres.lap(40.0), seed=s, disturbance=rough, rate_hz=50.0) for s in (5, 6)
    ]
    train, test = map(Driving.of, logs)
    found = structure(replace(fit, driving=train), test)
    assert found.everywhere < 0.05


def test_measured_lateral_motion_is_no_regressor(
    fit: Fit, course: Log, rng: np.random.Generator
) -> None:
    """It holds the missing force itself, and would explain whatever is missing."""
    lateral = ("vy_mps", "yaw_rate_radps", "ay_mps2")
    noise = {c: rng.standard_normal(course.n) for c in lateral}
    columns = {**{c: course[c] for c in course.channels}, **noise}
    other = Log.from_arrays(columns, name=course.name, check=False)
    one, two = (_features(fit, Driving.of(log)) for log in (course, other))
    assert one.shape == two.shape
    np.testing.assert_array_equal(one, two)


def test_history_does_not_reach_over_the_begin_of_a_stretch(lap: Log) -> None:
    driving = Driving.of([lap.between(0.0, 5.0), lap.between(10.0, 15.0)])
    v = driving.channel("vx_mps")
    n, lag = driving.samples // 2, round(0.4 * lap.rate_hz)
    ago = _ago(driving, v, 0.4)
    assert np.all(ago[n : n + lag] == v[n])
    np.testing.assert_array_equal(ago[n + lag :], v[n:-lag])


def test_noise_is_shrunk_and_a_law_is_found(rng: np.random.Generator) -> None:
    X = rng.standard_normal((600, 40))
    fold, piece = np.arange(600) // 60 % 5, np.arange(600) // 30
    law = X[:, 0] - 0.5 * X[:, 3]
    for y, expected in ((law + 0.5 * rng.standard_normal(600), 0.83), (X @ np.zeros(40), 0.0)):
        y = y + 1e-3 * rng.standard_normal(600)
        found_law = ridge(X[:300], y[:300, None], fold[:300])
        error = y[300:] - found_law.mean[0] - X[300:] @ found_law.size[:, 0]
        found = _share("F_y", y[300:], error, piece[300:] - 10, rng)
        assert found.share == pytest.approx(expected, abs=0.1)
        assert found.low < expected + 0.05
        assert found.high > expected - 0.05


def test_structure_takes_more_than_a_tenth() -> None:
    forces = (Explainable("F_y", 0.3, 0.08, 0.5, 200.0), Explainable("M_z", 0.7, 0.6, 0.8, 90.0))
    assert Ceiling(forces).structure == forces[1:]
