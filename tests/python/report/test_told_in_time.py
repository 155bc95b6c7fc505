"""What takes long to tell of a study is told in time, or left out and said to be."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from reported import ended_at_once, reported_study

import sysid_vehicle as sv
from sysid_vehicle.cli import commands, main
from sysid_vehicle.study import study as study_module
from sysid_vehicle.study.ahead.shares import Shares


@pytest.fixture(scope="module")
def study() -> sv.Study:
    return reported_study()


def test_what_no_time_was_left_for_is_said(
    study: sv.Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        for slow in ("shares", "predicting", "disagreements", "unknown", "late", "hidden"):
            patch.setattr(study_module, slow, lambda *_, **__: pytest.fail("no time was left"))
        cut = replace(ended_at_once(study)).in_time(1e-9)
    assert set(cut.left_out) == {
        *("shares", "predicting", "disagreements", "between_logs", "sufficient", "where"),
        *("unknown", "late", "causes", "errors_with", "hidden"),
    }
    said = "o time was left to find out how much of the errors ahead could be explained; what a fit"
    assert f"Warning: n{said}" in str(cut)
    assert cut.where.change_points is None
    assert all(c.delay is None for c in cut.where.coherence)
    cut.report(tmp_path / "cut.html")
    page = (tmp_path / "cut.html").read_text("utf-8")
    assert f"N{said}" in page
    assert page.count("Left out: there was no time.") == 1
    told = cut.to_dict()
    assert told["left_out"] == list(cut.left_out.values())
    json.dumps(told, allow_nan=False)
    # Printing alone does not need what reports tell, and more time tells the rest.
    printed = cut.in_time(1e-9, reported=False)
    assert set(cut.left_out) - set(printed.left_out) == {"causes", "errors_with", "hidden"}
    assert "sufficient" not in cut.in_time(1e4).left_out
    whole = replace(study).in_time(1e4)
    assert whole.left_out == study.left_out == {}
    assert str(whole) == str(study)
    with pytest.raises(sv.InvalidInput, match="seconds = 0"):
        study.in_time(0.0)


def test_the_time_limit_counts_what_is_printed(
    study: sv.Study,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    limits: list[float] = []

    def quick(*_: Any, **keywords: Any) -> sv.Study:
        limits.append(keywords["time_limit_s"])
        return replace(study)

    monkeypatch.setattr(commands, "improve", quick)
    study.fit.driving.logs[0].to_csv(tmp_path / "lap.csv")
    study.model.vehicle.to_toml(tmp_path / "car.toml")
    command = ["improve", str(tmp_path / "lap.csv"), "--vehicle", str(tmp_path / "car.toml")]
    assert main([*command, "--time-limit", "1e-3"]) == 0
    told = capsys.readouterr()
    assert f"Verdict: {study.verdict}" in told.out
    assert Shares.CAPTION not in told.out
    for text in (told.out, told.err):
        assert text.count("no time was left to find out how much of the errors ahead could be") == 1
    assert "which causes" not in told.out
    assert main([*command, "--time-limit", "1e4"]) == 0
    told = capsys.readouterr()
    assert Shares.CAPTION in told.out
    assert "no time was left" not in told.out
    assert limits == [0.75e-3, 0.75e4]
