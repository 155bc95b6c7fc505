"""What a study could not tell apart is told by the drive that it asks for."""

import json
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from few_drives import asked_of_few

import sysid_vehicle as sv
from sysid_vehicle.cli import main
from sysid_vehicle.study import AddedEffect
from sysid_vehicle.study.results.next_steps import open_groups

NEAR = ("steer_delay", "steer_lag", "tyre_relaxation", "aero_drag")


@pytest.fixture(scope="module")
def late(truth: sv.Model) -> sv.Model:
    return truth.add("steer_delay").with_values({"steer_delay.delay_s": 0.02})


@pytest.fixture(scope="module")
def logs(late: sv.Model) -> list[sv.Log]:
    ramp = sv.manoeuvres.ramp_steer((18.0, 27.0), 8.0, 4.0)
    course = sv.manoeuvres.handling_course(16.0, 8.0)
    return [sv.drive(late, m, seed=41 + i, rate_hz=50.0) for i, m in enumerate((ramp, course))]


@pytest.fixture(scope="module")
def study(start: sv.Model, logs: list[sv.Log]) -> Iterator[sv.Study]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sv.SysidWarning)
        yield sv.improve(start, *logs, candidates=NEAR, sensors=False, starts=1)


def test_what_was_confounded_is_told_after_the_drive(
    start: sv.Model,
    late: sv.Model,
    logs: list[sv.Log],
    study: sv.Study,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked_of_few(monkeypatch)
    assert [set(g) for g in open_groups(study)] == [{"steer_delay", "steer_lag"}]
    found = sv.next_drive(study)
    assert found.reaches
    assert found.first.id == study.added[0].id
    more = [
        sv.drive(late, found.best.manoeuvre, seed=43 + i, rate_hz=50.0)
        for i in range(found.best.times)
    ]
    again = sv.improve(start, [logs[0], *more], logs[1], candidates=NEAR, sensors=False, starts=1)
    assert [a.name for a in again.added] == ["steer_delay"]
    with pytest.raises(sv.InvalidInput, match="no effect that it confounds with others"):
        sv.next_drive(again)


def test_which_group_is_asked_about_can_be_said(study: sv.Study) -> None:
    with pytest.raises(sv.InvalidInput, match="does not confound 'mass' with others, but steer_"):
        sv.next_drive(study, "mass")
    with pytest.raises(sv.InvalidInput, match="Study"):
        sv.next_drive(study.fit)  # type: ignore[arg-type]


def test_the_next_step_is_a_command(
    study: sv.Study,
    logs: list[sv.Log],
    start: sv.Model,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """With what else the study added in the model, as it is in that of `next_drive`."""
    (told,) = (text for text in study.next_steps if text.startswith("separate"))
    richer = replace(study.fit, model=study.model.add("aero_drag"))
    beside = replace(
        study,
        fits=(*study.fits, richer),
        added=(*study.added, AddedEffect("aero_drag", (), 2.0, 1.0, 1e-9)),
    )
    (also,) = (text for text in beside.next_steps if text.startswith("separate"))
    assert "--effects" not in told
    assert " --effects aero_drag`" in also
    command = also.split("`")[1].split()[1:]
    logs[0].to_csv(tmp_path / "log.csv")
    start.vehicle.to_toml(tmp_path / "car.toml")
    out = tmp_path / "next.json"
    where = [str(tmp_path / "log.csv"), "--vehicle", str(tmp_path / "car.toml")]
    limits = ["--top-speed", "18", "--duration", "30", "--json", str(out)]
    assert main([command[0], *where, *command[1:], *limits]) == 0
    printed = capsys.readouterr().out
    figures = json.loads(out.read_text("utf-8"))
    assert figures["between"] == command[2].split(",")
    assert figures["sizes"] == "at hand"
    first = figures["suggestions"][0]
    lines = [line.strip() for line in printed.splitlines()]
    row = next(line for line in lines if line.startswith(first["manoeuvre"]))
    for e in figures["between"]:
        assert f"{first['standard_errors_if'][e]:.1f}" in row.split()
