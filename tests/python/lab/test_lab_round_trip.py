"""What the closed loop writes is read again as a log, whatever was driven and however long."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import published
from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.lab import excitation, run_closed_loop
from sysid_vehicle.lab.excitation import Excitation

DURATIONS_S = (60.0, 120.0, 200.0)


def of_length(e: Excitation, duration_s: float) -> Excitation:
    """Make the same excitation of another length."""
    if e.name == "speed_ramp":
        return excitation.speed_ramp(duration_s=duration_s)
    if e.name == "multi_sine":
        return excitation.multi_sine(duration_s=duration_s)
    return dataclasses.replace(e, duration_s=duration_s)  # type: ignore[type-var]


ALL = {**published.excitations(), **excitation.all()}
# A manoeuvre has the length that follows from its own parameters.
OF_ANY_LENGTH = [n for n, e in ALL.items() if not isinstance(e, excitation.OnManoeuvre)]
CASES = [pytest.param(e, id=name) for name, e in ALL.items() if name not in OF_ANY_LENGTH] + [
    pytest.param(of_length(ALL[name], duration_s), id=f"{name}-{duration_s:g}s")
    for name in OF_ANY_LENGTH
    for duration_s in DURATIONS_S
]


def test_lengths_are_tried_on_every_excitation_that_takes_one() -> None:
    assert set(OF_ANY_LENGTH) == {"identification", "oval", "speed_ramp", "multi_sine", "weaving"}


# Warnings are errors in these tests: a log that is read with one fails.
@pytest.mark.parametrize("asked", CASES)
def test_a_drive_is_read_again_without_error_or_warning(asked: Excitation, tmp_path: Path) -> None:
    drive = run_closed_loop(asked, seed=4)
    assert drive.lost_s is None
    assert drive.time_s[-1] == pytest.approx(asked.duration_s, abs=0.01)
    written = drive.to_log()
    path = tmp_path / "drive.csv"
    written.to_csv(path)
    if asked.name == "straight_acceleration":  # has no corner, which reading it has to say
        with pytest.warns(SysidWarning, match="not excited") as heard:
            read = sv.read_log(path)
        assert len(heard) == 1
    else:
        read = sv.read_log(path)
    assert read.n == written.n
    assert read.rate_hz == pytest.approx(written.rate_hz)
    assert set(read.channels) == set(written.channels)
    for name in written.channels:
        np.testing.assert_allclose(read[name], written[name], rtol=1e-9, atol=1e-9, err_msg=name)
