"""A wrong line of the vehicle file that a study finds as effects."""

from dataclasses import replace

import pytest

from sysid_vehicle import Fit, Log, Model, drive, identify, manoeuvres
from sysid_vehicle.identify import refine
from sysid_vehicle.study.judge.slip_of_the_file import slip_of_the_file

PLACES = ("ins_lever_arm", "cg_position")


def driven(truth: Model, seed: int) -> Log:
    return drive(truth, manoeuvres.lap(40.0), seed=seed, rate_hz=25.0)


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


@pytest.mark.parametrize("key", ["lf_m", "lr_m"])
@pytest.mark.parametrize("names", [("aero_downforce", "steer_compliance"), ()])
def test_the_wheelbase_in_place_of_a_length_is_named(
    start: Model, lap: Log, key: str, names: tuple[str, ...]
) -> None:
    car = start.vehicle
    final = found(start, lap, *names, **{key: car.wheelbase_m})
    said = slip_of_the_file(final, names)
    what = ", ".join(names) if names else "what is missing"
    assert said.startswith(f"{what} may be a mistake in the vehicle file: with {key} = ")
    assert f"{key} = {getattr(car, key):g} ({car.wheelbase_m:g} being the wheelbase) the" in said


def test_a_car_with_its_mass_far_behind_is_no_slip(
    start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With one length of 1.7 times the other a search is made, which finds no other wheelbase."""
    car = start.vehicle.replace(lf_m=1.64, lr_m=0.96)
    tail = replace(start, vehicle=car)
    final = found(tail, driven(tail, 411903))
    asked: list[Fit] = []
    searched = slip_of_the_file.__globals__["refine"]
    monkeypatch.setitem(
        slip_of_the_file.__globals__, "refine", lambda *a: asked.append(searched(*a)) or asked[-1]
    )
    assert slip_of_the_file(final, ()) == ""
    assert len(asked) == 1
    assert slip_of_the_file(replace(final, model=start), ()) == ""
    assert len(asked) == 1


def test_a_car_that_is_unlike_its_file_by_other_sizes_is_no_slip(
    start: Model, truth: Model
) -> None:
    moved = {"cg_position.shift_rearward_m": 0.06, "force_split.brake_front_error": 0.1}
    names = ("cg_position", "force_split")
    log = driven(truth.add(*names).with_values(moved), 650304)
    assert slip_of_the_file(found(start, log, *names), names) == ""


def test_shares_that_are_equal_are_not_exchanged(start: Model, truth: Model) -> None:
    """An effect that was added for nothing is as needless with the same file."""
    car = Model(truth.vehicle.replace(brake_front_share=0.5))
    final = found(start, driven(car, 173955), "force_split", brake_front_share=0.5)
    assert slip_of_the_file(final, ("force_split",)) == ""
