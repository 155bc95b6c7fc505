"""What drives can tell: separation of rivals, the next drive."""

import numpy as np
import pytest

from sysid_vehicle import (
    DriveLimits,
    Driving,
    Fit,
    InvalidInput,
    Log,
    Model,
    drive,
    effect,
    identify,
    manoeuvres,
    suggest_manoeuvre,
)
from sysid_vehicle.diagnose import NextDrive, separations
from sysid_vehicle.diagnose.information import information_of
from sysid_vehicle.diagnose.next_drive import extent_m
from sysid_vehicle.diagnose.score import score_board
from sysid_vehicle.simulate import drive_truth

LAG, RELAXATION = effect("steer_lag"), effect("tyre_relaxation")


def test_information_of_two_logs_adds_up(fit: Fit, lap: Log, course: Log) -> None:
    effects = (LAG, RELAXATION)
    parts = [information_of(fit, Driving.of(log), effects) for log in (lap, course)]
    both = information_of(fit, Driving.of([lap, course]), effects)
    np.testing.assert_allclose((parts[0] + parts[1]).matrix, both.matrix, rtol=1e-6)
    assert both.separation("steer_lag", [0.06]) > parts[0].separation("steer_lag", [0.06])


def test_information_is_that_of_the_score(fit: Fit) -> None:
    board = score_board(fit, fit.driving, (LAG,))
    direction = board.directions["steer_lag"]
    known = information_of(fit, fit.driving, (LAG,))
    assert known.about("steer_lag")[0, 0] == pytest.approx(float((direction**2).sum()), rel=1e-6)
    # A rival can only take away.
    pair = information_of(fit, fit.driving, (LAG, RELAXATION))
    assert pair.separation("steer_lag", [0.06], "tyre_relaxation") < pair.separation(
        "steer_lag", [0.06]
    )
    with pytest.raises(InvalidInput, match="shows nothing of 'aero_drag'"):
        pair.about("aero_drag")


@pytest.fixture(scope="module")
def gentle(truth: Model, start: Model) -> Fit:
    log = drive(truth, manoeuvres.constant_radius(60.0, 5.0, 40.0), seed=3)
    return identify(start, log, starts=1)


@pytest.fixture(scope="module")
def asked(gentle: Fit) -> NextDrive:
    return suggest_manoeuvre(gentle, LAG, RELAXATION, limits=DriveLimits(28.0, 7.0), enough=60.0)


def test_a_drive_that_tells_lag_from_relaxation(asked: NextDrive) -> None:
    assert asked.best.sigmas >= 60.0 > asked.now
    cheaper = [s for s in asked.suggestions if s.duration_s < asked.best.duration_s]
    assert all(s.sigmas < 60.0 for s in cheaper)
    assert "standard errors apart" in str(asked)
    assert "<table" in asked._repr_html_()


def test_what_was_promised_is_achieved(gentle: Fit, asked: NextDrive) -> None:
    small = 0.01  # s, where the test is still linear
    hidden = gentle.model.add(LAG).with_values({"steer_lag.time_constant_s": small})
    log = drive(hidden, asked.best.manoeuvre, seed=9)
    fit = identify(gentle.model, log, starts=1)
    board = score_board(fit, fit.driving, (LAG, RELAXATION))
    beyond = board.joint_statistic("steer_lag", "tyre_relaxation") - board.joint_statistic(
        "tyre_relaxation"
    )
    promised = information_of(fit, fit.driving, (LAG, RELAXATION)).separation(
        "steer_lag", [small], "tyre_relaxation"
    )
    assert promised > 5.0
    assert np.sqrt(max(beyond, 0.0)) == pytest.approx(promised, rel=0.3)


def test_limits_are_kept(gentle: Fit) -> None:
    small = DriveLimits(20.0, 6.0, area_m=(60.0, 40.0))
    found = suggest_manoeuvre(gentle, LAG, RELAXATION, limits=small)
    assert found.refused > 5
    for s in found.suggestions:
        made = drive_truth(gentle.model, s.manoeuvre, seed=0)
        assert max(extent_m(made)) <= 66.0
    nowhere = suggest_manoeuvre(
        gentle, LAG, RELAXATION, limits=DriveLimits(20.0, 6.0, area_m=(2.0, 1.0))
    )
    with pytest.raises(InvalidInput, match="widen"):
        nowhere.best  # noqa: B018
    with pytest.raises(InvalidInput, match="speed_mps is -1"):
        DriveLimits(-1.0)


def test_separations_of_all_pairs(fit: Fit) -> None:
    found = separations(fit, ["steer_lag", "tyre_relaxation", "steer_offset"])
    assert len(found) == 3
    assert found["steer_lag", "steer_offset"] > found["steer_lag", "tyre_relaxation"] > 0.0


def test_an_effect_the_model_has_is_refused(gentle: Fit) -> None:
    has = identify(gentle.model.add("steer_offset"), gentle.driving, starts=1)
    with pytest.raises(InvalidInput, match="has 'steer_offset' already"):
        suggest_manoeuvre(has, "steer_offset", "road_bank")
