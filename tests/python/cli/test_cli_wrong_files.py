"""A file of another kind: one error that names it, what it is, and what to give."""

import json
from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli import main
from sysid_vehicle.saved import save

GAINS = {"wheel": 0.08, "ax_vx": 1e-3, "ay_vy": 1e-3, "pitch": 0.1, "yaw": 13.0}
CALIBRATED = {"law": "side-by-side", "gains": GAINS, "cost": 1.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One file of each kind."""
    path = tmp_path_factory.mktemp("kinds")
    car = sv.example_vehicle()
    car.to_toml(path / "car.toml")
    rows = np.zeros(40)
    columns = ("time_s", "vx_mps", "yaw_rate_radps", "ay_mps2", "steer_rad")
    table = np.column_stack([0.02 * np.arange(40), *(rows for _ in columns[1:])])
    np.savetxt(path / "log.csv", table, delimiter=",", header=",".join(columns), comments="")
    save(sv.Model(car), path / "model.npz")
    whole = (path / "model.npz").read_bytes()
    (path / "cut.npz").write_bytes(whole[: len(whole) // 2])
    (path / "map.toml").write_text('[channels]\nvx_mps = "v"\n')
    (path / "fleet.toml").write_text('vehicle = "car.toml"\nlogs = "*.csv"\n')
    told = {
        "gains": CALIBRATED,
        "changed": {"headline": "", "lacks": [], "effects": {}, "warnings": []},
        "study": {"verdict": "explained", "warnings": []},
        "tyres": {"vehicle": {}, "parameters": {}, "noise": {}},
        "other": {"a": 1},
        "list": [1, 2],
    }
    for name, content in told.items():
        (path / f"{name}.json").write_text(json.dumps(content))
    (path / "cut.json").write_text(json.dumps(CALIBRATED)[:60])
    (path / "deep.json").write_text("[" * 100_000)
    (path / "page.html").write_text("<!doctype html><html></html>")
    (path / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(30))
    (path / "empty.json").touch()
    return path


KINDS = {
    "car.toml": "a vehicle file",
    "map.toml": "a channel map",
    "fleet.toml": "a manifest of improve-many",
    "gains.json": "gains of `sysid-vehicle twin calibrate --json`",
    "tyres.json": "tyres of `sysid-vehicle lab identify --json`",
    "changed.json": "figures of `sysid-vehicle changed --json`",
    "study.json": "figures of a study (`--json`)",
    "other.json": "JSON of another kind",
    "list.json": "a list in JSON",
    "cut.json": "broken JSON (line 1, column 6",
    "deep.json": "JSON that is nested too deeply",
    "model.npz": "a saved result of sysid_vehicle",
    "cut.npz": "a ZIP archive that breaks off",
    "page.html": "a web page",
    "picture.png": "a picture",
    "log.csv": "a table, such as a log in CSV",
}
ASKED = {
    "gains": (["twin", "validate", "--gains"], "gains.json", "not gains of", "calibrate again"),
    "tyres": (
        ["lab", "validate", "log.csv", "--tyres"],
        "tyres.json",
        "not tyres of",
        "identify again",
    ),
    "vehicle": (["compare", "log.csv", "--vehicle"], "car.toml", "not a vehicle file", "mass_kg"),
    "later vehicle": (
        ["changed", "log.csv", "--after", "log.csv", "--vehicle", "car.toml", "--vehicle-after"],
        "car.toml",
        "not a vehicle file",
        "mass_kg",
    ),
    "channels": (
        ["compare", "log.csv", "--vehicle", "car.toml", "--channels"],
        "map.toml",
        "not a channel map",
        "[channels]",
    ),
    "manifest": (
        ["improve-many", "--out", "out"],
        "fleet.toml",
        "not a manifest of improve-many",
        "vehicle and logs",
    ),
    "define": (["effects", "--define"], "log.csv", "not a Python file", "give the file"),
}


@pytest.mark.parametrize(
    ("asked", "name"), [(a, n) for a in ASKED for n in KINDS if n != ASKED[a][1]]
)
def test_another_kind_of_file_is_named_with_what_to_give(
    asked: str,
    name: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    argv, _, wanted, remedy = ASKED[asked]
    monkeypatch.chdir(folder)
    assert main([*argv, name]) == 2
    err = capsys.readouterr().err
    error = err[err.index("sysid-vehicle: error: ") :]
    assert error.startswith(f"sysid-vehicle: error: {name}: is {KINDS[name]}")
    assert wanted in error
    assert remedy in error
    assert "as a Python program" not in err  # nothing was run


@pytest.mark.parametrize("name", ["car.toml", "map.toml", "fleet.toml", "study.json", "model.npz"])
@pytest.mark.parametrize("command", [["map"], ["compare", "--vehicle", "car.toml"]])
def test_what_is_no_log_is_not_read_as_one(
    command: list[str],
    name: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    assert main([command[0], name, *command[1:]]) == 2
    assert f"{name}: is {KINDS[name]}, no log; give the log of a drive" in capsys.readouterr().err


@pytest.mark.parametrize("asked", ["gains", "tyres"])
@pytest.mark.parametrize(
    ("name", "told"),
    [
        (
            "missing.json",
            "missing.json: cannot be read (No such file or directory); check the path",
        ),
        ("empty.json", "empty.json: is empty, not "),
        (".", ".: cannot be read (Is a directory); check the path"),
    ],
)
def test_a_file_that_is_not_there_is_told_as_that(
    asked: str,
    name: str,
    told: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    assert main([*ASKED[asked][0], name]) == 2
    assert capsys.readouterr().err.startswith(f"sysid-vehicle: error: {told}")


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ({"law": "gradient"}, "law = 'gradient'; calibrated are side-by-side, published"),
        ({"law": ["published"]}, "law = ['published']; calibrated are"),
        ({"gains": {"wheel": 0.1}}, "--law side-by-side has the gains wheel, ax_vx, ay_vy"),
        ({"gains": [1.0]}, "--law side-by-side has the gains wheel"),
        ({"gains": {**GAINS, "yaw": "x"}}, "gains.yaw = 'x'; give a number above 0"),
        ({"gains": {**GAINS, "yaw": float("nan")}}, "gains.yaw = nan; give a number above 0"),
        ({"gains": {**GAINS, "wheel": -1.0}}, "gains.wheel = -1.0; give a number above 0"),
    ],
)
def test_gains_that_no_calibration_wrote_are_refused(
    content: dict[str, object], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.json"
    path.write_text(json.dumps({**CALIBRATED, **content}))
    assert main(["twin", "validate", "--gains", str(path)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"sysid-vehicle: error: {path}: {told}")
    assert "calibrate again" in error


def test_a_folder_defines_no_effect(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects", "--define", str(tmp_path)]) == 2
    assert "is a folder, not a Python file that defines effects; give the file" in (
        capsys.readouterr().err
    )
