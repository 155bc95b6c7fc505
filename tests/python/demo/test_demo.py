"""The demonstration: it hides an effect, finds it, and gives nothing away before the end."""

import json
import re
import warnings
from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli import main
from sysid_vehicle.demo import DEFAULT, RANDOM, hide, run, run_demo
from sysid_vehicle.demo.hidden import drive_both, vehicle_file


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A study of the same driving with fewer starts and few candidates."""

    def improve(*args: object, **keywords: object) -> sv.Study:
        few = ["tyre_load_sensitivity", "steer_lag", "steer_offset"]
        return sv.improve(*args, **{**keywords, "starts": 1, "candidates": few})  # type: ignore[arg-type]

    monkeypatch.setattr(run, "improve", improve)


def test_a_named_effect_is_hidden_at_its_typical_size(rng: np.random.Generator) -> None:
    truth = hide("steer_lag", rng)
    typical = sv.effect("steer_lag").parameters[0].typical
    assert truth.effects == ("steer_lag",)
    assert truth.value("steer_lag.time_constant_s") == typical


def test_an_unknown_effect_is_refused(rng: np.random.Generator) -> None:
    with pytest.raises(sv.InvalidInput, match="did you mean 'steer_lag'"):
        hide("steerlag", rng)


def test_the_draw_depends_on_the_seed_alone() -> None:
    drawn = [hide(RANDOM, np.random.default_rng(seed)).effects for seed in range(40)]
    assert drawn == [hide(RANDOM, np.random.default_rng(seed)).effects for seed in range(40)]
    assert len(set(drawn)) > 10


def test_the_vehicle_file_knows_all_but_the_tyres() -> None:
    true = sv.example_vehicle()
    given = vehicle_file(true)
    assert given.tyre_front != true.tyre_front
    assert given.tyre_rear != true.tyre_rear
    assert given.replace(tyre_front=true.tyre_front, tyre_rear=true.tyre_rear) == true


@pytest.mark.parametrize("e", sv.catalogue(), ids=lambda e: e.id)
def test_each_effect_can_be_driven_and_logs_do_not_name_it(e: sv.Effect) -> None:
    logs = drive_both(hide(e.id, np.random.default_rng(0)), np.random.default_rng(1))
    for log in logs:
        assert e.id not in f"{log.name} {log.channels}"
        assert np.abs(log["ay_mps2"]).max() > 6.5


@pytest.mark.manual
@pytest.mark.usefixtures("quick")
def test_the_story_finds_the_default_effect_and_names_it_last(tmp_path: Path) -> None:
    told: list[str] = []
    report = tmp_path / "report.html"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sv.SysidWarning)
        shown = run_demo(seed=4, report=report, tell=told.append)
    assert shown.found
    assert shown.study.model.effects == (DEFAULT,)
    text = "\n".join(told)
    assert "The hidden effect was" not in "\n".join(told[:-1])
    assert told[-1].startswith(f"The hidden effect was {DEFAULT}")
    assert DEFAULT not in told[0]
    assert "truth" not in "\n".join(told[:-1])
    for c in shown.study.test[0].channels.values():
        assert f"{c.nrmse:.2f}" in text
    assert "Where it fails most" in text
    assert f"{shown.study.test[-1].error:.3f}" in text
    assert shown.study.test[-1].error < 1.1
    row = next(x for x in told[-1].splitlines() if x.strip().startswith(f"{DEFAULT}."))
    true, value, low, high = (float(x) for x in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", row))
    assert true == 0.25
    assert low < value < high
    assert abs(value - true) < (high - low)
    assert str(report) in text
    assert report.stat().st_size > 10_000


@pytest.mark.manual
@pytest.mark.usefixtures("quick")
def test_a_miss_is_told_as_a_miss(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    json_path = tmp_path / "out.json"
    argv = ["demo", "--hidden", "gyro_bias", "--report", str(tmp_path / "r.html")]
    assert main([*argv, "--json", str(json_path)]) == 0
    out = capsys.readouterr().out
    assert "Not found: " in out
    result = json.loads(json_path.read_text(encoding="utf-8"))
    assert result["hidden"] == {
        "id": "gyro_bias",
        "parameters": {"bias_radps": sv.effect("gyro_bias").parameters[0].typical},
        "found": False,
    }


@pytest.mark.manual
def test_the_whole_demonstration(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report, path = tmp_path / "report.html", tmp_path / "out.json"
    assert main(["demo", "--report", str(report), "--json", str(path)]) == 0
    out = capsys.readouterr().out
    result = json.loads(path.read_text(encoding="utf-8"))
    assert result["verdict"] == "explained"
    assert [e["id"] for e in result["effects"]] == [DEFAULT]
    assert result["ranking"][0]["id"] == DEFAULT
    assert result["hidden"]["found"] is True
    assert result["errors"]["test"][0] > 1.5
    assert result["errors"]["test"][-1] < 1.05
    assert "Found." in out
    assert report.exists()
