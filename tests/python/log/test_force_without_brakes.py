"""A wheel force that is that of the motor alone: the mass is none to be blamed."""

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import InvalidInput
from sysid_vehicle.log.against_car import check_car


def held(truth: sv.Model, least_n: float, seed: int = 3879, ax: bool = True) -> sv.Log:
    """A drive of which the force of the wheels is logged from some value on."""
    driven = sv.drive(truth, sv.manoeuvres.lap(45.0, 7.0), seed=seed)
    columns = {c: driven[c] for c in driven.channels if ax or c != "ax_mps2"}
    columns["fx_n"] = np.maximum(columns["fx_n"], least_n)
    return sv.Log.from_arrays(columns, name="motor", check=False)


@pytest.mark.parametrize("least_n", [0.0, -1500.0], ids=["no brakes", "recuperation alone"])
@pytest.mark.parametrize("ax", [True, False])
def test_missing_brakes_are_told(truth: sv.Model, least_n: float, ax: bool) -> None:
    car = truth.vehicle
    with pytest.raises(InvalidInput, match="motor: fx_n holds what drives the car in full") as told:
        check_car(held(truth, least_n, ax=ax), mass_kg=car.mass_kg, wheelbase_m=car.wheelbase_m)
    assert "the force of the brakes is missing" in str(told.value)
    assert "pounds" not in str(told.value)
    assert ("leave it out" in str(told.value)) == ax


@pytest.mark.parametrize(
    "values",
    [
        {"aero_drag.drag_area_m2": 1.2},
        {"road_grade.grade_rad": 0.06},
        {"force_gain.brake_error": -0.25},
        {"head_wind.speed_mps": 12.0},
    ],
    ids=str,
)
def test_what_brakes_beside_the_wheels_is_none(truth: sv.Model, values: dict[str, float]) -> None:
    """Drag, slopes, and a gain within what is usual."""
    hidden = truth.add(next(iter(values)).partition(".")[0]).with_values(values)
    log = held(hidden, -np.inf, seed=35528)
    check_car(log, mass_kg=truth.vehicle.mass_kg, wheelbase_m=truth.vehicle.wheelbase_m)
