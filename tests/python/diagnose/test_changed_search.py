"""What is named of what may have changed: likelihoods of what was fitted decide."""

from types import SimpleNamespace

import pytest

from sysid_vehicle.diagnose.change.saying import Saying
from sysid_vehicle.diagnose.change.search import Search
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


def test_what_is_named_was_put_in_and_is_off_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A likelier rival takes the place of what was put in; what no line tells goes."""
    lines = {"steer_lag": 1e-9, "steer_delay": 1e-9, "mass": 0.3}
    sets = [(), ("steer_lag", "mass"), ("steer_delay", "mass"), ("steer_delay",)]
    search = Search.__new__(Search)
    search.rules, search.tyres = USUAL, ()
    search.can = {e: SimpleNamespace() for e in lines}  # type: ignore[misc]
    search.visited = {
        frozenset(p): SimpleNamespace(put=p, changes={}, among=0.0, climbed=len(p) > 1)  # type: ignore[misc]
        for p in sets
    }
    search.start = None  # type: ignore[assignment]
    search.reference = SimpleNamespace(  # type: ignore[assignment]
        climbed=lambda _, s: SimpleNamespace(put=s.put, changes={}, climbed=True)
    )
    likelier = search.visited[frozenset(sets[2])]
    monkeypatch.setattr(search, "told", lambda state: Told(state.put, lines))
    monkeypatch.setattr(search, "_leading", lambda _, state: state.put)
    monkeypatch.setattr(search, "evidence", lambda state, *_: -len(state.put))
    monkeypatch.setattr(
        search, "_better", lambda state, _: likelier if state.put == sets[1] else state
    )
    told, state = search._settled(Told(sets[1], lines), search.visited[frozenset(sets[1])])
    assert state.put == told.put == ("steer_delay",)
    # Nothing at all is judged at its maximum; so is what is named.
    assert state.climbed
    assert search.visited[frozenset(state.put)] is state


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
