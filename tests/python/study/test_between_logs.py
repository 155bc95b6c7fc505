"""Training logs of a car that was not the same in all of them."""

import importlib
from dataclasses import replace

import pytest

from sysid_vehicle import (
    Fit,
    Log,
    Model,
    SysidWarning,
    drive,
    identify,
    improve,
    manoeuvres,
)
from sysid_vehicle.identify import refine
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study.judge import between_logs
from sysid_vehicle.study.judge.between_logs import no_effect_but_the_log, told_differently
from sysid_vehicle.study.judge.one_for_all import OneForAll, one_for_all
from sysid_vehicle.study.results.added import AddedEffect
from sysid_vehicle.study.search.steps import merit


def laps(*cars: Model, duration_s: float = 30.0) -> list[Log]:
    """Laps, each by another car."""
    lap = manoeuvres.lap(duration_s)
    return [
        drive(car, lap, seed=662900 + i, rate_hz=25.0, name=f"set {i + 1}")
        for i, car in enumerate(cars)
    ]


@pytest.fixture(scope="module")
def softer(truth: Model) -> Model:
    """The same car on front tyres 25 % softer."""
    car = truth.vehicle
    front = replace(car.tyre_front, B=0.75 * car.tyre_front.B)
    return Model(car.replace(tyre_front=front))


@pytest.fixture(scope="module")
def two_sets(start: Model, truth: Model, softer: Model) -> Fit:
    return identify(start, laps(truth, softer), starts=1)


@pytest.fixture(scope="module")
def one_set(start: Model, truth: Model) -> Fit:
    return identify(start, laps(truth, truth), starts=1)


def test_other_tyres_in_one_of_the_logs_are_told(two_sets: Fit, one_set: Fit) -> None:
    (first, *_) = told_differently(two_sets)
    assert first.startswith("cornering stiffness front ")
    assert " N/rad from set 1, " in first
    assert first.endswith(" from set 2")
    assert told_differently(one_set) == []


def test_what_an_effect_of_the_log_stands_in_for_is_told(two_sets: Fit) -> None:
    heat = two_sets.model.add("tyre_temperature")
    final = refine(heat, two_sets.driving, two_sets.noise)
    assert final.log_likelihood > two_sets.log_likelihood + 50.0
    said, effect = one_for_all(two_sets, final, ("tyre_temperature",), (), USUAL)
    assert effect == ""
    assert said.startswith("tyre_temperature may be what differs between the training logs")
    assert "(cornering stiffness front " in said


def test_tyres_of_their_own_have_to_be_worth_their_price(
    two_sets: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What differs between the logs is there, and explains less than the effect does."""
    heat = two_sets.model.add("tyre_temperature")
    final = refine(heat, two_sets.driving, two_sets.noise)
    apart = between_logs.by_log(two_sets)
    sums = sum(map(merit, apart))
    assert between_logs.differing(apart)
    for ahead, said in ((1.0, False), (-1.0, True)):
        of = {id(final): sums + ahead, id(two_sets): sums + ahead}
        monkeypatch.setattr(between_logs, "merit", lambda fit, of=of: of.get(id(fit), merit(fit)))
        assert (no_effect_but_the_log(two_sets, final, ("tyre_temperature",)) != "") is said
        assert (told_differently(two_sets) != []) is said


def test_an_effect_that_acts_in_each_log_is_none_of_them(start: Model, truth: Model) -> None:
    lagging = truth.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.06})
    fit = identify(start, laps(lagging, lagging), starts=1)
    final = refine(fit.model.add("steer_lag"), fit.driving, fit.noise)
    assert no_effect_but_the_log(fit, final, ("steer_lag",)) == ""
    assert told_differently(final) == []


def test_short_logs_and_single_ones_tell_no_car(start: Model, truth: Model, softer: Model) -> None:
    pieces = [log.between(0.0, 12.0) for log in laps(truth, softer)]
    assert told_differently(identify(start, pieces, starts=1)) == []
    assert told_differently(identify(start, laps(truth), starts=1)) == []


def test_what_a_simpler_reason_explains_is_not_confirmed(
    start: Model, truth: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    lagging = truth.add("steer_lag").with_values({"steer_lag.time_constant_s": 0.06})
    train, test = laps(lagging, lagging, duration_s=21.0)

    def added() -> AddedEffect:
        study = improve(start, train, test, starts=1, candidates=["steer_lag"], sensors=False)
        (lag,) = study.added
        return lag

    assert added().grade == "confirmed"
    judge = importlib.import_module("sysid_vehicle.study.judge.judge")
    monkeypatch.setattr(judge, "one_for_all", lambda *_: OneForAll("steer_lag may be a mistake"))
    with pytest.warns(SysidWarning, match="steer_lag may be a mistake"):
        assert added().grade == "plausible"
