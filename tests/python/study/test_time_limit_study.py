"""A study ends in time, in whichever of its stages the time runs out."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sysid_vehicle import Fit, Log, Model, _core, drive, improve, manoeuvres
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify.identify import maximised
from sysid_vehicle.sensors.kinematics import estimate as _estimate
from sysid_vehicle.sensors.low_pass import low_pass as _low_pass
from sysid_vehicle.study.judge import judge
from sysid_vehicle.study.search.search import Search
from sysid_vehicle.study.search.trail import Trail

CANDIDATES = ["steer_lag", "aero_drag", "rolling_resistance", "yaw_inertia", "gyro_bias"]

KERNELS = (
    *("filtered_noise_score", "freeze", "half_sum_of_squares", "log_likelihoods", "look_ahead"),
    *("filtered_smoothed_means", "filtered_trace", "noise_score"),
    *("normal_equations", "residuals", "sensitivities", "signal_sensitivities", "smoothed_means"),
    "trace",
)

# Once the time is over: one scoring of all effects, errors of two models on two data sets, and what
# noise of the inputs has added to scores and to the test of all that is left, drawn twice.
PASSES = 25 + 17

# What is told once the time is over: errors ahead, maps, residuals.
TOLD = 40

SEARCHED = 0.1  # nats: searches go on while a round gains more than half of this


class Clock:
    """Goes on by one with each pass over the data, and stands still otherwise."""

    def __init__(self) -> None:
        self.now, self._lock = 0.0, threading.Lock()

    def __call__(self) -> float:
        return self.now

    def counting(self, work: Callable[..., Any], passes: float = 1.0) -> Callable[..., Any]:
        def counted(*args: Any, **options: Any) -> Any:
            with self._lock:
                self.now += passes
            return work(*args, **options)

        return counted


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr("time.perf_counter", clock)
    for name in KERNELS:
        monkeypatch.setattr(_core.Problem, name, clock.counting(getattr(_core.Problem, name)))
    monkeypatch.setattr(_estimate, "linearise", clock.counting(_estimate.linearise))
    problem = _low_pass._Problem
    monkeypatch.setattr(problem, "state", clock.counting(problem.state, 0.1))
    return clock


@pytest.fixture(scope="module")
def logs(truth: Model) -> tuple[Log, Log]:
    car = truth.add("steer_lag", "aero_drag").with_values(
        {"steer_lag.time_constant_s": 0.08, "aero_drag.drag_area_m2": 0.6}
    )
    lap = drive(car, manoeuvres.lap(25.0), seed=41, rate_hz=50.0)
    return lap, drive(car, manoeuvres.handling_course(25.0, 7.0), seed=42, rate_hz=50.0)


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
@pytest.mark.parametrize(
    ("limit", "unknown"),
    [
        (1.0, "have the same clock"),
        (60.0, "parameters of the baseline"),
        (300.0, None),
        (700.0, None),
    ],
)
def test_no_stage_of_a_study_outlasts_the_time_limit(
    limit: float, unknown: str | None, start: Model, logs: tuple[Log, Log], clock: Clock
) -> None:
    """Without a limit the same study takes some 1100 passes; what is left out is said."""
    study = improve(start, *logs, candidates=CANDIDATES, starts=3, time_limit_s=limit)
    assert clock.now <= limit + PASSES
    assert study.seconds == clock.now
    told = "; ".join(study.warnings)
    assert "the time limit" in told
    assert study.stopped or study.late_facts
    if unknown is not None:
        assert any(unknown in fact for fact in study.late_facts)
        assert unknown in told


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
def test_what_is_told_of_a_study_takes_no_longer_than_it_may(
    start: Model, logs: tuple[Log, Log], clock: Clock, tmp_path: Path
) -> None:
    study = improve(start, *logs, candidates=CANDIDATES, starts=3, time_limit_s=300.0)
    for seconds in (1.0, 60.0):
        began = clock.now
        told = replace(study).in_time(seconds)
        assert told.left_out
        str(told)
        told.to_json(tmp_path / "told.json")
        told.report(tmp_path / "told.html")
        assert clock.now <= began + seconds + TOLD


def test_a_baseline_that_had_too_little_time_is_the_likeliest_seen(
    start: Model, logs: tuple[Log, Log], clock: Clock
) -> None:
    driving = Driving.of(logs[0])
    found = []
    for limit in (0.0, 20.0, 60.0, 120.0, float("inf")):
        found.append(maximised(start, driving, starts=3, ends=clock.now + limit))
    values = np.array([fit.log_likelihood for fit in found])
    # Searches that end on their own stop within SEARCHED of the maximum, on whichever side.
    assert np.all(np.diff(values) > -SEARCHED)
    assert values[0] + 100.0 < values[1] < values[-1] - 100.0
    assert [fit.converged for fit in found[:2]] == [False, False]
    assert found[-1].converged
    assert all(np.isfinite(e.value) for fit in found for e in fit.estimates)


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
def test_what_was_added_is_judged_whatever_the_search_takes(
    start: Model, logs: tuple[Log, Log], clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The search takes all of its time, and the fits between its ends take all that is left."""
    follow, judging = Search.follow, 0.15

    def until_its_end(self: Search, trail: Trail) -> None:
        follow(self, trail)
        clock.now = max(clock.now, self.judged_by)

    def never_done(fits: Sequence[Fit], ends: float) -> list[Fit]:
        clock.now = ends + 1.0
        return [fits[0], fits[-1]]

    monkeypatch.setattr(Search, "follow", until_its_end)
    monkeypatch.setattr(judge, "way", never_done)
    limit = 5000.0
    study = improve(start, *logs, candidates=CANDIDATES[:2], starts=3, time_limit_s=limit)
    assert (1.0 - judging) * limit < clock.now <= limit + PASSES
    assert study.verdict == "explained"
    assert study.explained is not None
    assert not study.stopped
    (late,) = study.late_facts
    assert late == "how much of the validation error each of aero_drag, steer_lag removes"
    told = [text for text in study.warnings if "time limit" in text]
    assert told == [
        (
            f"the time limit left open {late}; without that neither the verdict nor the effects "
            "named are certain"
        )
    ]
    # Which of the two takes little nobody knows.
    assert {a.id: a.grade for a in study.added} == dict.fromkeys(CANDIDATES[:2], "plausible")
