"""`sysid-vehicle lab run`."""

import argparse
import dataclasses
import json
import warnings
from pathlib import Path

import pytest

from sysid_vehicle import Log, example_vehicle, read_log
from sysid_vehicle.cli import main
from sysid_vehicle.cli.lab_logs import vehicle_of
from sysid_vehicle.lab import GreyBoxVehicle
from sysid_vehicle.lab.tyres.fit import NOISES, PARAMETERS


def test_it_drives_previews_and_writes_all_that_was_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = {key: tmp_path / f"out.{key}" for key in ("csv", "svg", "json")}
    status = main(
        [
            *("lab", "run", "--excitation", "weaving", "--duration", "12", "--preview"),
            *("--effects", "gyro_bias", "--log", str(files["csv"]), "--plot", str(files["svg"])),
            *("--json", str(files["json"])),
        ]
    )
    assert status == 0
    shown = capsys.readouterr().out
    assert "What weaving will teach" in shown
    assert "weaving in 'laboratory': 12 s" in shown
    log = read_log(files["csv"])
    assert log.duration_s == pytest.approx(12.0)
    assert log["yaw_rate_radps"].mean() == pytest.approx(0.006, abs=0.004)
    assert files["svg"].read_text().lstrip().startswith("<?xml")
    figures = json.loads(files["json"].read_text())
    assert figures["excitation"] == "weaving"
    assert len(figures["expected"]) == 8


def test_it_drives_the_published_laboratory(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lab", "run", "--preset", "published", "--duration", "20"]) == 0
    assert "identification in 'published': 20 s" in capsys.readouterr().out


def test_it_drives_a_car_from_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "car.toml"
    example_vehicle().replace(yaw_inertia_kgm2=1750.0).to_toml(path)
    assert main(["lab", "run", "--excitation", "lap", "--vehicle", str(path), "--seed", "3"]) == 0
    assert "lap in 'laboratory': 60 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--excitation", "weavin"], "did you mean 'weaving'?"),
        (["--excitation", "slalom", "--duration", "5"], "has a length of its own"),
        (["--effects", "steer_lagg"], "steer_lag"),
        (["--seed", "-1"], "--seed -1"),
        (["--log", "/nowhere/at/all.csv"], "does not exist"),
        (["--plot", "drive.png"], "end the name in .svg"),
        (["--preset", "published", "--vehicle", "car.toml"], "leave --vehicle out"),
    ],
)
def test_what_makes_no_sense_is_one_line_and_status_2(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["lab", "run", *arguments]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def test_the_published_car_is_not_taken_in_silence(tmp_path: Path) -> None:
    args = argparse.Namespace(vehicle=None)
    with pytest.warns(UserWarning, match=r"no --vehicle was given: .* the published car"):
        taken = vehicle_of(args)
    taken.to_toml(tmp_path / "car.toml")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert vehicle_of(argparse.Namespace(vehicle=tmp_path / "car.toml")) == taken


@pytest.mark.parametrize("command", ["identify", "em"])
def test_logs_of_another_car_are_refused(
    command: str, lap: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With its mass a search took minutes, and gave stiffness to a tenth of a per cent."""
    lap.to_csv(tmp_path / "lap.csv")
    light = example_vehicle().replace(mass_kg=400.0, yaw_inertia_kgm2=600.0)
    light.to_toml(tmp_path / "car.toml")
    asked = ["lab", command, str(tmp_path / "lap.csv"), "--vehicle", str(tmp_path / "car.toml")]
    assert main(asked) == 2
    assert "lap: mass_kg = 400, but fx_n moves the car as if it had 12" in capsys.readouterr().err


def test_a_stiffness_that_no_tyre_has_is_refused_by_its_name(
    lap: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lap.to_csv(tmp_path / "lap.csv")
    example_vehicle().to_toml(tmp_path / "car.toml")
    asked = ["lab", "em", str(tmp_path / "lap.csv"), "--vehicle", str(tmp_path / "car.toml")]
    assert main([*asked, "--stiffness", "15", "0"]) == 2
    assert "--stiffness 15 0: give two numbers above 0" in capsys.readouterr().err


def test_validation_on_another_car_is_refused(
    lap: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lap.to_csv(tmp_path / "lap.csv")
    other = dataclasses.asdict(GreyBoxVehicle(400.0, 600.0, 1.25, 1.35))
    tyres = [10.0, 1.4, 1.0, 0.0] * 2
    values = [*tyres, 0.0, 0.0, 0.0, 1.0, 1.0, 0.5, 0.0]
    told = {
        "vehicle": other,
        "parameters": dict(zip(PARAMETERS, values, strict=True)),
        "noise": dict.fromkeys(NOISES, 0.01),
    }
    (tmp_path / "tyres.json").write_text(json.dumps(told))
    asked = ["lab", "validate", str(tmp_path / "lap.csv"), "--tyres", str(tmp_path / "tyres.json")]
    assert main(asked) == 2
    assert "lap: mass_kg = 400, but fx_n moves the car as if it had 12" in capsys.readouterr().err
    assert main([*asked, "--unchecked"]) == 0
