"""A wrong line of the vehicle file that a study finds as effects."""

from dataclasses import replace

import pytest

from sysid_vehicle import Fit, Log, Model, drive, identify, manoeuvres
from sysid_vehicle.identify import refine
from sysid_vehicle.study.judge.slip_of_the_file import slip_of_the_file

PLACES = ("ins_lever_arm", "cg_position")


def driven(truth: Model, seed: int) -> Log:
    return drive(truth, manoeuvres.lap(40.0), seed=seed, rate_hz=50.0)


def found(start: Model, log: Log, *names: str, **wrong: float) -> Fit:
    """A fit with effects, of a vehicle file with other numbers."""
    model = replace(start, vehicle=start.vehicle.replace(**wrong))
    fit = identify(model, log, starts=1)
    return refine(fit.model.add(*names), fit.driving, fit.noise)


@pytest.fixture(scope="module")
def lap(truth: Model) -> Log:
    return driven(truth, 173955)


def test_lengths_that_are_exchanged_are_named(start: Model, lap: Log) -> None:
    car = start.vehicle
    final = found(start, lap, *PLACES, lf_m=car.lr_m, lr_m=car.lf_m)
    said = slip_of_the_file(final, PLACES)
    assert said.startswith("ins_lever_arm, cg_position may be a mistake in the vehicle file: with ")
    assert f"lf_m = {car.lf_m:g} and lr_m = {car.lr_m:g}, exchanged," in said


def test_the_wrong_driven_axle_is_named(start: Model, lap: Log) -> None:
    final = found(
        start, lap, "force_split", drive_front_share=1.0 - start.vehicle.drive_front_share
    )
    said = slip_of_the_file(final, ("force_split",))
    assert f"with drive_front_share = {start.vehicle.drive_front_share:g} the" in said


def test_a_car_that_is_unlike_its_file_by_other_sizes_is_no_slip(
    start: Model, truth: Model
) -> None:
    moved = {"cg_position.shift_rearward_m": 0.06, "force_split.brake_front_error": 0.1}
    names = ("cg_position", "force_split")
    log = driven(truth.add(*names).with_values(moved), 650304)
    assert slip_of_the_file(found(start, log, *names), names) == ""


def test_shares_that_are_equal_are_not_exchanged(start: Model, lap: Log) -> None:
    final = found(start, lap, "force_split", brake_front_share=0.5)
    assert "brake_front_share = 0.5" not in slip_of_the_file(final, ("force_split",))
