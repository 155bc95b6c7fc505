"""Refits end in time, wherever they are."""

import sys
from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from sysid_vehicle import Diagnosis, Fit, Model, diagnose, drive, identify, manoeuvres
from sysid_vehicle._common.threads import before, check_time, in_parallel
from sysid_vehicle.diagnose import Candidate
from sysid_vehicle.diagnose.candidates.refits import finished, in_time, refitted

ALIKE = ["aero_drag", "rolling_resistance"]


@pytest.fixture(scope="module")
def baseline(start: Model, truth: Model) -> Fit:
    car = truth.add("aero_drag").with_values({"aero_drag.drag_area_m2": 0.6})
    return identify(start, drive(car, manoeuvres.lap(15.0), seed=61, rate_hz=25.0), starts=1)


@pytest.fixture(scope="module")
def dx(baseline: Fit) -> Diagnosis:
    return diagnose(baseline, candidates=ALIKE)


def test_no_refit_outlasts_the_time_limit(
    dx: Diagnosis, baseline: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a clock that goes on at each look: a refit ends at its next pass over the data."""
    c = replace(dx.ranking[0], fit=None)
    assert in_time(lambda c: replace(c, statistic=-1.0), np.inf)(c).statistic == -1.0
    assert in_time(lambda c: replace(c, statistic=-1.0), 0.0)(c) is c
    clock = count()
    monkeypatch.setattr("time.perf_counter", lambda: float(next(clock)))
    assert in_time(lambda c: refitted(baseline, baseline.driving, c), 2.5)(c) is c
    assert in_time(lambda c: finished(baseline, c), 11.5)(dx.ranking[0]) is dx.ranking[0]
    # The look that finds it late, and one more that tells whose time is over.
    assert next(clock) <= 14


def test_what_has_no_noise_of_its_own_in_time_is_held_against_the_like(
    baseline: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two candidates one is finished before the limit, the other is not."""
    done: list[str] = []

    def one_only(fit: Fit, c: Candidate, least: float) -> Candidate:
        done.append(c.id)
        return replace(c, statistic=1e9) if len(done) == 1 else c

    module = sys.modules["sysid_vehicle.diagnose.candidates.refitting"]
    monkeypatch.setattr(module, "finished", one_only)
    ranking = diagnose(baseline, candidates=ALIKE, workers=1).ranking
    assert len(done) > 1
    assert max(c.statistic for c in ranking) < 1e9


def test_work_that_is_not_done_in_time_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = count()
    monkeypatch.setattr("time.perf_counter", lambda: float(next(clock)))

    def never_done(_: object = None) -> None:
        while True:
            check_time()

    assert before(5.0, lambda: "done", "late") == "done"
    assert before(0.0, lambda: "done", "late") == "late"
    assert before(20.0, lambda: in_parallel(never_done, range(3), workers=2), "late") == "late"
    # What is a part of other work does not go on with that when the time of both is over.
    assert before(50.0, lambda: before(90.0, never_done, "part"), "whole") == "whole"
    assert before(200.0, lambda: before(90.0, never_done, "part"), "whole") == "part"
    check_time()
