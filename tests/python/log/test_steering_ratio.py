"""A steering ratio that is not the car's, by less than a factor of two."""

from __future__ import annotations

import re
import warnings

import pytest
from single_track import drive

import sysid_vehicle as sv
from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.log.against_car import check_car

CAR = sv.example_vehicle()


def told(log: sv.Log, times: float) -> list[str]:
    columns = {n: log[n] for n in log.channels} | {"steer_rad": times * log["steer_rad"]}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        wrong = sv.Log.from_arrays(columns, name="wrong")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SysidWarning)
        check_car(wrong, mass_kg=CAR.mass_kg, wheelbase_m=CAR.wheelbase_m)
    return [str(w.message) for w in caught]


@pytest.mark.parametrize("seed", [417231, 52118])
def test_a_ratio_of_38_for_20_is_told_and_the_right_one_is_not(seed: int) -> None:
    """Only what was off by more than a factor of two was told, however sure it was."""
    log = sv.drive(sv.Model(CAR), sv.manoeuvres.lap(lateral_mps2=5.0), seed=seed)
    assert told(log, 1.0) == []
    (said,) = told(log, 20.0 / 38.0)
    assert "the steering ratio is about 0.5" in said
    assert " to 0.8" in said  # the interval, which leaves one out


def test_what_is_not_sure_is_not_told() -> None:
    log = sv.drive(sv.Model(CAR), sv.manoeuvres.slalom(), seed=52119)
    assert told(log, 20.0 / 38.0) == []


def test_a_steering_wheel_is_told_with_what_its_ratio_may_be() -> None:
    """The car is not known there: of usual wheelbases and understeer follows a range."""
    data = drive()
    data["steer_rad"] *= 18.0
    with pytest.raises(sv.InvalidInput, match="put factor = 1 / steering ratio") as caught:
        sv.Log.from_arrays(data)
    low, high = map(float, re.findall(r"about ([\d.]+) to ([\d.]+)\)", str(caught.value))[0])
    assert low < 1.0 / 18.0 < high
