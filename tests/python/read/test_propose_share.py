"""Steering in percent of full lock, as model cars and some buses send it."""

from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv

FULL_RAD = 0.6


@pytest.mark.parametrize("name", ["Steering [%]", "steer_percent"])
def test_a_share_of_full_lock_is_no_angle_in_degrees(tmp_path: Path, name: str) -> None:
    car = sv.example_vehicle()
    log = sv.drive(sv.Model(car), sv.manoeuvres.lap(), seed=472811)
    columns = {c: log[c] for c in log.channels if c != "steer_rad"}
    columns[name] = 100.0 / FULL_RAD * log["steer_rad"]
    path = tmp_path / "log.csv"
    rows = np.column_stack([*columns.values()])
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="")
    found = sv.propose_channels(path, vehicle=car).channels["steer_rad"]
    assert found.column == name
    assert found.factor == pytest.approx(FULL_RAD / 100.0, rel=0.16)
    assert "a share of the full angle" in found.why
