"""The benchmark of next drives asks, drives and counts as it says."""

from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest
from few_drives import asked_of_few

import sysid_vehicle as sv

BENCHMARK = ("next_drive", "followed", "answers", "design", "truths")


def told(**groups: list[str]) -> dict[str, Any]:
    return {
        "verdict": "explained",
        "added": list(groups),
        "groups": groups,
        "grades": dict.fromkeys(groups, "confirmed"),
    }


def row(**different: Any) -> dict[str, Any]:
    usual = {
        "key": "effect|steer_delay|1|ramp|nominal|vy|saloon|0",
        "truth": ["steer_delay"],
        "state": "done",
        "between": ["steer_lag", "steer_delay"],
        "now": 1.0,
        "promised": 8.0,
        "drivable": True,
        "drive": {"standard_errors_if": {"steer_lag": 8.0, "steer_delay": 9.0}},
        "apart": {"steer_lag": 7.0},
        "lateral": 6.0,
        "lateral_limit": 8.5,
        "less": None,
        "after": told(steer_delay=[]),
    }
    return usual | different


def test_what_a_study_named_is_counted(program: SimpleNamespace) -> None:
    outcome = program.answers.outcome
    assert outcome(row()) == "right, alone"
    assert outcome(row(after=told(steer_lag=["steer_delay"]))) == "right, in a group"
    assert outcome(row(after=told(steer_lag=[]))) == "wrong"
    assert outcome(row(after=told(steer_delay=[], mass=[]))) == "wrong"
    assert outcome(row(after=told())) == "nothing named"
    unknown = told(steer_lag=[]) | {"verdict": "unknown"}
    assert outcome(row(after=unknown)) == "nothing named"
    proxy = told(steer_lag=[]) | {"grades": {"steer_lag": "alias"}}
    assert outcome(row(after=proxy)) == "nothing named"
    pair = row(truth=["steer_delay", "mass"], after=told(steer_delay=[], mass=["yaw_inertia"]))
    assert outcome(pair) == "right, alone"  # of the group that was asked about


def test_distances_are_those_of_what_is_there(program: SimpleNamespace) -> None:
    answers = program.answers
    assert answers.promised(row()) == 9.0
    assert answers.reached(row()) == 7.0
    first = row(between=["steer_delay", "steer_lag", "mass"], apart={"steer_lag": 7.0, "mass": 3.0})
    assert answers.reached(first) == 3.0
    rival = row(between=["steer_lag", "steer_delay", "mass"], apart={"steer_lag": 7.0, "mass": 3.0})
    assert answers.reached(rival) == 7.0
    text = answers.table([row(), row(now=6.0), row(promised=2.0), row(state="no question")])
    assert "4 trials, of 3 the study asks which effect it is" in text
    for kind in ("promised to be enough", "enough at hand already", "said not to be enough"):
        (line,) = (part for part in text.splitlines() if part.startswith(kind))
        assert line.split()[-5:] == ["1", "1", "0", "0", "0"]
    assert "promised 5 and more: reached 5 in 3 of 3, at least 7.0" in text


@pytest.mark.manual
def test_a_question_is_followed(program: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> None:
    near = ("steer_delay", "steer_lag", "tyre_relaxation", "aero_drag")
    monkeypatch.setattr(sv, "improve", partial(sv.improve, candidates=near))
    monkeypatch.setattr(program.followed, "_STARTS", 1)
    asked_of_few(monkeypatch, 4)
    trial = program.design.Trial("effect", ("steer_delay",), 0.5, "ramp", "nominal", True, "saloon")
    done = program.followed.followed(trial)
    assert done["state"] == "done"
    assert set(done["between"]) == {"steer_delay", "steer_lag"}
    assert done["drivable"]
    assert program.answers.outcome(done) == "right, alone"
    assert program.answers.reached(done) == pytest.approx(program.answers.promised(done), abs=4.0)
