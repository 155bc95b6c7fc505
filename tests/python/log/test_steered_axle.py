"""A log of a vehicle that steers its rear axle, and of sensors that lie behind it."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.log.against_car import check_car

CAR = sv.example_vehicle()
LAP = sv.manoeuvres.lap(lateral_mps2=5.0)


@pytest.fixture
def rear_steered() -> Iterator[sv.Model]:
    """A car whose rear wheels steer, as `docs/howto/own_effect.md` makes it."""
    sv.define_effect(
        "rear_steering",
        title="the rear wheels steer, the front wheels do not",
        parameters=[
            sv.parameter("instead", "1", typical=1.0, lower=0.0, upper=1.0),
            sv.parameter("front", "1/rad", typical=10.0, lower=0.0, upper=60.0),
            sv.parameter("rear", "1/rad", typical=10.0, lower=0.0, upper=60.0),
        ],
        force_y_front=lambda d, p: (
            d.F_zf * np.tanh(p.front * (d.alpha_f - d.steer)) - p.instead * d.F_yf
        ),
        force_y_rear=lambda d, p: (
            d.F_zr * np.tanh(p.rear * (d.alpha_r - d.steer)) - p.instead * d.F_yr
        ),
    )
    values = {"instead": 1.0, "front": 12.0, "rear": 14.0}
    yield (
        sv.Model(CAR)
        .add("rear_steering")
        .with_values({f"rear_steering.{name}": value for name, value in values.items()})
    )
    sv.forget_effect("rear_steering")


def told(log: sv.Log) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SysidWarning)
        check_car(log, mass_kg=CAR.mass_kg, wheelbase_m=CAR.wheelbase_m, lf_m=CAR.lf_m)
    return [str(w.message) for w in caught]


@pytest.mark.parametrize("without", [(), ("vy_mps",)])
def test_a_vehicle_that_steers_its_rear_axle_is_told(
    rear_steered: sv.Model, without: tuple[str, ...]
) -> None:
    (said,) = told(sv.drive(rear_steered, LAP, seed=930411).without(*without))
    assert "lap: looks steered at the rear axle" in said
    assert "own_effect.md" in said
    assert ("ins_lever_arm" in said) == (not without)


def test_sensors_of_a_car_that_steers_its_front_axle_may_lie_at_its_rear() -> None:
    """On the rear axle and between the axles nothing is told; far behind the car it is."""
    for forward, many in ((0.0, 0), (-1.35, 0), (-2.9, 1)):
        truth = sv.Model(CAR).add("ins_lever_arm")
        log = sv.drive(truth.with_values({"ins_lever_arm.forward_m": forward}), LAP, seed=930412)
        said = told(log)
        assert len(said) == many
        assert all("the sensors lie 2." in text or "the sensors lie 3 m" in text for text in said)


def test_a_baseline_is_told_and_a_model_that_explains_it_is_not(rear_steered: sv.Model) -> None:
    log = sv.drive(rear_steered, LAP, seed=930413)
    model = rear_steered.with_fixed(
        ["rear_steering.instead", *(f"{k}_{axle}" for k in "BCDE" for axle in ("front", "rear"))]
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error", SysidWarning)
        fit = sv.identify(model, log, starts=2)
    assert fit["rear_steering.front"].value == pytest.approx(12.0, rel=0.02)
    assert fit["rear_steering.rear"].value == pytest.approx(14.0, rel=0.02)
    with pytest.warns(SysidWarning, match="looks steered at the rear axle"):
        sv.identify(sv.Model(CAR), log, starts=1)


def test_axle_forces_with_a_place_that_is_told_do_not_doubt_it() -> None:
    truth = sv.Model(CAR).add("ins_lever_arm").with_values({"ins_lever_arm.forward_m": -2.9})
    log = sv.drive(truth, LAP, seed=930414)
    with pytest.warns(SysidWarning, match=r"the sensors lie 2\.[789]|the sensors lie 3 m"):
        sv.axle_forces(log, CAR, count=2)
    with warnings.catch_warnings():
        warnings.simplefilter("error", SysidWarning)
        sv.axle_forces(log, CAR, cg_ahead_m=2.9, count=2)
