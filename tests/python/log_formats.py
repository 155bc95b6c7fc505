"""What the tests of log formats share: channels of two rates, and what has to come out."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.log import Log
from sysid_vehicle.read import read_log

Columns = dict[str, np.ndarray]

FAST = np.arange(400) * 0.01
SLOW = np.arange(80) * 0.05
MAP = {
    "vx_mps": "Speed",
    "yaw_rate_radps": "YawRate",
    "ax_mps2": "LongAcc",
    "ay_mps2": "LatAcc",
    "steer_rad": "Steer",
}


def measured(time_s: np.ndarray) -> Columns:
    """Smooth functions of time, no car, in the units of loggers: deg/s, g, km/h."""
    return {
        "YawRate": 10.0 * np.sin(time_s),
        "LongAcc": 0.05 * np.cos(time_s),
        "LatAcc": 0.4 * np.sin(time_s + 0.1),
        "Steer": 0.05 * np.sin(time_s),
        "Speed": 72.0 + 3.0 * time_s,
    }


DBC = """VERSION ""
NS_ :
BS_:
BU_: ECU
BO_ 256 Motion: 8 ECU
 SG_ YawRate : 0|16@1- (0.001,0) [-32|32] "deg/s" ECU
 SG_ LongAcc : 16|16@1- (0.0001,0) [-3|3] "g" ECU
 SG_ LatAcc : 32|16@1- (0.0001,0) [-3|3] "g" ECU
 SG_ Steer : 48|16@1- (0.00001,0) [-0.3|0.3] "rad" ECU
"""
"""A database of CAN frames with all but the speed."""

UNITS = {"YawRate": "deg/s", "LongAcc": "g", "LatAcc": "g", "Steer": "rad", "Speed": "km/h"}
FACTORS = {"vx_mps": 1 / 3.6, "yaw_rate_radps": np.pi / 180, "ax_mps2": 9.80665, "ay_mps2": 9.80665}


def read_told(source: Any, channels: Any = MAP, **options: Any) -> Log:
    with pytest.warns(SysidWarning, match="the file states"):
        return read_log(source, channels, check=False, **options)


def check_values(log: Log, slow: tuple[str, ...] = ("vx_mps",), atol: float = 1e-9) -> None:
    """Every channel holds what was written, in its own samples and nowhere else."""
    assert log.rate_hz == pytest.approx(100.0, rel=1e-6)
    for channel, source in MAP.items():
        known = np.isfinite(log[channel])
        assert np.count_nonzero(known) == (SLOW.size if channel in slow else FAST.size), channel
        exact = FACTORS.get(channel, 1.0) * measured(log["time_s"][known])[source]
        np.testing.assert_allclose(log[channel][known], exact, atol=atol, rtol=0.0)


def table() -> Columns:
    """All channels in rows; the slow one is empty in between."""
    columns = {"time_s": FAST, **measured(FAST)}
    columns["Speed"] = np.where(np.arange(FAST.size) % 5 == 0, columns["Speed"], np.nan)
    return columns


SI: dict[str, Any] = {c: {"column": n, "factor": FACTORS.get(c, 1.0)} for c, n in MAP.items()}
TIMED = {**SI, "time_s": "Time"}
NAMES = ["Time", *UNITS]


def cells(missing: str | None = None) -> list[list[str]]:
    """Rows of cells; with `missing`, four of five of the speed are that word."""
    rows = [[f"{t:.2f}", *(f"{measured(t)[n]:.9f}" for n in UNITS)] for t in FAST]
    for k, row in enumerate(rows):
        if missing is not None and k % 5:
            row[NAMES.index("Speed")] = missing
    return rows


def write(folder: Path, *lines: str) -> Path:
    path = folder / "run.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
