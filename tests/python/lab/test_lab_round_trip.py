"""What the closed loop writes is read again as a log, whatever was driven and however long."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import published
from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.lab import (
    GreyBoxVehicle,
    Setup,
    TyreLog,
    excitation,
    identify_tyres,
    run_closed_loop,
)
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
    pytest.param(
        of_length(ALL[name], duration_s),
        id=f"{name}-{duration_s:g}s",
        marks=pytest.mark.manual if duration_s == 120.0 else (),
    )
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


def test_tyres_of_a_car_whose_front_wheels_drive_and_brake() -> None:
    plain = Setup.default().plant.vehicle
    vehicle = plain.replace(drive_front_share=1.0, brake_front_share=0.65)
    hard = excitation.Weaving(lateral_mps2=14.0, swing_mps=7.0, swing_period_s=6.0, duration_s=12.0)
    drive = run_closed_loop(hard, Setup.of(sv.Model(vehicle)), seed=5)
    car = GreyBoxVehicle.of(vehicle)
    fit = identify_tyres(car, TyreLog.from_log(drive.to_log(), car), starts=1, profiles=False)
    assert fit["D_rear"].value == pytest.approx(vehicle.tyre_rear.D, rel=1e-3)
    assert fit["C_rear"].value == pytest.approx(vehicle.tyre_rear.C, rel=0.02)
    assert fit.noise[:4] == pytest.approx([0.1, 3.16e-3, 3.16e-3, 3.16e-3], rel=0.08)
    with pytest.raises(InvalidInput, match="drive_front_share is 2"):
        dataclasses.replace(car, drive_front_share=2.0)
