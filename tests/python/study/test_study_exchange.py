"""What is tried in place of an effect of the model."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sysid_vehicle import Model, catalogue, diagnose, drive, identify, improve, manoeuvres
from sysid_vehicle.diagnose import Candidate
from sysid_vehicle.effects import effect
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import refine
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study.search.steps import _with_others, exchanged, in_common

NO_TEST: Any = None


def test_an_effect_that_was_tried_against_the_same_ones_is_not_refitted(
    start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    driving = SimpleNamespace(samples=1000)
    tried: Any = SimpleNamespace(model=start.add("aero_drag"), driving=driving)
    windy = windy_fit(start, driving)
    refined = SimpleNamespace(log_likelihood=0.0)
    names = {"refine_beside": lambda *_: refined, "without_insignificant": lambda fit, _: fit}
    for name, stand_in in names.items():
        monkeypatch.setitem(_with_others.__globals__, name, stand_in)
    drag = Candidate(
        effect("aero_drag"), 9.0, 0.0, (0.6,), (0.1,), 1.0, 1.0, fit=tried, finished=True
    )
    assert _with_others(windy, "head_wind", (drag,), NO_TEST, USUAL) is tried
    elsewhere: Any = SimpleNamespace(model=tried.model, driving=object())
    beside: Any = SimpleNamespace(model=tried.model.add("rolling_resistance"), driving=driving)
    for other in (
        replace(drag, finished=False),
        replace(drag, fit=elsewhere),
        replace(drag, fit=beside),
    ):
        assert _with_others(windy, "head_wind", (other,), NO_TEST, USUAL) is refined


def windy_fit(start: Model, driving: object) -> Any:
    """A fit with a wind, of a log-likelihood of nothing."""
    model = start.add("head_wind")
    wind = [SimpleNamespace(name=n) for n in model.parameters if n.startswith("head_wind.")]
    return SimpleNamespace(
        model=model, driving=driving, noise=None, log_likelihood=0.0, estimates=wind
    )


@pytest.mark.parametrize(("below", "simpler"), [(10.0, True), (40.0, False)])
def test_a_trial_far_below_is_not_made_simpler(
    start: Model, monkeypatch: pytest.MonkeyPatch, below: float, simpler: bool
) -> None:
    """Twenty nats, and the price of the wind, are more than a simpler model gains."""
    asked, told = [], {}

    def refining(_: object, __: object, ___: object, least: float, ____: object) -> Any:
        told["least"] = least
        return SimpleNamespace(log_likelihood=-below)

    def simplified(fit: Any, _: object) -> Any:
        asked.append(fit)
        return fit

    monkeypatch.setitem(_with_others.__globals__, "refine_beside", refining)
    monkeypatch.setitem(_with_others.__globals__, "without_insignificant", simplified)
    drag = Candidate(effect("aero_drag"), 9.0, 0.0, (0.6,), (0.1,), 1.0, 1.0)
    windy = windy_fit(start, SimpleNamespace(samples=1000))
    found = _with_others(windy, "head_wind", (drag,), NO_TEST, USUAL)
    assert found is not None
    assert found.log_likelihood == -below
    price = 0.5 * len(windy.estimates) * np.log(1000.0)
    assert told["least"] == pytest.approx(-price)
    assert bool(asked) == simpler


@pytest.mark.parametrize(("ahead", "goes_on"), [(-15.0, True), (-30.0, False)])
def test_what_lies_far_behind_by_all_data_is_not_searched_to_its_end(
    start: Model, monkeypatch: pytest.MonkeyPatch, ahead: float, goes_on: bool
) -> None:
    drag = Candidate(effect("aero_drag"), 9.0, 0.0, (0.6,), (0.1,), 1.0, 1.0)
    windy = windy_fit(start, SimpleNamespace(samples=1000))
    near, asked = SimpleNamespace(log_likelihood=0.0), []

    def refining(*given: Any) -> Any:
        return near if given[-1](near) else None

    def lead(*of: object) -> float:
        asked.append(of)
        return ahead

    names = {"refine_beside": refining, "lead": lead, "without_insignificant": lambda fit, _: fit}
    for name, stand_in in names.items():
        monkeypatch.setitem(_with_others.__globals__, name, stand_in)
    found = _with_others(windy, "head_wind", (drag,), NO_TEST, USUAL)
    assert found is (near if goes_on else None)
    assert asked == [(near, windy, NO_TEST)]


def test_two_that_are_confounded_are_tried_against_what_they_have_in_common(
    start: Model, truth: Model
) -> None:
    """All motion read elsewhere, and the speed where it was, are an accelerometer elsewhere."""
    car = truth.add("imu_lever_arm").with_values({"imu_lever_arm.forward_m": 0.5})
    train, test = (drive(car, manoeuvres.lap(15.0), seed=s, rate_hz=50.0) for s in (71, 72))
    baseline = identify(start, train, starts=1)
    ranking = diagnose(baseline, candidates=["imu_lever_arm", "cg_position"], refits=0).ranking
    two = ("ins_lever_arm", "speed_sensor_lever_arm")
    both = baseline.model.add(*two).with_values(
        {"ins_lever_arm.forward_m": 0.5, "speed_sensor_lever_arm.forward_m": -0.5}
    )
    fit = refine(both, baseline.driving, baseline.noise)
    near = in_common(fit, two[:1], ranking)
    assert {name: {c.id for c in some} for name, some in near.items()} == {
        name: {"imu_lever_arm", "cg_position"} for name in two
    }
    assert in_common(fit, ("mass",), ranking) == {}
    found = exchanged(fit, near, Driving.of(test), most_effects=4)
    assert found.model.effects == ("imu_lever_arm",)
    assert exchanged(fit, {}, Driving.of(test), most_effects=4) is fit


def test_what_was_not_searched_to_its_end_is_before_it_takes_a_place(
    start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A trial far below in training data may be what validation data are for all the same."""
    driving = SimpleNamespace(samples=1000)
    windy = windy_fit(start, driving)
    drag = Candidate(effect("aero_drag"), 9.0, 0.0, (0.6,), (0.1,), 1.0, 1.0)
    ended = SimpleNamespace(**{**vars(windy_fit(start, driving)), "model": start.add("aero_drag")})
    begun = SimpleNamespace(**{**vars(ended), "converged": False})
    names = {
        "_with_others": lambda *_: begun,
        "better": lambda *_: True,
        "refine": lambda *_: ended,
        "without_insignificant": lambda fit, _: fit,
    }
    for name, stand_in in names.items():
        monkeypatch.setitem(exchanged.__globals__, name, stand_in)
    nearly = {"head_wind": (drag,)}
    assert exchanged(windy, nearly, driving, most_effects=4) is ended  # type: ignore[arg-type]
    begun.converged = True
    assert exchanged(windy, nearly, driving, most_effects=4) is begun  # type: ignore[arg-type]


def test_a_body_that_rolls_late_takes_the_place_of_one_that_leans(
    truth: Model, start: Model
) -> None:
    """It is a candidate only beside what it refines, which is needless then."""
    hidden = {"body_roll.roll_per_g_rad": 0.05, "body_roll.frequency_hz": 2.0}
    car = truth.add("body_roll").with_values(hidden)
    train = drive(car, manoeuvres.lap(20.0), seed=5552)
    test = drive(car, manoeuvres.handling_course(20.0), seed=6552)
    near = {"body_attitude", "body_roll", "imu_lever_arm", "accelerometer_scale", "road_bank"}
    others = [e.id for e in catalogue() if e.id not in near]
    study = improve(start, train, test, seed=1, starts=1, exclude=others, sensors=False)
    assert [e.id for e in study.added] == ["body_roll"]
    assert study.verdicts["body_roll"].finding == "missing"
    assert study.verdict == "explained"
    for name, value in hidden.items():
        assert abs(study.fit[name].value - value) < 3.0 * study.fit[name].std
