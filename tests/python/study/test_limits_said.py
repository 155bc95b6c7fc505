"""What a study says that was not to look for more, or not to add more."""

from dataclasses import replace

import pytest
from contradictions import contradictions

from sysid_vehicle import Log, Model, Rules, drive, improve, manoeuvres


@pytest.fixture(scope="module")
def logs(truth: Model) -> tuple[Log, Log]:
    hidden = {"steer_lag.time_constant_s": 0.06, "aero_drag.drag_area_m2": 0.45}
    car = truth.add("steer_lag", "aero_drag").with_values(hidden)
    drives = manoeuvres.lap(20.0), manoeuvres.handling_course(20.0)
    first, second = (drive(car, m, seed=s, rate_hz=25.0) for s, m in enumerate(drives, 91))
    return first, second


def test_where_no_effect_was_considered_the_catalogue_has_not_failed(
    start: Model, logs: tuple[Log, Log]
) -> None:
    found = improve(start, *logs, starts=1, candidates=[], sensors=False)
    assert found.verdict == "unknown"
    assert found.meaning == "something is missing, and no effect was considered"
    assert contradictions(str(found)) == []


def test_where_none_was_to_be_added_the_evidence_is_told(
    start: Model, logs: tuple[Log, Log]
) -> None:
    found = improve(start, *logs, starts=1, candidates=["steer_lag"], most_effects=0, sensors=False)
    assert found.verdict == "unknown"
    assert "no effect was to be added, and there is evidence for steer_lag" in found.meaning
    assert found.full == ("steer_lag",)
    (said,) = (w for w in found.warnings if "as many effects as may be added" in w)
    assert "steer_lag: raise `most_effects`" in said
    assert contradictions(str(found)) == []


def test_the_effect_that_found_no_room_is_told(start: Model, logs: tuple[Log, Log]) -> None:
    both = ["steer_lag", "aero_drag"]
    found = improve(start, *logs, starts=1, candidates=both, most_effects=1, sensors=False)
    (added,) = (a.id for a in found.added)
    assert found.full == tuple(e for e in both if e != added)
    (said,) = (w for w in found.warnings if f"evidence for {found.full[0]}: raise" in w)
    assert "training data" not in said  # 20 s would bear more
    short = replace(Rules(), lasts=20.0)
    few = improve(start, *logs, starts=1, candidates=both, rules=short, sensors=False)
    (said,) = (w for w in few.warnings if f"evidence for {found.full[0]}: record more" in w)
    assert "one for each 20 s of training data" in said
