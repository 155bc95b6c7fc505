"""A study of a car on a scale of one to eight, which moves as an ordinary one does."""

import pytest
from few_drives import asked_of_few
from model_cars import car, drives

import sysid_vehicle as sv
from sysid_vehicle.estimate import Driving


def test_a_complete_model_is_adequate() -> None:
    train, test = drives(sv.Model(car()), 411)
    study = sv.improve(sv.Model(car()), train, test, starts=1)
    assert study.verdict == "adequate"
    assert not study.added


def test_a_side_wind_of_an_eighth_of_its_weight_is_named() -> None:
    hidden = {"side_wind.side_force_n": 0.03 * 9.81 * car().mass_kg}
    truth = sv.Model(car()).add("side_wind").with_values(hidden)
    train, test = drives(truth, 413)
    study = sv.improve(sv.Model(car()), train, test, starts=1)
    assert study.verdict == "explained"
    assert [a.id for a in study.added] == ["side_wind"]
    found = study.fit["side_wind.side_force_n"]
    assert found.value == pytest.approx(hidden["side_wind.side_force_n"], abs=3.0 * found.std)
    (verdict,) = (v for v in study.verdicts.all if v.effect.id == "side_wind")
    assert verdict.finding == "missing"


def test_its_wheel_force_is_believed() -> None:
    train, _ = drives(sv.Model(car()), 415)
    assert 2.0 < car().mass_kg < 4.0
    assert not train.contradictions
    assert Driving.of(train).force_known


def test_the_next_drive_fits_its_ground(monkeypatch: pytest.MonkeyPatch) -> None:
    train, _ = drives(sv.Model(car()), 417)
    asked_of_few(monkeypatch)
    found = sv.suggest_manoeuvre(
        sv.identify(sv.Model(car()), train, starts=1),
        "tyre_load_sensitivity",
        "longitudinal_load_transfer",
    )
    assert found.suggestions
    limits = sv.DriveLimits.usual(car())
    assert limits.speed_mps == pytest.approx(36.0 * (0.33 / 2.0) ** 0.5, rel=0.05)
    for suggestion in found.suggestions:
        assert suggestion.drive.states[:, 0].max() <= 1.02 * limits.speed_mps


@pytest.mark.parametrize("top_mps", [2.5, 3.0])
def test_manoeuvres_may_be_as_slow_as_logs_of_such_a_car(top_mps: float) -> None:
    slow = sv.manoeuvres.step_steer((0.5 * top_mps, top_mps), (1.0, 2.0))
    log = sv.drive(sv.Model(car()), slow, seed=419)
    assert log.stretches()
    with pytest.raises(sv.InvalidInput, match=r"needs 1.2 m/s or more"):
        sv.manoeuvres.step_steer((1.1, top_mps))
