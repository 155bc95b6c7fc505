"""One step of the way: what stands in for others is exchanged, what is not needed is dropped."""

from dataclasses import replace

import pytest

from sysid_vehicle import Diagnosis, Fit, Model, diagnose, drive, identify, manoeuvres
from sysid_vehicle.diagnose import possible
from sysid_vehicle.effects import effect
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import Estimate
from sysid_vehicle.study.steps import (
    _distance,
    alternatives,
    exchanged,
    first_that_holds,
    way,
    without_idle,
)

AGAINST = ["aero_drag", "rolling_resistance", "head_wind"]
HIDDEN = {"aero_drag.drag_area_m2": 0.6, "rolling_resistance.coefficient": 0.012}


@pytest.fixture(scope="module")
def driving(truth: Model) -> tuple[Driving, Driving]:
    car = truth.add("aero_drag", "rolling_resistance").with_values(HIDDEN)
    train = drive(car, manoeuvres.lap(30.0), seed=61)
    test = drive(car, manoeuvres.handling_course(30.0, lateral_mps2=7.5), seed=62)
    return Driving.of(train), Driving.of(test)


@pytest.fixture(scope="module")
def baseline(start: Model, driving: tuple[Driving, Driving]) -> Fit:
    return identify(start, driving[0], starts=1)


@pytest.fixture(scope="module")
def dx(baseline: Fit) -> Diagnosis:
    return diagnose(baseline, candidates=AGAINST)


def by_id(dx: Diagnosis, name: str) -> Fit:
    (found,) = (c.fit for c in dx.ranking if c.id == name)
    assert found is not None
    return found


def test_a_head_wind_gives_way_to_drag_and_rolling_resistance(
    dx: Diagnosis, driving: tuple[Driving, Driving]
) -> None:
    (wind,) = (c for c in dx.ranking if c.id == "head_wind")
    near = alternatives(dx, wind)
    assert {c.id for c in near} == {"aero_drag", "rolling_resistance"}
    windy = by_id(dx, "head_wind")
    found = exchanged(windy, {"head_wind": near}, driving[1], most_effects=4)
    assert set(found.model.effects) == {"aero_drag", "rolling_resistance"}
    assert found.log_likelihood > windy.log_likelihood
    one = exchanged(windy, {"head_wind": near}, driving[1], most_effects=1)
    assert len(one.model.effects) == 1
    assert exchanged(windy, {}, driving[1], most_effects=4) is windy


def test_the_story_leads_over_every_effect_of_its_end(
    dx: Diagnosis, baseline: Fit, driving: tuple[Driving, Driving]
) -> None:
    (wind,) = (c for c in dx.ranking if c.id == "head_wind")
    windy = by_id(dx, "head_wind")
    final = exchanged(windy, {"head_wind": alternatives(dx, wind)}, driving[1], most_effects=4)
    story = way([baseline, windy, final])
    assert story[0] is baseline
    assert story[-1] is final
    assert [len(f.model.effects) for f in story] == [0, 1, 2]
    assert "head_wind" not in story[1].model.effects
    assert way([baseline]) == [baseline]


def test_what_is_not_there_is_dropped_and_what_is_needed_stays(dx: Diagnosis) -> None:
    fit = by_id(dx, "aero_drag")
    assert without_idle(fit).model.effects == ("aero_drag",)
    model = fit.model.add("steer_offset")
    idle = identify(model, fit.driving, starts=1)
    assert without_idle(idle).model.effects == ("aero_drag",)


def test_at_its_null_value_a_bound_is_nothing() -> None:
    drag, speed = effect("aero_drag").parameters[0], effect("rolling_resistance").parameters[1]
    inf = float("inf")
    assert _distance(Estimate("a", 0.0, inf, "s/m", "at bound"), speed) == 0.0
    assert _distance(Estimate("a", speed.upper, inf, "s/m", "at bound"), speed) == inf
    assert _distance(Estimate("a", 0.3, 0.1, "m2", ""), drag) == pytest.approx(3.0)


def test_a_possible_value_comes_before_an_impossible_one(
    dx: Diagnosis, baseline: Fit, driving: tuple[Driving, Driving]
) -> None:
    (drag,) = (c for c in dx.ranking if c.id == "aero_drag")
    far = replace(drag, value=(drag.effect.parameters[0].upper,), std=(float("inf"),))
    assert not possible(far.effect, far.value, far.std)
    others = tuple(c for c in dx.ranking if c.id != "aero_drag" and c.fit is not None)
    chosen = first_that_holds(replace(dx, ranking=(far, *others)), baseline, driving[1])
    assert chosen is not None
    assert chosen.id != "aero_drag"
    alone = first_that_holds(replace(dx, ranking=(far,)), baseline, driving[1])
    assert alone is far


def test_a_search_that_ends_at_its_bound_wanted_more_than_any_car_has() -> None:
    rolling = effect("rolling_resistance")
    most = [p.upper for p in rolling.parameters]
    inf = float("inf")
    assert possible(rolling, (0.012, 0.0), (0.001, inf))  # nothing is a bound, and possible
    assert not possible(rolling, (0.012, most[1]), (0.001, inf))
    assert possible(rolling, (0.012, 0.5 * most[1]), (0.001, inf))  # not told, but not at a bound
    assert not possible(rolling, (-0.02, 0.0), (0.001, 0.001))
