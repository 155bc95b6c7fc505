"""Which studies are asked for: arguments and manifests that make sense, and that make none."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from side_wind import side_wind

import sysid_vehicle as sv
from sysid_vehicle.cli import main
from sysid_vehicle.fleet import manifest_jobs
from sysid_vehicle.model import NUISANCES


@pytest.fixture(scope="module")
def garage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A car, logs in folders of two cars that nobody reads, and a manifest."""
    folder = tmp_path_factory.mktemp("garage")
    sv.example_vehicle().to_toml(folder / "car.toml")
    for name in ("a/one", "a/two", "b/bad", "b/one"):
        (folder / "logs" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "logs" / f"{name}.csv").touch()
    (folder / "fleet.toml").write_text(
        'vehicle = "car.toml"\nlogs = "logs/*/*.csv"\n[improve]\ncandidates = []\nstarts = 1\n'
    )
    return folder


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"logs": []}, "there are no logs"),
        ({"logs": ["x.csv", "y/x.csv"]}, "two studies are called 'x'"),
        ({"logs": {"../x": "x.csv"}}, "is no name of a study"),
        ({"logs": {"a/b/c": "x.csv"}}, "is no name of a study"),
        ({"logs": {"x": 3}}, "x: 3 is no log|not iterable"),
        ({"logs": ["x.csv"], "start": 1}, r"unknown key 'start' \(did you mean 'starts'"),
        ({"logs": ["x.csv"], "sensors": 3}, "improve_many: sensors: .*give False"),
        ({"logs": {"a/X": "x.csv", "a/x": "y.csv"}}, "'a/X' and 'a/x' are one file on some"),
        ({"logs": {"x": "x.csv"}, "validation": {"y": "y.csv"}}, "unknown key 'y'"),
        ({"logs": {"x": "x.csv"}, "cars": {"y": sv.example_vehicle()}}, "no car is given"),
        ({"logs": ["x.csv"], "workers": 0}, "workers = 0"),
        ({"logs": ["x.csv"], "candidates": ["aero_darg"]}, "'aero_darg' .did you mean 'aero_drag'"),
        ({"logs": ["x.csv"], "exclude": ["aero_darg"]}, "'aero_darg' .did you mean 'aero_drag'"),
        ({"logs": ["x.csv"], "exclude": "aero_drag"}, r"exclude = 'aero_drag': give a list"),
        ({"logs": ["x.csv"], "candidates": 3}, r"improve: candidates = 3 \(int\); give a list"),
        ({"logs": ["x.csv"], "matters": {"yaw": 1.0}}, "matters: 'yaw' is no channel"),
        ({"logs": ["x.csv"], "alpha": 2.0}, "alpha = 2.0: give a number between 0 and 1"),
        ({"logs": ["x.csv"], "rules": {"alpha": 0.1}}, "improve: rules = .*give a Rules"),
        ({"logs": ["x.csv"], "seed": "one"}, "seed = 'one': give a whole number"),
        ({"logs": ["x.csv"], "starts": 0}, "starts = 0: give a whole number, 1 or more"),
        ({"logs": ["x.csv"], "most_effects": -1}, "most_effects = -1"),
        ({"logs": ["x.csv"], "time_limit_s": 0}, "time_limit_s = 0"),
        ({"logs": ["x.csv"], "define": ["none.py"]}, "none.py"),
    ],
)
def test_arguments_are_checked_first(
    arguments: dict[str, Any], message: str, tmp_path: Path
) -> None:
    given = {"cars": sv.example_vehicle(), "out": tmp_path / "out", **arguments}
    with pytest.raises((sv.InvalidInput, TypeError), match=message):
        sv.improve_many(**given)
    assert not (tmp_path / "out").exists()


def test_a_manifest_may_stand_in_a_folder_named_like_a_pattern(tmp_path: Path) -> None:
    folder = tmp_path / "day [1] of *"
    (folder / "logs").mkdir(parents=True)
    sv.example_vehicle().to_toml(folder / "car.toml")
    (folder / "logs/one.csv").touch()
    (folder / "fleet.toml").write_text(
        'vehicle = "car.toml"\nlogs = "logs/*.csv"\n[improve]\nsensors = false\n'
    )
    (job,) = manifest_jobs(folder / "fleet.toml")
    assert (job.name, job.train) == ("one", (folder / "logs/one.csv",))
    assert job.options == {"sensors": False}


def test_a_manifest_names_its_studies(garage: Path, tmp_path: Path) -> None:
    jobs = manifest_jobs(garage / "fleet.toml")
    assert [job.name for job in jobs] == ["a/one", "a/two", "b/bad", "b/one"]
    assert jobs[0].options == {"candidates": [], "starts": 1}
    assert jobs[0].train == (garage / "logs/a/one.csv",)
    (garage / "two.toml").write_text(
        'vehicle = "car.toml"\nlogs = ["logs/a/one.csv"]\nnuisances = true\n'
        '[[study]]\nname = "c/both"\nlogs = ["logs/a/one.csv", "logs/a/two.csv"]\n'
        'validation = "logs/b/one.csv"\nnuisances = ["gyro_bias"]\n'
    )
    one, both = manifest_jobs(garage / "two.toml")
    assert one.model.nuisances == NUISANCES
    assert both.model.nuisances == ("gyro_bias",)
    assert jobs[0].model.nuisances == ()
    assert (one.name, both.name, both.car) == ("one", "c/both", "c")
    assert len(both.train) == 2
    assert both.validation == (garage / "logs/b/one.csv",)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "it names no log"),
        ('vehicle = "car.toml"\nlogs = "none/*.csv"', r"no file matches logs = 'none/\*.csv'"),
        ('logs = "logs/a/*.csv"', r"study 1 \(one\): it has no car"),
        ('vehicle = "no.toml"\nlogs = "logs/a/*.csv"', "no.toml: cannot be read"),
        ('vehicle = "car.toml"\nlog = "logs/a/*.csv"', r"unknown key 'log' \(did you mean 'logs'"),
        ('vehicle = "car.toml"\nlogs = 3', "logs = 3; give a path in quotes"),
        ('vehicle = "car.toml"\nlogs = "logs/*/one.csv"\n[improve]\nx = 1', "unknown key 'x'"),
        ('vehicle = "car.toml"\nlogs = ["logs/a/one.csv", "logs/b/one.csv"]', "called 'one'"),
        ('vehicle = "car.toml"\n[[study]]\nname = "x"', r"study 1 \(x\): it has no logs"),
        ('vehicle = 1\nlogs = "logs/a/*.csv"', "vehicle = 1 is no path"),
        (
            'vehicle = "car.toml"\nlogs = "logs/a/*.csv"\nnuisances = "gyro"',
            "nuisances = 'gyro'; give true for the usual ones",
        ),
        ("study = 1", "is no list of tables"),
        ("improve = 1", "improve is no table"),
    ],
)
def test_a_manifest_that_makes_no_sense(garage: Path, text: str, message: str) -> None:
    (garage / "wrong.toml").write_text(text)
    with pytest.raises(sv.InvalidInput, match=message):
        manifest_jobs(garage / "wrong.toml")


def test_effects_are_named_once_those_of_files_are_known(
    garage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A name that nothing defines is refused before any study, with the nearest one of a file."""
    (garage / "own.py").write_text(side_wind("wind_of_a_fleet"))

    def asked(name: str) -> str:
        (garage / "own.toml").write_text(
            'vehicle = "car.toml"\nlogs = "logs/b/bad.csv"\ndefine = "own.py"\n'
            f'[improve]\ncandidates = ["{name}"]\n'
        )
        out = tmp_path / name
        try:
            assert main(["improve-many", str(garage / "own.toml"), "--out", str(out)]) == 2
        finally:
            sv.forget_effect("wind_of_a_fleet")
        assert out.exists() == (name == "wind_of_a_fleet")
        return capsys.readouterr().err.splitlines()[-1]

    assert asked("wind_of_a_flet").startswith(
        "sysid-vehicle: error: no effect is called 'wind_of_a_flet' (did you mean 'wind_of_a_fleet'"
    )
    assert "error: 1 of 1 studies failed; " in asked("wind_of_a_fleet")


def test_a_fleet_of_which_nothing_could_be_done_is_no_success(
    garage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its report is there all the same."""
    asked = ["improve-many", str(garage / "fleet.toml"), "--out", str(tmp_path), "--workers", "1"]
    assert main(asked) == 2
    out, err = capsys.readouterr()
    assert "Failed: a/one: " in out
    assert (tmp_path / "report.html").exists()
    assert err.splitlines()[-1].startswith("sysid-vehicle: error: 4 of 4 studies failed; ")


def test_one_study_that_failed_shows_in_the_status(
    garage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Scripts do not read what was printed."""
    asked = ["improve-many", str(garage / "fleet.toml"), "--out", str(tmp_path)]
    good, bad = SimpleNamespace(failure=""), SimpleNamespace(failure="no steer_rad")
    for rows, status in (((good, good), 0), ((good, bad), 2)):
        fleet = SimpleNamespace(
            done=[r for r in rows if not r.failure], failed=[r for r in rows if r.failure]
        )
        monkeypatch.setattr("sysid_vehicle.cli.fleet.improve_all", lambda *_, f=fleet, **__: f)
        assert main(asked) == status
