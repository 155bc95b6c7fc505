"""The whole loop: the missing effect is added, and the error falls on driving nobody fitted."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from contradictions import contradictions

from sysid_vehicle import (
    Fit,
    InvalidInput,
    Log,
    Model,
    Study,
    SysidWarning,
    catalogue,
    drive,
    effect,
    improve,
    manoeuvres,
)
from sysid_vehicle.diagnose import Verdicts
from sysid_vehicle.estimate import Driving
from sysid_vehicle.rules import Gain
from sysid_vehicle.study.ahead.beyond import Beyond
from sysid_vehicle.study.ahead.shares import shares
from sysid_vehicle.study.validation import error_falls, gain_in_log_likelihood, set_aside

LAG = "steer_lag.time_constant_s", 0.06
LOOKS_LIKE_LAG = {
    "steer_lag",
    "steer_compliance",
    "tyre_relaxation",
    "yaw_inertia",
    *effect("steer_lag").confounded_with,
}
Drives = Callable[[Model, int], tuple[Log, Log]]


@pytest.fixture(scope="module")
def drives() -> Drives:
    def make(car: Model, seed: int) -> tuple[Log, Log]:
        course = manoeuvres.handling_course(30.0, lateral_mps2=7.5)
        train = drive(car, manoeuvres.lap(30.0), seed=seed, rate_hz=50.0)
        return train, drive(car, course, seed=seed + 1, rate_hz=50.0)

    return make


@pytest.fixture(scope="module")
def lagging(truth: Model, drives: Drives) -> tuple[Log, Log]:
    return drives(truth.add("steer_lag").with_values(dict([LAG])), 21)


@pytest.fixture(scope="module")
def told() -> list[str]:
    return []


@pytest.fixture(scope="module")
def study(start: Model, lagging: tuple[Log, Log], told: list[str]) -> Study:
    return improve(start, *lagging, starts=1, tell=told.append)


def test_what_other_parameters_take_away_is_no_share_of_an_effect(study: Study) -> None:
    first, yaw = study.fits[0].model, (1, study.shares.horizons_s.index(2.0), 1)
    bent = first.with_values({"B_front": 0.5 * first.value("B_front")})
    worse = replace(study.fits[0], model=bent)
    alone = shares(worse, study.fit, study.validation)
    assert alone.baseline[yaw] > 10.0 * study.shares.baseline[yaw]
    found = replace(study, fits=(worse, *study.fits[1:])).shares
    assert found.baseline[yaw] < 2.0 * study.shares.baseline[yaw]


def test_the_hidden_effect_is_added_first(study: Study) -> None:
    assert study.verdict == "explained"
    assert study.diagnoses[0].ranking[0].id == "steer_lag"
    assert [a.id for a in study.added] == ["steer_lag"]
    assert study.model.effects == ("steer_lag",)
    (estimate,) = study.added[0].parameters
    assert abs(estimate.value - LAG[1]) < 4.0 * estimate.std
    assert study.added[0].p_value < 1e-6


def test_the_validation_error_falls_to_the_noise_floor(study: Study) -> None:
    assert study.test[0].error > 1.2
    assert study.test[-1].error <= 1.05
    assert study.train[-1].error == pytest.approx(1.0, abs=0.02)
    added = study.added[0]
    assert (added.error_before, added.error_after) == (study.test[0].error, study.test[-1].error)
    assert study.omnibus.p_value > 0.01


def test_the_steps_belong_together(study: Study) -> None:
    assert [f.model.effects for f in study.fits] == [(), ("steer_lag",)]
    assert study.fit is study.fits[-1]
    assert len(study.train) == len(study.test) == len(study.fits)
    assert len(study.diagnoses) == 2
    assert study.diagnoses[1].significant == ()
    assert study.full == ()
    assert not any("as many effects" in w for w in study.warnings)
    assert study.seconds > 0.0


def test_it_tells_what_it_does(study: Study, told: list[str]) -> None:
    assert told[0].startswith("Fitted the baseline to lap")
    assert [t for t in told if t.startswith("Added steer_lag: time_constant_s 0.0")]


def test_a_study_prints(study: Study) -> None:
    assert contradictions(str(study)) == []
    for text in (str(study), study._repr_html_()):
        assert "explained" in text
        assert study.meaning in text
        assert "+ steer_lag" in text
        assert f"{study.test[-1].error:.3f}" in text
    assert str(study).startswith("Verdict: explained")


def refuse_constant(name: str) -> None:
    raise AssertionError(f"{name} is not JSON")


def test_the_figures_are_json(study: Study, tmp_path: Path) -> None:
    path = tmp_path / "study.json"
    study.to_json(path)
    told = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse_constant)
    assert sorted(told) == [
        *("between_logs", "causes", "channels", "disagreements", "effects", "errors", "events"),
        *("explained", "horizons", "late_facts", "left_out", "next_steps", "parameters"),
        *("predicting", "ranking", "regions", "shares", "unknown", "verdict", "verdicts"),
        *("warnings", "where", "where_baseline"),
    ]
    assert told["verdict"] == "explained"
    assert study.added[0].id in told["causes"]["sets"][0]["effects"]
    (added,) = told["effects"]
    assert sorted(added) == [
        *("backed", "confounded_with", "error_after", "error_before", "gains", "grade", "id"),
        *("own_share", "own_share_in_training", "p_value", "parameters", "share_together"),
        *("share_together_in_training", "stands_in", "takes_little", "useful"),
    ]
    assert added["confounded_with"] == list(study.added[0].confounded_with)
    assert added["stands_in"] == ""
    assert added["grade"] == ("plausible" if added["confounded_with"] else "confirmed")
    # One sample ahead and at every horizon the yaw rate is predicted better.
    assert all(g > 0.0 for g in added["gains"]["yaw_rate_radps"])
    assert told["horizons"]["horizons_s"] == [0.5, 1.0, 2.0, 5.0]
    assert len(told["horizons"]["channels"]["vy_mps"]["median"]) == 2
    assert added["parameters"]["time_constant_s"]["unit"] == "s"
    assert added["parameters"]["time_constant_s"]["value"] == study.model.value(LAG[0])
    first = told["ranking"][0]
    assert sorted(first) == [
        "bound",
        "group",
        "id",
        "indistinguishable_from",
        "p_value",
        "parameters",
        "retained",
        "statistic",
        "status",
        "test_error",
        "train_error",
    ]
    assert first["id"] == "steer_lag"
    # The right effect's errors are those that the model has after it was added.
    assert first["train_error"] == pytest.approx(study.train[-1].error, rel=1e-3)
    assert first["test_error"] == pytest.approx(study.test[-1].error, rel=1e-3)
    assert (first["status"], first["group"]) == ("missing", [])
    assert 0.0 < first["retained"] <= 1.0
    assert {c["status"] for c in told["ranking"][1:]} <= {"proxy", "absent", "not testable"}
    absent = [c for c in told["ranking"] if c["status"] == "absent"]
    assert absent
    assert all(b > 0.0 for c in absent for b in c["bound"])
    for when in ("before", "after"):
        for where in ("train", "test"):
            channels = told["channels"][when][where]
            assert list(channels) == list(study.test[0].channels)
            for figures in channels.values():
                assert sorted(figures) == ["noise_floor", "nrmse", "r2", "rmse"]
    assert told["channels"]["after"]["test"]["ay_mps2"]["nrmse"] < 1.1
    # Where the verdict does not ask for it, the shape of the unknown is not sought.
    assert study.unknown is None
    assert sorted(told["unknown"]) == [
        *("explainable", "foretold", "p_value", "slow", "strongest", "structure", "together"),
    ]
    assert told["predicting"]["horizon_s"] == 2.0
    assert told["predicting"]["added_is_needed"]
    assert set(told["predicting"]["parameters"]) < set(told["parameters"])
    assert sorted(told["unknown"]["together"]) == ["p_value", "strongest"]
    assert told["unknown"]["together"]["p_value"] > 1e-4
    # The final model has the lag: beside it there is no delay, without it there is.
    delay = told["where"]["delays"]["steer"]
    assert abs(delay["delay_s"]) < 3.0 * delay["std_s"]
    late = told["where"]["delays_without_lags"]["steer"]
    assert late["delay_s"] == pytest.approx(LAG[1], abs=0.005)
    assert late["alone"]
    assert {"change_points", "delays"}.isdisjoint(told["where_baseline"])
    assert told["regions"]
    for region in told["regions"]:
        assert sorted(region) == ["lateral_acceleration_mps2", "share", "speed_mps"]
        assert region["speed_mps"][0] < region["speed_mps"][1]
    assert told["errors"]["test"] == [c.error for c in study.test]
    assert set(told["parameters"]) >= {"B_front", LAG[0], "cornering stiffness rear"}
    assert told["warnings"] == list(study.warnings)
    assert list(tmp_path.iterdir()) == [path]


def test_other_warnings_cost_no_second_look(study: Study) -> None:
    known = study.where, study.unknown
    other = study.with_warnings(["the road was wet"])
    assert other.warnings == ("the road was wet",)
    assert (other.where, other.unknown) == known


def test_infinite_figures_become_null(study: Study, tmp_path: Path) -> None:
    names = [e.name for e in study.fit.estimates if not np.isfinite(e.std)]
    told = study.to_dict()["parameters"]
    assert all(np.isinf(told[n]["std"]) for n in names)
    path = tmp_path / "study.json"
    study.to_json(path)
    written = json.loads(path.read_text(encoding="utf-8"))["parameters"]
    assert [n for n, e in written.items() if e["std"] is None] == names


def test_a_part_is_told_with_its_share(study: Study) -> None:
    part = replace(study, verdict="partly_explained", explained=Beyond((1.0, 0.7), 0.3, 0.2, 0.4))
    assert "30 % (20 to 40) of the error 1 to 5 s ahead; the rest is" in part.meaning
    assert part.meaning.startswith(f"named: {study.added[0].name}; the effects added explain 30 %")
    little = "s ahead; something else is missing that takes little of it"
    assert replace(part, explained=study.explained).meaning.endswith(little)
    unasked = replace(part, explained=None).meaning
    assert unasked.endswith("the effects added explain part of it; something else is missing")
    # What cannot be told from another is one name.
    one, other = (
        replace(study.added[0], id=e, confounded_with=(f,))
        for e, f in (("mass", "force_gain"), ("force_gain", "mass"))
    )
    (known,) = (v for v in study.verdicts.all if v.effect.id == study.added[0].id)
    told = Verdicts(tuple(replace(known, effect=effect(e.id)) for e in (one, other)))
    both = replace(part, added=(one, other), verdicts=told)
    assert both.meaning.startswith("named: mass or force_gain; the effects added")


def test_undetermined_parameters_are_among_the_warnings(study: Study) -> None:
    for name in study.fit.undetermined:
        assert any(w.startswith(f"{name}: ") for w in study.warnings)


def test_a_complete_model_is_adequate(start: Model, truth: Model, drives: Drives) -> None:
    found = improve(start, *drives(truth, 31), starts=1)
    assert found.verdict == "adequate"
    assert found.added == ()
    assert found.to_dict()["effects"] == []
    assert len(found.fits) == 1
    assert found.test[0].error == pytest.approx(1.0, abs=0.04)
    assert "no remaining error" in str(found)
    assert contradictions(str(found)) == []


def test_what_no_candidate_explains_is_not_explained(
    start: Model, lagging: tuple[Log, Log]
) -> None:
    others = ["aero_drag", "accelerometer_scale", "gyro_bias", "mass", "steer_offset", "side_wind"]
    assert not {*others} & LOOKS_LIKE_LAG
    found = improve(start, *lagging, starts=1, candidates=others, sensors=False)
    assert found.verdict in ("unknown", "partly_explained")
    assert not set(found.model.effects) & LOOKS_LIKE_LAG
    assert found.omnibus.p_value < 0.01 or found.train[-1].error > 1.1
    assert contradictions(str(found)) == []


@pytest.mark.manual
def test_one_effect_that_leaves_something_is_none(
    start: Model, truth: Model, drives: Drives
) -> None:
    """A wrong mass would take up most of what an accelerometer's wrong gain leaves."""
    wrong = {"accelerometer_scale.ax_error": 0.05, "accelerometer_scale.ay_error": 0.05}
    car = truth.add("accelerometer_scale").with_values(wrong)
    found = improve(start, *drives(car, 51), starts=1, candidates=["mass"])
    assert found.verdict == "unknown"
    assert found.verdicts["mass"].finding == "proxy"
    assert contradictions(str(found)) == []
    both = improve(start, *drives(car, 51), starts=1, candidates=["mass", "accelerometer_scale"])
    assert [a.id for a in both.added] == ["accelerometer_scale"]
    assert both.verdict == "explained"


@pytest.mark.manual
def test_what_leaves_the_evidence_as_it_was_is_a_stand_in(
    start: Model, truth: Model, drives: Drives
) -> None:
    """The noise that a wrong gain of the accelerometer seems to be hides it, but not its trace."""
    wrong = {"accelerometer_scale.ax_error": 0.1, "accelerometer_scale.ay_error": 0.1}
    car = truth.add("accelerometer_scale").with_values(wrong)
    alike = {"accelerometer_scale", "body_attitude", "body_roll", "gyro_scale"}
    others = [e.id for e in catalogue() if e.id not in alike]
    found = improve(start, *drives(car, 51), starts=1, candidates=others, most_effects=2)
    assert found.added
    assert found.omnibus.rejects
    assert found.verdict == "unknown"
    assert all(found.verdicts[a.id].finding == "proxy" for a in found.added)
    assert contradictions(str(found)) == []


@pytest.mark.manual
def test_it_stops_at_the_most_effects_allowed(start: Model, lagging: tuple[Log, Log]) -> None:
    short = [log.between(0.0, 21.0) for log in lagging]
    none = improve(start, *short, starts=1, most_effects=0, exclude=["steer_lag"])
    assert none.added == ()
    assert none.verdict == "unknown"
    assert "steer_lag" not in {c.id for c in none.diagnoses[0].ranking}
    assert "steer_lag" not in {v.effect.id for v in none.verdicts.all}
    for how, words in (
        ({"most_effects": -1}, "most_effects = -1: give a whole number, 0 or more"),
        ({"time_limit_s": 0.0}, "time_limit_s = 0.0: give seconds, above 0"),
        ({"exclude": ["steer_lagg"]}, "steer_lagg"),
    ):
        with pytest.raises(InvalidInput, match=words):
            improve(start, *short, **how)  # type: ignore[arg-type]


def test_several_logs_are_fitted_together(start: Model, lap: Log, course: Log) -> None:
    train = [lap.between(0.0, 10.0), lap.between(20.0, 30.0)]
    found = improve(start, train, [course], starts=1, most_effects=0, sensors=False)
    assert len(found.fit.driving.logs) == 2
    assert set(found.train[0].log_number) == {0.0, 1.0}
    assert set(found.test[0].log_number) == {0.0}


def test_absent_channels_are_among_the_warnings(start: Model, lap: Log, course: Log) -> None:
    train, test = lap.between(0.0, 12.0).without("vy_mps"), course.without("vy_mps")
    with pytest.warns(SysidWarning, match=r"12\.0 s usable .* too short to tell many effects"):
        found = improve(start, train, test, starts=1, most_effects=0, sensors=False)
    assert any("record 20 s or more" in w for w in found.warnings)
    assert [w for w in found.warnings if w.startswith("lap") and train.missing()["vy_mps"] in w]


def test_validation_data_tell_the_richer_model(study: Study, lagging: tuple[Log, Log]) -> None:
    test = set_aside(*lagging)[1]
    poorer, richer = study.fits
    gain = gain_in_log_likelihood(poorer, richer, test)
    assert gain.value > 2.0 * gain.error > 0.0
    assert gain_in_log_likelihood(richer, poorer, test).value == pytest.approx(-gain.value)
    assert gain_in_log_likelihood(richer, richer, test) == Gain(0.0, 0.0, 0.0, 0.0)
    same = gain_in_log_likelihood(poorer, richer, test, same_noise=True)
    assert same.value > 2.0 * same.error > 0.0
    exact = []
    for fit in study.fits:
        noise = fit.noise.elsewhere(fit.model.vehicle)
        exact.append(test.problem(fit.model).freeze(fit.model.vector(), noise.vector()))
    difference = exact[1].log_likelihood - exact[0].log_likelihood
    # The lag is one parameter more that has to be known, and the tyres are hardly in doubt.
    assert difference - 20.0 < gain.value < difference + 5.0


def test_a_model_that_fails_on_validation_data_gains_nothing(fit: Fit, course: Log) -> None:
    test = Driving.of(course)
    broken = Fit(
        fit.model.with_values({"B_front": float("nan")}),
        *(getattr(fit, f) for f in list(Fit.__dataclass_fields__)[1:]),
    )
    assert gain_in_log_likelihood(fit, broken, test).value == -np.inf


def test_what_is_added_lowers_the_error_by_the_richer_models_own_measure(study: Study) -> None:
    baseline, found = study.fits
    assert error_falls(baseline, found, study.validation)
    assert not error_falls(found, baseline, study.validation)
    assert not error_falls(found, found, study.validation)


def test_the_waterfall_falls_at_every_horizon(study: Study) -> None:
    falls = study.waterfall((0.5, 1.0))
    assert falls.steps == ("baseline", "+ steer_lag")
    assert falls.horizons_s == (0.0, 0.5, 1.0)
    assert np.all(falls.test[1] < falls.test[0])
    assert np.all(falls.train[1] < falls.train[0])
    assert falls.test[1, 0] == pytest.approx(study.test[-1].error, rel=0.1)
    assert np.all(np.diff(falls.test[0]) > 0.0)  # the further, the worse
    assert "validation 0.5 s" in str(falls)
    assert "<table" in falls._repr_html_()
    assert falls.plot().get_xlabel() == "predicted ahead"


def test_every_effect_has_a_verdict(study: Study) -> None:
    assert len(study.verdicts.all) == sum(not (e.refines or e.on_request) for e in catalogue())
    assert study.verdicts["steer_lag"].finding in ("missing", "one of a group")
    assert not [v for v in study.verdicts.of("missing") if v.effect.id != "steer_lag"]
    assert study.to_dict()["verdicts"]["steer_lag"]["value"] == [study.added[0].parameters[0].value]
