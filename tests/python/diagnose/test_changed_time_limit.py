"""A comparison that has no time to be finished, and one that does not waste it."""

import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

import sysid_vehicle as sv
from sysid_vehicle.diagnose.change.in_time import InTime
from sysid_vehicle.diagnose.change.may_change import PAYLOAD
from sysid_vehicle.diagnose.change.rivals import idle
from sysid_vehicle.diagnose.change.search import Search
from sysid_vehicle.diagnose.changed import _later
from sysid_vehicle.estimate import Driving

FEW = ("mass", "steer_ratio", "gyro_bias", "aero_drag")
HEAVIER = 0.15


def driven(model: sv.Model, seed: int) -> sv.Log:
    return sv.drive(model, sv.manoeuvres.lap(20.0), seed=seed, rate_hz=25.0)


@pytest.fixture(scope="module")
def car() -> sv.Model:
    return sv.Model(sv.example_vehicle())


@pytest.fixture(scope="module")
def before(car: sv.Model) -> sv.Fit:
    return sv.identify(car, driven(car, 1), starts=1)


@pytest.fixture(scope="module")
def heavier(car: sv.Model) -> sv.Log:
    return driven(car.add("mass").with_values({"mass.relative_error": HEAVIER}), 2)


def test_without_time_nothing_is_named_and_nothing_is_called_unchanged(
    before: sv.Fit, heavier: sv.Log
) -> None:
    with pytest.warns(sv.SysidWarning, match="the time limit ended the comparison: "):
        found = sv.changed(before, heavier, candidates=FEW, time_limit_s=1e-6)
    assert str(found).startswith("no change is shown by what was tried in time")
    assert not found.named
    assert not found.calm
    assert any("mass" in fact and "not tried" in fact for fact in found.late_facts)
    assert any("what the reference lacks" in fact for fact in found.late_facts)
    late = [e for e in found.effects if e.said == "not tried"]
    assert "mass" in {e.id for e in late}
    assert all(e.sentence.startswith("not tried in time") for e in late)
    assert found.to_dict()["late_facts"] == list(found.late_facts)


def test_with_time_enough_a_limit_changes_nothing(before: sv.Fit, heavier: sv.Log) -> None:
    endless = sv.changed(before, heavier, candidates=FEW)
    limited = sv.changed(before, heavier, candidates=FEW, time_limit_s=1e5)
    assert endless.to_dict() == limited.to_dict()
    assert not limited.late_facts
    assert [e.id for e in limited.named] == ["mass"]


def test_what_was_not_tried_in_the_place_of_a_name_stands_in_its_group(
    before: sv.Fit, heavier: sv.Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Time ends after the change has been fitted alone, before its rivals were."""
    whole, visit = InTime.of, Search._visit
    done: list[tuple[str, ...]] = []

    def of(self: InTime, work: Callable[[], Any], otherwise: Any) -> Any:
        return otherwise if ("mass",) in done else whole(self, work, otherwise)

    def noted(self: Search, put: tuple[str, ...], *args: Any) -> None:
        visit(self, put, *args)
        done.append(put)

    monkeypatch.setattr(InTime, "of", of)
    monkeypatch.setattr(Search, "_visit", noted)
    with pytest.warns(sv.SysidWarning, match="not tried"):
        found = sv.changed(before, heavier, time_limit_s=1e5)
    mass = found["mass"]
    assert mass.said == "one of a group"
    assert mass.value[0] == pytest.approx(HEAVIER, abs=3.0 * mass.std[0])
    tried = {e for put in done[: done.index(("mass",)) + 1] for e in put}
    assert set(mass.group) - tried
    assert found.causes.inclusion["mass"] < 0.9


def test_what_the_reference_lacks_has_a_share_of_the_time_alone() -> None:
    """The comparison itself would have none left."""
    whole = InTime(time.perf_counter() + 100.0)
    part = whole.part(0.3)
    assert part.left_s == pytest.approx(30.0, abs=1.0)
    assert whole.left_s == pytest.approx(100.0, abs=1.0)
    assert InTime().part(0.3).left_s is None


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), True])
def test_a_time_limit_is_seconds_above_zero(
    before: sv.Fit, heavier: sv.Log, seconds: float
) -> None:
    with pytest.raises(sv.InvalidInput, match="time_limit_s"):
        sv.changed(before, heavier, time_limit_s=seconds)


def test_an_effect_without_which_all_is_as_likely_has_no_rivals() -> None:
    def state(put: tuple[str, ...], log_likelihood: float) -> Any:
        return SimpleNamespace(put=put, log_likelihood=log_likelihood)

    load, mass, shifted = state(PAYLOAD, 100.0), state(("mass",), 99.0), state(PAYLOAD[:2], 99.5)
    visited = {frozenset(s.put): s for s in (state((), 0.0), load, mass)}
    assert [e for e in PAYLOAD if idle(e, load, visited, 3.0)] == ["cg_position", "yaw_inertia"]
    assert not idle("mass", load, visited | {frozenset(): state((), 99.0)}, 3.0)
    needs = visited | {frozenset({"mass"}): state(("mass",), 50.0)}
    assert not any(idle(e, load, needs, 3.0) for e in PAYLOAD)
    needs |= {frozenset(shifted.put): shifted}
    assert [e for e in PAYLOAD if idle(e, load, needs, 3.0)] == ["yaw_inertia"]


def test_a_load_that_shifts_nothing_is_not_compared_part_by_part(
    before: sv.Fit, heavier: sv.Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rivals of a shift that is not there cost most of the time of a comparison."""
    search = Search(before, _later(before, Driving.of(heavier), None), None, sv.Rules())
    told = search.singles
    load = search.visited[frozenset(PAYLOAD)]
    asked: list[tuple[str, ...]] = []
    monkeypatch.setattr(search, "_visit", lambda put, *_: asked.append(put))
    search._visit_in_place(load, told)
    assert asked
    assert all(put[1:] == PAYLOAD[1:] for put in asked)
