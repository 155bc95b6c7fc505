"""Rules by which changes are told, on searches of real drives whose likelihoods are then moved."""

from dataclasses import replace

import numpy as np
import pytest
from changed_drives import later

from sysid_vehicle import Fit, Log, Model, drive, identify, manoeuvres
from sysid_vehicle.diagnose.change.reference import Exact
from sysid_vehicle.diagnose.change.saying import Saying
from sysid_vehicle.diagnose.change.search import Search
from sysid_vehicle.diagnose.changed import _later
from sysid_vehicle.estimate import Driving
from sysid_vehicle.rules import USUAL

OFFSET, RATIO, LACK = "steer_offset", "steer_ratio", "tyre_relaxation"


def searched(before: Fit, log: Log, *candidates: str) -> Saying:
    return Saying(Search(before, _later(before, Driving.of(log), None), candidates, USUAL))


@pytest.fixture(scope="module")
def offset(truth: Model, before: Fit) -> Saying:
    """Of a steering that was set otherwise."""
    return searched(before, later(truth, steer_offset__offset_rad=0.006), OFFSET, RATIO)


@pytest.fixture(scope="module")
def lagging(truth: Model, start: Model) -> Saying:
    """Of tyres that lag in both drives, which the model does not know."""
    car = truth.add(LACK).with_values({f"{LACK}.relaxation_length_m": 0.4})
    first, second = (drive(car, manoeuvres.lap(15.0), seed=seed, rate_hz=50.0) for seed in (41, 42))
    return searched(identify(start, first, starts=1), second, LACK, OFFSET)


def visited(said: Saying, *put: str) -> Exact:
    return said.search.visited[frozenset(put)]


def test_what_is_lacked_explains_more_than_what_seems_to_have_changed(
    lagging: Saying, monkeypatch: pytest.MonkeyPatch
) -> None:
    lack = lagging.lack()
    assert lack is not None
    assert lack.id == LACK
    state, nothing = visited(lagging, LACK), visited(lagging)
    left = state.log_likelihood - state.reached
    # A change that explains as much is a change; a lack of no more than its price is none.
    monkeypatch.setattr(lagging, "state", replace(nothing, among=nothing.reached + 1.1 * left))
    assert lagging.lack() is None
    monkeypatch.undo()
    little = replace(state, log_likelihood=state.reached + 1.0)
    monkeypatch.setitem(lagging.search.visited, frozenset({LACK}), little)
    assert lagging.lack() is None


def test_a_change_is_as_large_as_it_differs_from_the_reference(lagging: Saying) -> None:
    """What the reference has of it, and its model lacks, is no part of the change's size."""
    name = f"{LACK}.relaxation_length_m"
    state, nothing = visited(lagging, LACK), visited(lagging)
    assert state.searched.value(name) > 0.3
    assert abs(state.changes[name]) < 0.1
    price = state.reached - nothing.reached - lagging.search.over_nothing(state, lagging.told, 1.0)
    assert price == pytest.approx(lagging.told.price((LACK,), {name: 0.0}), abs=0.05)


def test_what_changed_is_no_lack(offset: Saying) -> None:
    assert offset.state.put == (OFFSET,)
    assert offset.lack() is None


def test_what_is_added_counts_where_it_gains_beyond_a_lack(
    offset: Saying, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside the change that is there; by what the reference lacks it gains in both drives."""
    alone, nothing = offset.state, visited(offset)
    gain = alone.reached - nothing.reached
    assert gain > 100.0

    def beside(reached: float, *, shared: float) -> float:
        monkeypatch.setattr(
            offset.search.reference, "sharing", lambda *_: alone.log_likelihood - shared
        )
        both = replace(
            alone,
            put=(OFFSET, RATIO),
            changes=alone.changes | {"steer_ratio.ratio_error": 0.0},
            reached=alone.reached + reached,
            among=alone.among + 500.0,
        )
        monkeypatch.setitem(offset.search.visited, frozenset(both.put), both)
        evidence = offset.search.evidence
        return evidence(both, offset.told, 1.0) - evidence(alone, offset.told, 1.0)

    assert beside(-1.0, shared=0.0) < 0.0  # though it is 500 nats likelier among others
    assert beside(1.0, shared=0.0) > 450.0
    # All changes in both drives the same are a compromise: this one alone is none.
    assert beside(-1.0, shared=500.0) > 450.0


def test_what_is_known_badly_may_be_off_nothing(
    offset: Saying, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a drag in a wind that both drives may have: lines from nothing tell that it is there."""
    ((name, usual),) = offset.search.can[OFFSET].usual.items()
    assert offset._off_nothing(OFFSET, offset.state, offset.told)
    monkeypatch.setitem(offset.told.stds, name, usual)
    assert offset._off_nothing(OFFSET, offset.state, offset.told)
    both = replace(offset.state, put=(OFFSET, RATIO))  # which may stand in for each other
    assert not offset._off_nothing(OFFSET, both, offset.told)
    monkeypatch.setitem(offset.search.singles.stds, name, usual)
    assert not offset._off_nothing(OFFSET, offset.state, offset.told)


def test_a_size_is_as_far_from_nothing_as_its_likelihood_says(offset: Saying) -> None:
    """No line makes it surer, and the size is the one that was fitted."""
    name = "steer_offset.offset_rad"
    alone, nothing = offset.state, visited(offset)
    sizes, stds = {name: 0.1}, {name: 1e-9}
    offset._by_ratio(OFFSET, sizes, stds)
    assert sizes[name] == alone.changes[name] == pytest.approx(0.006, abs=5e-4)
    rises = 2.0 * (alone.reached - nothing.reached) / offset.told.ratio_of((OFFSET,))
    assert stds[name] == pytest.approx(abs(sizes[name]) / np.sqrt(rises))
    wide = {name: 1.0}
    offset._by_ratio(OFFSET, sizes, wide)
    assert wide[name] == 1.0  # nor less sure


def test_a_change_that_gained_nothing_keeps_its_line(
    offset: Saying, monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing = visited(offset)
    worse = replace(offset.state, reached=nothing.reached - 1.0)
    monkeypatch.setitem(offset.search.visited, frozenset({OFFSET}), worse)
    name = "steer_offset.offset_rad"
    sizes, stds = {name: 0.001}, {name: 1e-9}
    offset._by_ratio(OFFSET, sizes, stds)
    assert (sizes[name], stds[name]) == (0.001, 0.001)


def test_a_size_beside_what_acts_like_it_is_as_uncertain_as_both(
    truth: Model, before: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    late = {"steer_delay": 0.03, "steer_lag": 0.03}  # [s]
    log = later(truth, steer_delay__delay_s=0.03, steer_lag__time_constant_s=0.03)
    said = searched(before, log, *late)
    said.search._visit(tuple(late), said.told)
    both = visited(said, *late)
    monkeypatch.setattr(said, "state", both)
    monkeypatch.setattr(said, "told", said.search.told(both))
    sizes, stds = said._told_sizes([], both)
    for name, size in both.changes.items():
        alone = said.told.stds[name]
        assert sizes[name] == size
        # Their sum is known to a millisecond or two, what either is of it is not.
        assert stds[name] > 5.0 * alone
        assert abs(size - late[name.split(".")[0]]) < 2.0 * stds[name]
