"""One error in the vehicle file that a study finds under several names, as it may not seek it."""

import pytest

from sysid_vehicle import Fit, Log, Model, SysidWarning, drive, identify, improve, manoeuvres
from sysid_vehicle.identify import refine
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study.judge.one_for_all import OneForAll, one_for_all

NONE = OneForAll("")
NAMES = ("force_gain", "yaw_inertia", "aero_drag")


@pytest.fixture(scope="module")
def lap(truth: Model) -> Log:
    return drive(truth, manoeuvres.lap(40.0), seed=1, rate_hz=25.0)


@pytest.fixture(scope="module")
def heavy(start: Model, lap: Log) -> Fit:
    """Of a vehicle file whose mass is 10 % too large."""
    car = start.vehicle
    return identify(Model(car.replace(mass_kg=1.1 * car.mass_kg)), lap, starts=1)


def with_all(fit: Fit) -> Fit:
    return refine(fit.model.add(*NAMES), fit.driving, fit.noise)


def all_but(fit: Fit, *names: str) -> set[str]:
    return {e.id for e in fit.model.candidates} - {*names}


def test_a_wrong_mass_that_is_not_sought_is_pointed_at(heavy: Fit) -> None:
    told = one_for_all(heavy, with_all(heavy), NAMES, all_but(heavy, "mass", "gyro_bias"), USUAL)
    said, effect = told
    assert effect == "mass"
    assert said.startswith("force_gain, yaw_inertia, aero_drag may be one error: mass, which was")
    assert "(relative_error -0.09" in said
    assert "check mass_kg of the vehicle file" in said


def test_a_wrong_mass_that_is_fixed_in_the_model_is_pointed_at(heavy: Fit) -> None:
    known = heavy.model.add("mass").with_fixed(["mass.relative_error"])
    fit = refine(known, heavy.driving, heavy.noise)
    said = one_for_all(fit, with_all(fit), NAMES, all_but(fit), USUAL)
    assert "check mass_kg of the vehicle file" in said.said


def test_nothing_is_said_where_all_was_sought_or_one_effect_found(heavy: Fit) -> None:
    assert one_for_all(heavy, with_all(heavy), NAMES, all_but(heavy), USUAL) == NONE
    assert one_for_all(heavy, heavy, NAMES[:1], all_but(heavy, "mass"), USUAL) == NONE


def test_effects_with_causes_of_their_own_are_no_one_error(start: Model, truth: Model) -> None:
    found = ("aero_drag", "steer_offset")
    hidden = {"aero_drag.drag_area_m2": 0.3, "steer_offset.offset_rad": 0.002}
    log = drive(
        truth.add(*found).with_values(hidden), manoeuvres.lap(40.0), seed=531006, rate_hz=25.0
    )
    fit = identify(start, log, starts=1)
    final = refine(fit.model.add(*found), fit.driving, fit.noise)
    assert one_for_all(fit, final, found, all_but(fit, "mass", "force_gain"), USUAL) == NONE


def test_a_study_warns_of_it(heavy: Fit, lap: Log, truth: Model) -> None:
    course = drive(truth, manoeuvres.handling_course(20.0, 7.5), seed=2, rate_hz=25.0)
    with pytest.warns(SysidWarning) as caught:
        found = improve(
            heavy.model,
            lap,
            course,
            starts=1,
            candidates=["force_gain", "aero_drag"],
            sensors=False,
        )
    assert [a.id for a in found.added] == ["force_gain", "aero_drag"]
    assert found.verdict == "unknown"
    said = found.warnings[0]
    assert "check mass_kg" in said
    assert said in {str(warning.message) for warning in caught}
