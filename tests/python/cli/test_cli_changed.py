"""The command that tells what changed between two drives."""

import json
from pathlib import Path

import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli import main

RATE_HZ = 50.0
BIAS_RADPS = 0.02


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A vehicle file, a drive, and a later one with a biased gyro."""
    path = tmp_path_factory.mktemp("changed")
    car = sv.Model(sv.example_vehicle())
    car.vehicle.to_toml(path / "car.toml")
    later = car.add("gyro_bias").with_values({"gyro_bias.bias_radps": BIAS_RADPS})
    sv.drive(car, sv.manoeuvres.lap(25.0), seed=1, rate_hz=RATE_HZ).to_csv(path / "then.csv")
    sv.drive(later, sv.manoeuvres.lap(25.0), seed=2, rate_hz=RATE_HZ).to_csv(path / "now.csv")
    return path


def test_what_changed_is_printed_and_written(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    then, now, car, figures = (folder / n for n in ("then.csv", "now.csv", "car.toml", "out.json"))
    status = main(
        [
            *("changed", str(then), "--after", str(now), "--vehicle", str(car)),
            *("--json", str(figures)),
        ]
    )
    assert status == 0
    assert capsys.readouterr().out.startswith("changed: gyro_bias: bias_radps +0.0")
    told = json.loads(figures.read_text(encoding="utf-8"))
    bias = told["effects"]["gyro_bias"]
    assert bias["said"] == "changed"
    found = bias["change"]["bias_radps"]
    assert abs(found["value"] - BIAS_RADPS) < 4.0 * found["std"]
    assert "warnings" in told


def test_another_vehicle_file_is_the_later_car(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle = sv.Vehicle.from_toml(folder / "car.toml")
    heavier = tmp_path / "heavier.toml"
    vehicle.replace(mass_kg=1500.0).to_toml(heavier)
    asked: list[tuple[sv.Fit, list[sv.Log], sv.Vehicle | None]] = []

    def kept(
        before: sv.Fit,
        after: list[sv.Log],
        *,
        vehicle: sv.Vehicle | None,
        time_limit_s: float | None,
    ) -> None:
        assert time_limit_s is None
        asked.append((before, after, vehicle))
        raise sv.SysidError("asked")

    monkeypatch.setattr("sysid_vehicle.cli.changed.changed", kept)
    argv = ["changed", str(folder / "then.csv"), "--after", str(folder / "now.csv")]
    argv += ["--vehicle", str(folder / "car.toml"), "--effects", "steer_lag"]
    assert main([*argv, "--vehicle-after", str(heavier)]) == 2
    ((before, after, later),) = asked
    assert before.model.effects == ("steer_lag",)
    assert [log.name for log in (*before.driving.logs, *after)] == ["then", "now"]
    assert later is not None
    assert later.mass_kg == 1500.0
    assert before.model.vehicle == vehicle


def test_the_later_drives_are_needed_and_read_like_the_others(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = ["changed", str(folder / "then.csv"), "--vehicle", str(folder / "car.toml")]
    with pytest.raises(SystemExit):
        main(argv)
    assert "--after" in capsys.readouterr().err
    assert main([*argv, "--after", str(folder / "car.toml")]) == 2
    assert "car" in capsys.readouterr().err


def test_a_time_limit_ends_the_command_and_says_what_it_left_out(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    then, now, car, figures = (folder / n for n in ("then.csv", "now.csv", "car.toml", "few.json"))
    asked = ["changed", str(then), "--after", str(now), "--vehicle", str(car)]
    assert main([*asked, "--json", str(figures), "--time-limit", "0.001"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("no change is shown by what was tried in time")
    assert "the time limit ended the comparison: " in err
    assert "the time limit ended the fit: the likelihood was not followed to its maximum" in err
    assert "ended the fit of the reference: what it lacks may look like a change" in err
    told = json.loads(figures.read_text(encoding="utf-8"))
    assert any("gyro_bias" in fact for fact in told["late_facts"])
    assert told["effects"]["gyro_bias"]["said"] != "unchanged"


def test_a_time_limit_is_above_zero(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["changed", "a.csv", "--after", "b.csv", "--vehicle", "c.toml", "--time-limit", "0"]
    with pytest.raises(SystemExit):
        main(asked)
    assert "seconds (above 0)" in capsys.readouterr().err
