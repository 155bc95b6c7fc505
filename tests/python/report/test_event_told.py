"""What is said, and written, where one moment holds most of the error."""

import json
from dataclasses import replace
from html import escape
from pathlib import Path

import numpy as np
import pytest
from pushes import Push
from reported import reported_study

import sysid_vehicle as sv
from sysid_vehicle.cli import main
from sysid_vehicle.compare import Event

HIT = Event("lap", 12.02, 12.48, 0.97, 38.2, "take another log")


@pytest.fixture(scope="module")
def hit() -> sv.Study:
    """The study of the report, had something happened in its training and validation data."""
    study = reported_study()
    return replace(
        study,
        train=(*study.train[:-1], replace(study.train[-1], event=HIT)),
        test=(*study.test[:-1], replace(study.test[-1], event=replace(HIT, log="course"))),
    )


def test_a_study_says_it_below_the_errors(hit: sv.Study) -> None:
    lines = str(hit).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("  noise floor"))
    assert lines[at + 1] == (
        "97 % of the squared error of the training data above the noise floor lies in 0.5 s of "
        "'lap', 12.0 to 12.5 s (38.2 times the floor there). Look at what happened then, or leave "
        "these seconds out: take another log."
    )
    assert lines[at + 2].startswith("97 % of the squared error of the validation data above")
    assert "'course', 12.0 to 12.5 s" in lines[at + 2]
    for line in lines[at + 1 : at + 3]:
        assert escape(line) in hit._repr_html_()


def test_report_and_json_carry_it(hit: sv.Study, tmp_path: Path) -> None:
    hit.report(tmp_path / "hit.html")
    hit.report(tmp_path / "hit.md")
    page = (tmp_path / "hit.html").read_text("utf-8")
    assert escape(HIT.of("training data")) in page
    assert "lies in 0.5 s of 'lap', 12.0 to 12.5 s" in (tmp_path / "hit.md").read_text("utf-8")
    told = json.loads(json.dumps(hit.to_dict()["events"]))
    assert told["train"] == HIT.to_dict()
    assert told["test"]["log"] == "course"
    hit.save(tmp_path / "hit.npz")
    assert str(sv.load(tmp_path / "hit.npz")) == str(hit)


def test_where_nothing_happened_nothing_is_said(tmp_path: Path) -> None:
    study = reported_study()
    assert "squared error of the" not in str(study)
    assert study.to_dict()["events"] == {"train": None, "test": None}
    study.report(tmp_path / "study.md")
    assert "squared error of the" not in (tmp_path / "study.md").read_text("utf-8")


@pytest.mark.parametrize("where", ["train", "test"])
def test_a_study_of_a_pushed_car_tells_when(where: str) -> None:
    truth = sv.Model(sv.example_vehicle())
    drives = {"train": sv.manoeuvres.lap(30.0), "test": sv.manoeuvres.handling_course(25.0)}
    logs = {
        name: sv.drive(
            truth,
            manoeuvre,
            seed=8,
            rate_hz=50.0,
            name=name,
            disturbance=Push(at_s=15.0) if name == where else None,
        )
        for name, manoeuvre in drives.items()
    }
    few = ["steer_lag"]
    study = sv.improve(truth, logs["train"], logs["test"], candidates=few, starts=1, sensors=False)
    found = {"train": study.train[-1].event, "test": study.test[-1].event}
    event = found.pop(where)
    assert event is not None
    assert event.log == where
    assert 14.9 < event.from_s < event.until_s < 16.2
    assert list(found.values()) == [None]
    assert str(study).count("of the squared error of the") == 1


def test_compare_writes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = sv.Model(sv.example_vehicle())
    road = Push(at_s=15.0)
    log = sv.drive(truth, sv.manoeuvres.lap(30.0), seed=9, rate_hz=50.0, disturbance=road)
    log.to_csv(tmp_path / "lap.csv")
    truth.vehicle.to_toml(tmp_path / "car.toml")
    paths = [str(tmp_path / name) for name in ("lap.csv", "car.toml", "out.json")]
    assert main(["compare", paths[0], "--vehicle", paths[1], "--json", paths[2]]) == 0
    event = json.loads((tmp_path / "out.json").read_text("utf-8"))["event"]
    assert np.isclose(event["from_s"], 15.0, atol=0.1)
    assert "of the squared error above the noise floor lies in" in capsys.readouterr().out


def test_diagnose_tells_it_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = sv.Model(sv.example_vehicle())
    road = Push(at_s=15.0)
    truth.vehicle.to_toml(tmp_path / "car.toml")
    for i, name in enumerate(("lap", "again")):
        pushed = road if name == "again" else None
        log = sv.drive(truth, sv.manoeuvres.lap(30.0), seed=9 + i, rate_hz=50.0, disturbance=pushed)
        log.to_csv(tmp_path / f"{name}.csv")
    lap, again, car = (str(tmp_path / name) for name in ("lap.csv", "again.csv", "car.toml"))
    assert main(["diagnose", lap, "--test", again, "--vehicle", car]) == 0
    assert capsys.readouterr().out.count("of the squared error") == 1
