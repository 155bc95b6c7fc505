"""Who says that the ground is level is told of no slope of the road."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli import commands, main
from sysid_vehicle.sensors import ready

BANK = {"road_bank.bank_rad": 0.03}


@pytest.fixture(scope="module")
def logs() -> tuple[sv.Log, sv.Log]:
    truth = sv.Model(sv.example_vehicle()).add("road_bank").with_values(BANK)
    lap = sv.drive(truth, sv.manoeuvres.lap(25.0), seed=930421, rate_hz=25.0)
    course = sv.manoeuvres.handling_course(25.0)
    return lap, sv.drive(truth, course, seed=930422, rate_hz=25.0)


@pytest.mark.parametrize("level", [False, True])
def test_a_slope_is_considered_unless_the_ground_is_level(
    logs: tuple[sv.Log, sv.Log], level: bool
) -> None:
    some = ["road_bank", "road_grade", "accelerometer_bias"]
    model = sv.Model(sv.example_vehicle())
    study = sv.improve(model, *logs, candidates=some, starts=1, sensors=False, level=level)
    assert ("road_bank" in [a.id for a in study.added]) == (not level)
    assert {"road_bank", "road_grade"}.isdisjoint(v.effect.id for v in study.verdicts.all) == level


def test_the_readings_are_taken_as_those_of_level_ground(
    logs: tuple[sv.Log, sv.Log], monkeypatch: pytest.MonkeyPatch
) -> None:
    heard: list[bool] = []
    checked = ready.checked

    def listening(*args: Any, **asked: Any) -> Any:
        heard.append(asked["level"])
        return checked(*args, **asked)

    monkeypatch.setattr(ready, "checked", listening)
    model, some = sv.Model(sv.example_vehicle()), ["accelerometer_bias"]
    short = [log.between(0.0, 22.0) for log in logs]
    sv.improve(model, *short, candidates=some, starts=1, level=True)
    assert heard == [True]


def test_axle_forces_pass_it_on(logs: tuple[sv.Log, sv.Log]) -> None:
    car, log = sv.example_vehicle(), logs[0].between(0.0, 15.0)
    gains = {level: sv.check(log, car, level=level)["gain_ay"] for level in (False, True)}
    for level, gain in gains.items():
        assert sv.axle_forces(log, car, level=level, count=2).sensors["gain_ay"] == gain
    assert gains[False] != gains[True]


@pytest.mark.parametrize("command", ["improve", "diagnose", "forces"])
def test_the_commands_pass_it_on(
    command: str,
    logs: tuple[sv.Log, sv.Log],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Heard(Exception):
        pass

    def stop(*_: Any, **asked: Any) -> None:
        raise Heard(asked["level"])

    monkeypatch.setattr(commands, "improve", stop)
    monkeypatch.setattr(commands.forces, "axle_forces", stop)
    logs[0].to_csv(tmp_path / "lap.csv")
    sv.example_vehicle().to_toml(tmp_path / "car.toml")
    asked = [command, str(tmp_path / "lap.csv"), "--vehicle", str(tmp_path / "car.toml")]
    for flags, level in (([], False), (["--level-ground"], True)):
        with pytest.raises(Heard, match=str(level)):
            main([*asked, *flags])
