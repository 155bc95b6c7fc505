"""What the reference lacks is put into its model before a change is named."""

import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sysid_vehicle import Model, changed, drive, effect, identify, manoeuvres
from sysid_vehicle.diagnose.change.may_change import of_effect
from sysid_vehicle.diagnose.change.pieces import Alike, Pieces
from sysid_vehicle.diagnose.change.reference import Exact, Reference
from sysid_vehicle.diagnose.change.saying import Saying
from sysid_vehicle.diagnose.change.search import Search
from sysid_vehicle.effects import Effect
from sysid_vehicle.estimate import Driving
from sysid_vehicle.rules import USUAL

DOWNFORCE = "aero_downforce"


def fitted(truth: Model, start: Model, of: str, before: float, after: float) -> tuple[Exact, Exact]:
    """Nothing, and a change of an effect, where it has these sizes in the two drives."""
    known = effect(of)
    (name,), (p,) = known.named, known.parameters
    logs = []
    for seed, size in ((41, before), (42, after)):
        car = truth.add(known).with_values({name: size})
        logs.append(drive(car, manoeuvres.lap(15.0), seed=seed, rate_hz=50.0))
    reference = identify(start, logs[0], starts=1)
    later = replace(reference, driving=Driving.of(logs[1]), estimates=())
    later = replace(later, covariance=np.zeros((0, 0)), pushed=np.zeros((0, 0)))
    both = Reference(reference, [of_effect(known)], [known])
    nothing = both.fitted(later, (), {}, {})
    return nothing, both.fitted(later, (of,), {name: 0.0}, {name: p.typical})


def test_half_of_a_large_change_is_no_lack_of_the_reference(truth: Model, start: Model) -> None:
    """Put into both drives it gains far more than any lack does."""
    nothing, changed = fitted(truth, start, "mass", 0.0, 0.17)
    gain = changed.log_likelihood - nothing.log_likelihood
    assert changed.reached - nothing.reached < 0.9 * gain
    assert changed.among - nothing.among > 0.999 * gain


def test_a_lack_of_the_reference_is_no_change(truth: Model, start: Model) -> None:
    nothing, changed = fitted(truth, start, "tyre_relaxation", 0.4, 0.4)
    gain = changed.log_likelihood - nothing.log_likelihood
    assert gain > 20.0
    assert changed.among - nothing.among < 5.0


def test_what_the_reference_alone_shows_to_be_missing_is_put_in(truth: Model) -> None:
    """Though the change explains far more: beside it a delay was known four times worse."""
    car = truth.add("steer_compliance").with_values({"steer_compliance.compliance_radpn": 1.5e-6})
    late = car.add("steer_delay").with_values({"steer_delay.delay_s": 0.05})
    course = manoeuvres.handling_course(20.0, lateral_mps2=7.5)
    first, second = (
        drive(c, course, seed=seed, rate_hz=50.0) for c, seed in ((car, 245601), (late, 245701))
    )
    few = ("steer_delay", "steer_lag", "steer_compliance")
    change = changed(identify(truth, first, starts=1), second, candidates=few)
    assert change.lacks == ("steer_compliance",)
    assert next(e.id for e in change.named) == "steer_delay"
    assert change["steer_delay"].std[0] < 0.002
    assert abs(change["steer_delay"].value[0] - 0.05) < 3.0 * change["steer_delay"].std[0]


@pytest.mark.filterwarnings("ignore:lap is of the reference")  # enough for what is asked here
@pytest.mark.parametrize(("nothing", "beyond"), [(0.0, 0.0), (0.5, 0.0), (0.0, 1.0), (0.5, 1.0)])
def test_it_is_asked_for_before_the_search(
    truth: Model, start: Model, monkeypatch: pytest.MonkeyPatch, nothing: float, beyond: float
) -> None:
    """Beside what is lacked the search goes astray; in other driving if something changed."""
    before = identify(start, drive(truth, manoeuvres.lap(10.0), seed=3, rate_hz=50.0), starts=1)
    module, asked = sys.modules[changed.__module__], []

    def shows(search: Search, *_: object) -> Effect | None:
        effects = search.before.model.effects
        asked.append(f"alone {effects}")
        return None if effects else effect(DOWNFORCE)

    class Asked(Saying):
        def __init__(self, search: Search) -> None:
            asked.append(f"search {search.before.model.effects}")
            super().__init__(search)

    monkeypatch.setattr(Search, "nothing", lambda *_: nothing)
    monkeypatch.setattr(Pieces, "alike", lambda *_: Alike(beyond, 0.0))
    monkeypatch.setattr(module, "_named_in", shows)
    monkeypatch.setattr(module, "Saying", Asked)
    change = changed(before, before.driving.logs[0], candidates=("steer_ratio",))
    full = (DOWNFORCE,)
    told = [f"alone {()}", f"alone {full}", f"search {full}"]
    left = nothing > 0.0 and beyond > 0.0
    assert asked == ([f"search {()}"] if left else told)
    assert change.lacks == (() if left else full)


@pytest.mark.filterwarnings("ignore:lap is of the reference")  # enough for what is asked here
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
        assert said._told_apart("tyre_front", odds, state, 1.0).effects == (first,)


@pytest.mark.parametrize("gain", [1.0, 30.0])
def test_where_the_likelihood_does_as_well_without_an_effect_its_rival_stays(gain: float) -> None:
    """Of a lag and a delay that do the same, lines lean to the one that filters noise of inputs."""
    put = {("steer_lag", "steer_delay"): gain, ("steer_delay",): 0.0}
    said = cast(Any, Saying.__new__(Saying))
    visited = {frozenset(p): SimpleNamespace(log_likelihood=v) for p, v in put.items()}
    said.search = SimpleNamespace(visited=visited, told=lambda _: None, rules=USUAL)
    said._off_nothing = lambda e, *_: e == "steer_lag"
    state = cast(Any, SimpleNamespace(put=("steer_lag",)))
    found = said._told_apart("steer_lag", {"steer_lag": 0.0, "steer_delay": -0.3}, state, 3.0)
    assert ("steer_delay" in found.effects) is (gain < 3.0 * USUAL.told)
