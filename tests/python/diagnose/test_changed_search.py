"""What is named of what may have changed: likelihoods of what was fitted decide."""

from types import SimpleNamespace

import pytest

from sysid_vehicle.diagnose.candidates.causes import CredibleSet
from sysid_vehicle.diagnose.change.both_axles import FRICTION, STIFFNESS, by_other_names, hold_tyres
from sysid_vehicle.diagnose.change.rivals import in_place
from sysid_vehicle.diagnose.change.saying import Saying
from sysid_vehicle.diagnose.change.search import Search
from sysid_vehicle.errors import NumericalError
from sysid_vehicle.rules import USUAL


class Told:
    """What lines tell of a state: p-values of its changes."""

    def __init__(self, put: tuple[str, ...], p_values: dict[str, float]) -> None:
        self.put, self._p_values = put, p_values

    def ratio_of(self, _: tuple[str, ...]) -> float:
        return 1.0

    def off_nothing(self, effects: tuple[str, ...], _: object) -> float:
        (effect,) = effects
        return self._p_values[effect]


def searching(
    monkeypatch: pytest.MonkeyPatch,
    lines: dict[str, float],
    evidence: dict[tuple[str, ...], float],
) -> Search:
    """A search that has visited all of the evidence, and climbed where there are several."""
    search = Search.__new__(Search)
    search.rules, search.tyres, search.failed = USUAL, (), set()
    search.can = {e: SimpleNamespace(usual={}) for e in lines}  # type: ignore[misc]
    search.visited = {
        frozenset(p): SimpleNamespace(put=p, changes={}, among=0.0, climbed=len(p) > 1)  # type: ignore[misc]
        for p in evidence
    }
    search.start = None  # type: ignore[assignment]
    search.reference = SimpleNamespace(  # type: ignore[assignment]
        climbed=lambda _, s: SimpleNamespace(put=s.put, changes={}, climbed=True),
        nothing=search.visited[frozenset()],
    )
    monkeypatch.setattr(search, "told", lambda state: Told(state.put, lines))
    monkeypatch.setattr(search, "_leading", lambda _, state: state.put)
    monkeypatch.setattr(search, "_visit_in_place", lambda *_: None)
    monkeypatch.setattr(search, "evidence", lambda state, *_: evidence[state.put])
    return search


def test_what_is_named_was_put_in_and_is_off_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A likelier rival takes the place of what was put in; what no line tells goes."""
    lines = {"steer_lag": 1e-9, "steer_delay": 1e-9, "mass": 0.3}
    begun, rival = ("steer_lag", "mass"), ("steer_delay", "mass")
    evidence = {(): -9.0, begun: -2.0, rival: -2.0, ("steer_delay",): -1.0}
    search = searching(monkeypatch, lines, evidence)
    likelier = search.visited[frozenset(rival)]
    monkeypatch.setattr(
        search, "_better", lambda state, _: likelier if state.put == begun else state
    )
    told, state = search._settled(Told(begun, lines), search.visited[frozenset(begun)])
    assert state.put == told.put == ("steer_delay",)
    # Nothing at all is judged at its maximum; so is what is named.
    assert state.climbed
    assert search.visited[frozenset(state.put)] is state


def test_of_several_that_no_line_tells_what_is_missed_least_goes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Beside its stand-ins a tyre that changed is known to no one: they go, and lines tell it."""
    tyre, other = ("tyre_front",), ("lateral_load_transfer",)
    both = tyre + other
    evidence = {(): -900.0, both: 9.0, tyre: 7.0, other: -400.0}
    search = searching(monkeypatch, dict.fromkeys(both, 0.5), evidence)
    known = {both: dict.fromkeys(both, 0.5), tyre: {"tyre_front": 1e-9}}
    known[both]["tyre_front"] = 0.9
    monkeypatch.setattr(search, "told", lambda state: Told(state.put, known[state.put]))
    told, state = search._shown(Told(both, known[both]), search.visited[frozenset(both)])
    assert state.put == told.put == tyre


def test_what_is_not_worth_its_price_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a small variance ratio it was put in; that of all together is what counts in the end."""
    lines = dict.fromkeys(("steer_delay", "mass", "yaw_inertia"), 1e-9)
    every = ("steer_delay", "mass", "yaw_inertia")
    evidence = {(): 0.0, ("steer_delay",): 9.0, every[:2]: 8.0, every: 4.0, ("steer_lag",): 12.0}
    search = searching(monkeypatch, lines, evidence)
    told, state = search.worth_their_price(Told(every, lines), search.visited[frozenset(every)])
    # No part of what was put in is a rival.
    assert state.put == told.put == ("steer_delay",)
    assert state.climbed


def test_what_is_named_is_likelier_than_all_that_was_fitted_without_it() -> None:
    """Of a load each part was put in with the others: that something is there shows none of it."""
    put = ("mass", "cg_position", "yaw_inertia", "steer_compliance")
    rival = ("mass", "tyre_front", "yaw_inertia", "steer_compliance")
    evidence = {put: 0.0, ("tyre_front",): -9.0, rival: -1.0, ("imu_lever_arm", "mass"): 1.0}

    def named(nothing: float) -> bool:
        told = evidence | {(): nothing}
        states = {p: SimpleNamespace(put=p, climbed=p != ("imu_lever_arm", "mass")) for p in told}
        search = Search.__new__(Search)
        search.rules, search.tyres = USUAL, ()
        search.visited = {frozenset(p): s for p, s in states.items()}  # type: ignore[misc]
        search.evidence = lambda state, *_: told[state.put]  # type: ignore[method-assign, assignment]
        search.over_nothing = lambda *_: -nothing  # type: ignore[method-assign]
        search.odds = lambda *_: {"cg_position": 0.0}  # type: ignore[method-assign, assignment]
        said = Saying.__new__(Saying)
        said.search = search
        said._off_nothing = lambda *_: True  # type: ignore[method-assign, assignment]
        lines = SimpleNamespace(causes=SimpleNamespace(of=lambda _: None))
        return said._exact("cg_position", states[put], lines, 1.0) is not None  # type: ignore[arg-type]

    assert named(-9.0)
    assert not named(8.0)
    assert not named(-2.0)


def test_a_group_is_off_nothing_where_one_of_it_is() -> None:
    """A lag may explain as much as the delay that changed, and be known far less closely."""
    states = {p: SimpleNamespace(put=p, climbed=True) for p in ((), ("lag",), ("delay",))}

    def named(*closely_known: str) -> tuple[str, ...]:
        search = Search.__new__(Search)
        search.rules, search.tyres = USUAL, ()
        search.visited = {frozenset(p): s for p, s in states.items()}  # type: ignore[misc]
        search.evidence = lambda state, *_: 0.0  # type: ignore[method-assign]
        search.over_nothing = lambda *_: 9.0  # type: ignore[method-assign]
        search.odds = lambda *_: {"lag": 0.0, "delay": -0.4}  # type: ignore[method-assign]
        search.told = lambda state: lines  # type: ignore[method-assign, assignment, return-value]
        said = Saying.__new__(Saying)
        said.search = search
        said._off_nothing = lambda effect, *_: effect in closely_known  # type: ignore[method-assign]
        lines = SimpleNamespace(causes=SimpleNamespace(of=lambda _: None))
        found = said._exact("lag", states["lag",], lines, 1.0)  # type: ignore[arg-type]
        return () if found is None else found.effects

    assert named("lag", "delay") == ("lag", "delay")
    assert named("delay") == ("lag", "delay")
    assert not named()


def test_of_two_changes_each_leads_to_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """What imitates both is likelier than either: from there lines lead to neither."""
    imitator, one, other = ("force_gain",), ("mass",), ("aero_drag",)
    put = {(): 0.0, imitator: 90.0, one: 60.0, other: 20.0}
    lines = dict.fromkeys(("force_gain", "mass", "aero_drag", "road_grade"), 1e-9)
    goes_with = {
        "force_gain": {"road_grade": 4.0, "clock of fx_n": 9.0},
        "mass": {"aero_drag": 9.0},
    }
    search = searching(monkeypatch, lines, put)
    for m in search.can.values():
        m.names = ()  # type: ignore[misc]
    tried: list[frozenset[str]] = []
    monkeypatch.setattr(search, "_visit", lambda few, *_: tried.append(frozenset(few)))
    monkeypatch.setattr(
        search,
        "told",
        lambda state: SimpleNamespace(beside_put=goes_with.get(state.put[0], {})),
    )
    search._in_twos()
    assert tried == [frozenset((*imitator, "road_grade")), frozenset(one + other)]


@pytest.mark.parametrize(("left", "found"), [("aero_drag", "two"), ("force_gain", "one")])
def test_what_lines_still_tell_beside_the_leading_change_is_sought_in_twos(
    monkeypatch: pytest.MonkeyPatch, left: str, found: str
) -> None:
    imitator, two = ("force_gain",), ("mass", "aero_drag")
    evidence = {(): 0.0, imitator: 90.0, two: 120.0}
    search = searching(monkeypatch, dict.fromkeys((*imitator, *two), 1e-9), evidence)
    pair = search.visited.pop(frozenset(two))
    told = SimpleNamespace(causes=SimpleNamespace(sets=[SimpleNamespace(effects=(left,))]))
    search.__dict__["singles"] = told
    names = {
        "told": lambda _: told,
        "_in_twos": lambda: search.visited.update({frozenset(two): pair}),
        "_visit": lambda *_: None,
        "_best": lambda _, state: state,
        "_better": lambda state, _: state,
        "_settled": lambda told, state: (told, state),
    }
    for name, stand_in in names.items():
        monkeypatch.setattr(search, name, stand_in)
    assert search.found()[1].put == {"one": imitator, "two": two}[found]


def test_an_added_change_is_none_where_it_does_as_well_as_a_lack() -> None:
    """All changes in both drivings the same are a compromise, which says nothing of the added."""
    part, both = ("mass",), ("mass", "cg_position")
    figures = {(): (0.0, 0.0), part: (900.0, 500.0), both: (990.0, 450.0)}
    shares = {"cg_position": 910.0}

    def evidence() -> float:
        search = Search.__new__(Search)
        search.rules, search.start = USUAL, None  # type: ignore[assignment]
        search.visited = {
            frozenset(p): SimpleNamespace(  # type: ignore[misc]
                put=p, changes={}, log_likelihood=value, among=value, reached=reached
            )
            for p, (value, reached) in figures.items()
        }
        search.reference = SimpleNamespace(  # type: ignore[assignment]
            sharing=lambda _, state, few: shares["".join(few)]
        )
        told = SimpleNamespace(price=lambda *_: 5.0)
        return search.evidence(search.visited[frozenset(both)], told, 1.0)  # type: ignore[arg-type]

    assert evidence() == 985.0
    shares["cg_position"] = 989.0
    assert evidence() == 445.0


def test_what_changes_each_axle_does_not_speak_against_a_change_of_both() -> None:
    front, rear = "tyre_front", "tyre_rear"
    assert hold_tyres({front, rear, "mass"}, STIFFNESS)
    assert not hold_tyres({front, "mass"}, STIFFNESS)
    assert not hold_tyres({front, rear}, "mass")


def test_tyres_have_other_names_beside_another_change_of_them() -> None:
    front, rear = "tyre_front", "tyre_rear"
    assert set(by_other_names(front, (front, rear))) == {FRICTION, STIFFNESS}
    assert set(by_other_names(STIFFNESS, (STIFFNESS, front))) == {rear, FRICTION}
    # Alone, and of both axles alone, they have none.
    assert by_other_names(front, (front, "mass")) == ()
    assert by_other_names(STIFFNESS, (STIFFNESS, FRICTION)) == ()
    assert by_other_names("mass", (front, "mass")) == ()


def test_a_change_by_other_names_does_not_speak_against_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Both axles softer and the front one back is the rear axle softer, for one change more."""
    front, rear, both = "tyre_front", "tyre_rear", "stiffness_both_axles"
    put = {(): -430.0, (rear,): 0.0, (front, both): -2.3, (front, "mass"): -9.0}
    search = searching(monkeypatch, dict.fromkeys((front, rear, both, "mass"), 0.0), put)
    lacking = search.lacking(rear, search.visited[frozenset({rear})], (rear,))
    assert [s.put for s in lacking] == [(), (front, "mass")]
    # Against all else it speaks as ever.
    state = search.visited[frozenset({front, both})]
    assert [s.put for s in search.lacking("mass", state, ())] == [(front, both)]


def test_what_lines_lead_to_beside_its_stand_in_is_tried_in_its_place() -> None:
    """A downforce does at one speed what tyres do; beside it lines tell of those that changed."""
    sets = [SimpleNamespace(effects=(e,)) for e in ("tyre_front", "mass", "steer_ratio")]
    told = SimpleNamespace(
        put=("aero_downforce", "steer_ratio"),
        causes=SimpleNamespace(sets=sets, of=lambda _: None),
        acts_like=lambda e: {"tyre_front": "aero_downforce"}.get(e, ""),
    )
    few = ("aero_downforce", "tyre_front", "mass", "steer_ratio")
    can = dict.fromkeys(few, SimpleNamespace(rivals=()))
    assert in_place("aero_downforce", told, can) == ["tyre_front"]  # type: ignore[arg-type]
    assert in_place("steer_ratio", told, can) == []  # type: ignore[arg-type]


def test_what_cannot_be_fitted_is_not_named_by_its_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """No car does what its line tells: a friction whose tyres would be beyond any."""
    search = searching(monkeypatch, {"friction": 1e-9, "mass": 1e-9}, {(): 0.0})

    def fitted(*_: object) -> None:
        raise NumericalError("beyond")

    search.reference.fitted = fitted  # type: ignore[method-assign, assignment]
    search._visit(("friction",), Told((), {}))  # type: ignore[arg-type]
    assert search.failed == {frozenset({"friction"})}
    said = Saying.__new__(Saying)
    said.search = search
    sets = [CredibleSet.of({e: 0.0}, 0.95) for e in ("friction", "mass")]
    told = SimpleNamespace(
        causes=SimpleNamespace(sets=sets), acts_like=lambda _: "", beside_put={"mass": 9.0}
    )
    state = search.visited[frozenset()]
    assert [s.effects for s in said._not_refused(told, state)] == [("mass",)]  # type: ignore[arg-type]
    # What has no refit has to be likely beside what was put in.
    told.beside_put["mass"] = 1.0
    assert said._not_refused(told, state) == []  # type: ignore[arg-type]


def test_a_set_is_led_by_what_was_fitted() -> None:
    found = CredibleSet.of({"tyre_rear": 0.4, "tyre_front": 0.0, "mass": -0.5}, 0.95)
    led = found.led_by("tyre_front")
    assert led.effects == ("tyre_front", "tyre_rear", "mass")
    assert led.probabilities == tuple(found.weights[e] for e in led.effects)
    assert found.led_by("yaw_inertia") is found


def test_rivals_are_fitted_wherever_a_search_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """What goes for want of lines leaves changes whose other names nobody has asked for."""
    begun, left = ("steer_lag", "mass"), ("steer_lag",)
    search = searching(
        monkeypatch, {"steer_lag": 1e-9, "mass": 0.3}, {(): -9.0, begun: -2.0, left: -1.0}
    )
    tried: list[tuple[str, ...]] = []
    monkeypatch.setattr(search, "_better", lambda state, _: state)
    monkeypatch.setattr(search, "_visit_in_place", lambda state, _: tried.append(state.put))
    lines = {"steer_lag": 1e-9, "mass": 0.3}
    _, state = search._settled(Told(begun, lines), search.visited[frozenset(begun)])  # type: ignore[arg-type]
    assert state.put == left
    assert tried == [begun, left]
