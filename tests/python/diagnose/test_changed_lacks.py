"""What the reference lacks is put into its model before a change is named."""

import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from sysid_vehicle import Model, changed, drive, effect, identify, manoeuvres
from sysid_vehicle.diagnose.change.saying import Saying
from sysid_vehicle.effects import Effect
from sysid_vehicle.rules import USUAL

DOWNFORCE = "aero_downforce"


def said(found: float) -> Any:
    """Of a driving whose changes explain so many nats; downforce in both the same explains 616."""
    aero = SimpleNamespace(put=(DOWNFORCE,), log_likelihood=626.0, reached=10.0)
    nothing = SimpleNamespace(put=(), reached=0.0)
    said = cast(Any, Saying.__new__(Saying))
    said.search = SimpleNamespace(
        visited={frozenset(): nothing, frozenset({DOWNFORCE}): aero},
        reference=SimpleNamespace(effects=(effect("steer_lag"), effect(DOWNFORCE))),
    )
    said.told = SimpleNamespace(ratio_of=lambda _: 2.0, price=lambda *_: 14.0)
    said.state = SimpleNamespace(among=found)
    return said


def test_what_is_lacked_explains_more_than_what_seems_to_have_changed() -> None:
    lack = said(47.0).lack()
    assert lack is not None
    assert lack.id == DOWNFORCE
    assert said(700.0).lack() is None
    little = said(5.0)
    little.search.visited[frozenset({DOWNFORCE})].log_likelihood = 30.0
    assert little.lack() is None  # no more than its price


@pytest.mark.parametrize("calm", [False, True])
def test_it_is_put_into_the_model_of_the_reference(
    truth: Model, start: Model, monkeypatch: pytest.MonkeyPatch, calm: bool
) -> None:
    """Once, and where something seems to have changed."""
    before = identify(start, drive(truth, manoeuvres.lap(10.0), seed=3, rate_hz=50.0), starts=1)
    (log,) = before.driving.logs
    found = changed(before, log, candidates=("steer_ratio",))
    row = replace(found["steer_ratio"], said="not testable" if calm else "likely", probability=0.6)
    asked: list[tuple[str, ...]] = []

    class Lacking(Saying):
        def __init__(self, search: Any) -> None:
            asked.append(search.before.model.effects)

        def change(self) -> Any:
            return replace(found, effects=(row,))

        def lack(self) -> Effect | None:
            return effect(DOWNFORCE) if len(asked) < 2 else None

    monkeypatch.setattr(sys.modules[changed.__module__], "Saying", Lacking)
    change = changed(before, log, candidates=("steer_ratio",))
    assert asked == ([()] if calm else [(), (DOWNFORCE,)])
    assert change.lacks == (() if calm else (DOWNFORCE,))
    assert change.to_dict()["lacks"] == list(change.lacks)
    assert (f"the reference lacks {DOWNFORCE}, in both drivings" in str(change)) is not calm


def test_a_rival_that_is_nothing_beside_an_effect_does_not_take_its_place() -> None:
    """Its likelihood gains by what the reference lacks."""
    both = frozenset({"tyre_front", "steer_compliance"})
    said = cast(Any, Saying.__new__(Saying))
    said.search = SimpleNamespace(
        visited={both: SimpleNamespace(put=tuple(both))}, told=lambda _: None, rules=USUAL
    )
    state = cast(Any, SimpleNamespace(put=("tyre_front",)))
    for nothing, first in (({"steer_compliance"}, "tyre_front"), (set(both), "steer_compliance")):
        said._off_nothing = lambda e, *_, nothing=nothing: e not in nothing
        odds = {"tyre_front": 0.0, "steer_compliance": 24.0}
        assert said._told_apart("tyre_front", odds, state).effects == (first,)
