"""The command that prints the catalogue."""

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
