"""What is said of added effects beside what is left."""

import sys
import time
from collections.abc import Callable
from dataclasses import replace

import pytest

from sysid_vehicle import Fit, Log, Model, NumericalError, drive, identify, improve, manoeuvres
from sysid_vehicle._common.threads import check_time
from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import refit
from sysid_vehicle.rules import UNKNOWN, USUAL, Share
from sysid_vehicle.study.ahead import own_share as own
from sysid_vehicle.study.ahead.own_share import alike, own_shares, shares_of_groups, without_idle
from sysid_vehicle.study.improve import _room


def test_what_another_effect_would_do_in_its_place_is_not_its_own(
    truth: Model, start: Model
) -> None:
    """Rolling resistance and a head wind act alike at one speed; a steering lag acts alone."""
    car = truth.add("steer_lag", "rolling_resistance").with_values(
        {"steer_lag.time_constant_s": 0.08, "rolling_resistance.coefficient": 0.03}
    )
    train, test = (drive(car, manoeuvres.lap(30.0), seed=seed, rate_hz=50.0) for seed in (3, 13))
    asked = ("steer_lag", "rolling_resistance", "head_wind")
    model = start.add(*asked)
    found = own_shares(identify(model, train, starts=1), asked, asked, Driving.of(test))
    for alone in found["steer_lag"]:
        assert alone.value > USUAL.taken
        assert alone.low > 0.0
    assert all(shared.value < USUAL.taken for shared in found["head_wind"])


def test_effects_that_copy_each_other_have_a_share_together(truth: Model, start: Model) -> None:
    """At the speeds of one lap a drag and a rolling resistance act alike."""
    hidden = {"aero_drag.drag_area_m2": 0.5, "rolling_resistance.coefficient": 0.012}
    car = truth.add("aero_drag", "rolling_resistance").with_values(hidden)
    train, test = (drive(car, manoeuvres.lap(25.0), seed=seed, rate_hz=50.0) for seed in (3, 13))
    asked = ("aero_drag", "steer_lag", "rolling_resistance")
    fit = identify(start.add(*asked), train, starts=1)
    groups = alike(fit, asked)
    assert groups == (("aero_drag", "rolling_resistance"),)
    assert alike(fit, ("aero_drag", "steer_lag")) == ()
    lean = replace(fit, model=start.add("accelerometer_scale", "body_roll"))
    assert alike(lean, lean.model.effects) == (("accelerometer_scale", "body_roll"),)
    found = shares_of_groups(fit, groups, Driving.of(test))
    alone = own_shares(fit, asked, asked, Driving.of(test))
    for i, together in enumerate(found[groups[0]]):
        assert together.low > USUAL.taken
        assert all(together.value > alone[e][i].value + 0.1 for e in groups[0])


def test_a_group_is_of_those_that_take_a_part_each_where_several_do() -> None:
    some, none = (Share(0.5, 0.2, 0.7),) * 2, (Share(-0.2, -0.4, 0.1),) * 2
    group = ("front_tyre_relaxation", "steer_delay", "tyre_relaxation")
    own = dict(zip(group, (some, none, some), strict=True))
    assert without_idle([group], own) == (("front_tyre_relaxation", "tyre_relaxation"),)
    # What takes a part on some data alone takes none; one alone is no group.
    own["tyre_relaxation"] = (some[0], none[0])
    assert without_idle([group], own) == (group,)
    assert without_idle([group], {}) == (group,)


def test_validation_data_are_asked_only_where_a_name_has_a_share(
    fit: Fit, lap: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Fit] = []
    monkeypatch.setattr(own, "best_within", lambda fit, *_: asked.append(fit) or fit)
    monkeypatch.setattr(own, "counted_in_shares", lambda *_: None)
    needless = refit(fit.model.add("gyro_scale"), fit.driving, fit.noise)
    shares = own_shares(needless, ["gyro_scale"], ["gyro_scale"], Driving.of(lap))
    assert not asked
    assert not shares["gyro_scale"][0].known
    assert abs(shares["gyro_scale"][1].value) < USUAL.taken


def test_a_model_that_cannot_be_fitted_without_an_effect_tells_of_no_share(
    fit: Fit, lap: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> Fit:
        raise NumericalError("lost")

    monkeypatch.setattr(own, "refit", fails)
    richer = replace(fit, model=fit.model.add("gyro_scale"))
    assert own_shares(richer, ["gyro_scale"], ["gyro_scale"], Driving.of(lap)) == {
        "gyro_scale": (UNKNOWN, UNKNOWN)
    }


def test_the_baseline_is_asked_whether_its_errors_matter(
    truth: Model, start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    car = truth.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.08})
    logs = [drive(car, manoeuvres.lap(20.0), seed=seed, rate_hz=50.0) for seed in (71, 72)]
    asked: list[Fit] = []
    module = sys.modules["sysid_vehicle.study.judge.judge"]
    monkeypatch.setattr(module, "sufficient", lambda fit, *_: asked.append(fit))
    study = improve(
        start,
        *logs,
        candidates=["steer_lag"],
        most_effects=1,
        starts=1,
        matters={},
        sensors=False,
    )
    assert [a.id for a in study.added] == ["steer_lag"]
    assert len(asked) == 1
    assert asked[0] is study.fits[0]


@pytest.mark.manual
def test_tyres_that_the_fit_never_saw_do_not_speak_against_the_right_effect(
    start: Model, truth: Model
) -> None:
    """A sine in the linear range is fitted, a lap is validation data."""
    car = truth.add("accelerometer_scale").with_values(
        {"accelerometer_scale.ax_error": 0.05, "accelerometer_scale.ay_error": 0.05}
    )
    study = improve(
        start,
        drive(car, manoeuvres.sine_sweep(), seed=3, rate_hz=50.0),
        drive(car, manoeuvres.lap(30.0), seed=13, rate_hz=50.0),
        candidates=["accelerometer_scale", "gyro_scale", "steer_ratio"],
        starts=2,
    )
    assert [a.id for a in study.added] == ["accelerometer_scale"]
    assert study.test[-1].error > 2.0  # the lap is beyond what the fit knows of the tyres
    # A sine at constant speed tells nothing of the gain along the car.
    assert study.verdict in ("explained", "partly_explained")
    assert [a.grade for a in study.added] == ["confirmed"]
    assert study.omnibus_together is not None
    assert not study.omnibus_together.rejects


def test_short_driving_leaves_room_for_few_effects(lap: Log) -> None:
    assert _room(Driving.of(lap.between(0.0, 8.0)), USUAL) == 1
    assert _room(Driving.of(lap.between(0.0, 3.0)), USUAL) == 1
    assert _room(Driving.of(lap), USUAL) > 4


def test_effects_of_the_model_take_no_room_of_those_that_may_be_added(
    truth: Model, start: Model, altered: Callable[..., Log]
) -> None:
    lagging = truth.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.06})
    logs = [drive(lagging, manoeuvres.lap(20.0), seed=seed, rate_hz=50.0) for seed in (71, 72)]
    turned = [altered(log, yaw_rate_radps=log["yaw_rate_radps"] + 0.01) for log in logs]
    offsets = start.with_nuisances()
    found = improve(
        offsets, *turned, candidates=["steer_lag"], most_effects=1, starts=1, sensors=False
    )
    assert [a.id for a in found.added] == ["steer_lag"]
    assert set(found.model.effects) == {"steer_lag", *offsets.nuisances}
    assert found.verdict == "explained"
    # What is clearly there is told, and nothing else.
    (told,) = (line for line in str(found).splitlines() if "Nuisance" in line)
    assert "gyro_bias (bias of the yaw-rate sensor): bias_radps 0.0" in told
    assert told.strip() in found._repr_html_()


def test_shares_for_which_there_is_no_time_are_left_out(
    fit: Fit, lap: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two effects one is fitted anew in time."""
    clock = [0.0]
    monkeypatch.setattr("time.perf_counter", lambda: clock[0])
    monkeypatch.setattr(own, "in_parallel", lambda work, items: [work(item) for item in items])
    monkeypatch.setattr(own, "own_share", lambda *_, **__: Share(0.5, 0.4, 0.6))

    def slow(model: Model, *_: object) -> Fit:
        clock[0] += 6.0
        check_time()
        return fit

    monkeypatch.setattr(own, "refit", slow)
    both = ["gyro_scale", "gyro_bias"]
    richer = replace(fit, model=fit.model.add(*both))
    asked: list[Fit] = []
    monkeypatch.setattr(own, "best_within", lambda fit, *_: asked.append(fit) or fit)
    monkeypatch.setattr(own, "counted_in_shares", lambda *_: None)
    assert set(own_shares(richer, both, both, Driving.of(lap), 13.0)) == {*both}
    assert asked
    # Without a share of the training data validation data are not asked.
    clock[0] = 0.0
    monkeypatch.setattr(own, "own_share", lambda *_, **__: Share(0.0, -0.1, 0.1))
    again = replace(richer)  # another fit, of which nothing is remembered
    assert set(own_shares(again, both, both, Driving.of(lap), 10.0)) == {"gyro_scale"}
    again = replace(richer)
    assert own_shares(again, both, both, Driving.of(lap), clock[0] - 1.0) == {}


def test_what_the_time_limit_leaves_unknown_is_said(
    truth: Model, start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Something is left beside what was added; there is no time to ask what it takes."""
    car = truth.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.08})
    logs = [drive(car, manoeuvres.lap(20.0), seed=seed, rate_hz=50.0) for seed in (71, 72)]
    module = sys.modules["sysid_vehicle.study.judge.judge"]
    monkeypatch.setattr(module, "incomplete", lambda *_: True)
    monkeypatch.setattr(module, "own_shares", lambda *_: {})
    monkeypatch.setattr(module, "beyond_noise_ahead", lambda *_: never_done())
    clock = [time.perf_counter]

    def never_done() -> None:
        begun = clock[0]()
        monkeypatch.setattr("time.perf_counter", lambda: begun + 1e6)
        try:
            check_time()
        finally:
            monkeypatch.setattr("time.perf_counter", clock[0])

    with pytest.warns(SysidWarning, match="time limit left open"):
        study = improve(
            start,
            *logs,
            candidates=["steer_lag"],
            most_effects=1,
            starts=1,
            time_limit_s=1e5,
            sensors=False,
        )
    assert study.explained is None
    assert [a.id for a in study.added] == ["steer_lag"]
    together, alone = study.late_facts
    assert "together" in together
    assert "steer_lag alone" in alone
    said = f"Warning: the time limit left open {together}; {alone}; without that neither"
    assert [said in line for line in str(study).splitlines() if "time limit left" in line] == [True]


@pytest.mark.manual
@pytest.mark.parametrize("seed", [41, 141])
def test_two_hidden_effects_are_both_found(start: Model, truth: Model, seed: int) -> None:
    """With the first seed a compliance of three standard errors comes before the offset and stays.

    It must not be confirmed.
    """
    hidden = {"aero_drag.drag_area_m2": 0.45, "steer_offset.offset_rad": 0.006}
    car = truth.add("aero_drag", "steer_offset").with_values(hidden)
    course = manoeuvres.handling_course(30.0, lateral_mps2=7.5)
    train = drive(car, manoeuvres.lap(30.0), seed=seed, rate_hz=50.0)
    found = improve(start, train, drive(car, course, seed=seed + 1, rate_hz=50.0), starts=1)
    assert found.verdict == "explained"
    grades = {a.id: a.grade for a in found.added}
    assert grades.pop("steer_offset") == "confirmed"
    grades.pop("aero_drag")
    assert grades == ({"steer_compliance": "plausible"} if seed == 41 else {})
    errors = [c.error for c in found.test]
    assert errors == sorted(errors, reverse=True)
    for name, value in hidden.items():
        assert abs(found.fit[name].value - value) < 4.0 * found.fit[name].std
