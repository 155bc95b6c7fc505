"""Proposed maps of logs with gaps, and of logs in which nothing drives the car."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli.main import main

CAR = sv.example_vehicle()
NAMES = {
    "time_s": "time",
    "vx_mps": "vx",
    "vy_mps": "vy",
    "yaw_rate_radps": "yaw_rate",
    "ax_mps2": "ax",
    "ay_mps2": "ay",
    "steer_rad": "delta",
}


@pytest.fixture(scope="module")
def driven() -> dict[str, np.ndarray]:
    truth = sv.Model(CAR).add("tyre_load_sensitivity")
    truth = truth.with_values({"tyre_load_sensitivity.sensitivity": 0.25})
    log = sv.drive(truth, sv.manoeuvres.lap(), seed=417231)
    return {name: np.array(log[channel]) for channel, name in NAMES.items()}


def test_what_lies_between_two_ends_of_a_gap_is_no_driving(driven: dict[str, np.ndarray]) -> None:
    """Steering that was drawn across a gap asked for twice the wheelbase (1.7 to 2.3)."""
    there = (driven["time"] < 20.0) | (driven["time"] > 31.0)
    gap = {name: values[there] for name, values in driven.items()}
    why = sv.propose_channels(gap, vehicle=CAR).channels["steer_rad"].why
    found = re.search(r"about \S+ \((\S+) to (\S+)\) times", why)
    assert found is not None
    assert float(found[1]) < 1.0 < float(found[2])
    assert "check both" not in why


def test_a_map_without_a_pull_says_so(
    driven: dict[str, np.ndarray], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The map looked complete, and the log was refused."""
    columns = {name: values for name, values in driven.items() if name != "ax"}
    text = np.column_stack(list(columns.values()))
    np.savetxt(tmp_path / "log.csv", text, delimiter=",", header=",".join(columns), comments="")
    assert main(["map", str(tmp_path / "log.csv")]) == 0
    shown = capsys.readouterr()
    assert "# ax_mps2 = {" in shown.out
    assert "# fx_n = {" in shown.out
    assert "ax_mps2, fx_n: no column was found for either" in shown.err


@pytest.mark.parametrize(
    ("name", "channel"),
    [("Fahrgeschwindigkeit", "vx_mps"), ("road_wheel_deg", "steer_rad")],
)
def test_usual_names_are_known(driven: dict[str, np.ndarray], name: str, channel: str) -> None:
    columns = {name if n == NAMES[channel] else n: v for n, v in driven.items()}
    assert sv.propose_channels(columns).channels[channel].column == name


@pytest.mark.parametrize("set_by_s", [3.0e4, 1.8e9])
def test_a_clock_that_is_set_while_it_records_is_a_gap(
    driven: dict[str, np.ndarray], set_by_s: float
) -> None:
    """Times were filled up from the year 1970 on."""
    late = driven["time"] > 25.0
    columns = driven | {"time": np.where(late, set_by_s + driven["time"], driven["time"])}
    found = sv.propose_channels(columns, vehicle=CAR).channels
    as_it_was = sv.propose_channels(driven, vehicle=CAR).channels
    assert {n: c.factor for n, c in found.items()} == {n: c.factor for n, c in as_it_was.items()}


@pytest.mark.parametrize("mistake", ["set back to zero", "recorded twice", "wrong order"])
def test_times_that_go_back_hide_no_steering_wheel(
    driven: dict[str, np.ndarray], mistake: str
) -> None:
    """The map had the factor of road wheels, 15 times too large, and did not say so."""
    half = driven["time"].size // 2
    rows = {
        "set back to zero": slice(None),
        "recorded twice": np.repeat(np.arange(2 * half), 2),
        "wrong order": np.r_[half : 2 * half, 0:half],
    }[mistake]
    columns = {name: values[rows] for name, values in driven.items()}
    if mistake == "set back to zero":
        columns["time"] = np.r_[driven["time"][:half], driven["time"][: -half or None]]
    columns["steering_wheel_deg"] = np.degrees(15.5 * columns.pop("delta"))
    steer = sv.propose_channels(columns, vehicle=CAR).channels["steer_rad"]
    assert "angle of the steering wheel" in steer.why
    assert 10.0 < np.radians(1.0) / steer.factor < 23.0  # half a lap tells it to a third


def test_a_log_of_a_moment_has_a_map(driven: dict[str, np.ndarray]) -> None:
    """A mean of nothing was warned of by numpy."""
    begin = {name: values[driven["time"] < 0.35] for name, values in driven.items()}
    found = sv.propose_channels(begin, vehicle=CAR).channels
    assert {c: found[c].column for c in ("vx_mps", "vy_mps")} == {"vx_mps": "vx", "vy_mps": "vy"}
