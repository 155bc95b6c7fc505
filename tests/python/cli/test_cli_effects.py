"""The command that prints the catalogue."""

from dataclasses import replace
from pathlib import Path

import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli import main


def test_the_whole_catalogue_is_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects"]) == 0
    out = capsys.readouterr().out
    for e in sv.catalogue():
        assert f"{e.id}: {e.title}" in out
        assert e.excited_by in out
        for p in e.parameters:
            assert f"{p.name} [{p.unit}]" in out


def test_those_that_are_named_are_printed_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects", "body_roll", "mass"]) == 0
    told = [line for line in capsys.readouterr().out.splitlines() if line[:1].strip()]
    assert [line.partition(":")[0] for line in told] == ["body_roll", "mass"]
    assert main(["effects", "body_rol"]) == 2
    assert "body_roll" in capsys.readouterr().err


def test_sizes_are_those_of_the_car_that_is_given(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    car = replace(sv.example_vehicle(), mass_kg=3.7, lf_m=0.16, lr_m=0.17, yaw_inertia_kgm2=None)
    car.to_toml(tmp_path / "car.toml")
    assert main(["effects", "tyre_relaxation"]) == 0
    assert "typically 0.45 " in capsys.readouterr().out
    assert main(["effects", "tyre_relaxation", "--vehicle", str(tmp_path / "car.toml")]) == 0
    assert "typically 0.07425 (0.033 to 0.1155)" in capsys.readouterr().out
