"""A load changes mass, centre of gravity and yaw inertia: it is named as one change."""

import pytest

from sysid_vehicle import Model, changed, drive, identify, manoeuvres
from sysid_vehicle.diagnose.change.may_change import PAYLOAD, as_one


def test_a_load_is_named_by_what_it_changes(start: Model, truth: Model) -> None:
    """150 kg, 1.5 m behind the centre of gravity: mass, its place, and yaw inertia at once."""
    vehicle, more, place = truth.vehicle, 150.0, 1.5
    back = more * place / (vehicle.mass_kg + more)
    inertia = vehicle.mass_kg * back**2 + more * (place - back) ** 2
    loaded = truth.add(*PAYLOAD).with_values(
        {
            "mass.relative_error": more / vehicle.mass_kg,
            "cg_position.shift_rearward_m": back,
            "yaw_inertia.relative_error": inertia / vehicle.yaw_inertia_kgm2,
        }
    )
    known = identify(start, drive(truth, manoeuvres.lap(40.0), seed=5, rate_hz=50.0), starts=1)
    after = drive(loaded, manoeuvres.handling_course(30.0), seed=6, rate_hz=50.0)
    change = changed(known, after, candidates=(*PAYLOAD, "steer_ratio", "steer_offset"))
    assert {e.id for e in change.named} == set(PAYLOAD)
    load_told = change.load
    assert load_told is not None
    assert load_told.mass_kg == pytest.approx(more, abs=3.0 * load_told.mass_std_kg)
    assert load_told.rearward_m == pytest.approx(place, abs=3.0 * load_told.rearward_std_m)
    assert load_told.rearward_std_m < 0.2
    assert "as a load of 150" in str(change)


def test_a_sum_counts_as_one_change() -> None:
    assert as_one(("mass", "steer_ratio")) == [("mass",), ("steer_ratio",)]
    assert as_one(("steer_ratio", *PAYLOAD)) == [PAYLOAD, ("steer_ratio",)]
