"""Effects have the sizes of the car: those of the catalogue are of ordinary ones."""

import dataclasses

import pytest

import sysid_vehicle as sv
from sysid_vehicle.effects import Effect, Parameter, in_car, matters_in
from sysid_vehicle.effects.scale import ORDINARY_MASS_KG, ORDINARY_WHEELBASE_M

KNOWN = {*("m", "m2", "N", "N m", "N m2", "rad/N", "1/kW", "s/m", "s", "m/s", "rad/s")}
OF_NO_SIZE = {"1", "rad", "1/rad2", "m/s2", "Hz"}  # angles, factors, what gravity is compared with


def model_car() -> sv.Vehicle:
    return sv.Vehicle(
        name="one to eight",
        mass_kg=4.0,
        lf_m=0.15,
        lr_m=0.17,
        cg_height_m=0.06,
        track_front_m=0.2,
        track_rear_m=0.2,
        drag_area_m2=0.01,
        brake_front_share=0.6,
        drive_front_share=0.0,
    )


def only(e: Effect) -> Parameter:
    (parameter,) = e.parameters
    return parameter


def test_the_unit_of_every_parameter_tells_how_its_size_goes() -> None:
    units = {p.unit for e in sv.catalogue() for p in e.parameters}
    assert units == KNOWN | OF_NO_SIZE


@pytest.mark.parametrize("wheelbase_m", ORDINARY_WHEELBASE_M)
@pytest.mark.parametrize("mass_kg", ORDINARY_MASS_KG)
def test_ordinary_cars_have_the_sizes_of_the_catalogue(wheelbase_m: float, mass_kg: float) -> None:
    assert all(in_car(e, wheelbase_m=wheelbase_m, mass_kg=mass_kg) is e for e in sv.catalogue())


def test_forces_on_a_similar_car_are_the_same_share_of_its_weight() -> None:
    # Half as long as the shortest ordinary one, and an eighth as heavy as the lightest.
    small = {"wheelbase_m": 0.5 * ORDINARY_WHEELBASE_M[0], "mass_kg": ORDINARY_MASS_KG[0] / 8.0}
    for name, factor in {
        "tyre_relaxation": 0.5,
        "aero_drag": 0.25,  # force over weight at like v^2 / (g L)
        "limited_slip_differential": 1.0 / 16.0,
        "locked_differential": 1.0 / 32.0,
        "steer_compliance": 8.0,
    }.items():
        ordinary = only(sv.effect(name))
        here = only(in_car(sv.effect(name), **small))
        for size in ("typical", "matters", "upper", "lower", "typical_low", "typical_high"):
            assert getattr(here, size) == pytest.approx(factor * getattr(ordinary, size)), size
        assert here.null_value == ordinary.null_value == 0.0


def test_a_servo_is_as_slow_in_a_small_car_and_matters_sooner() -> None:
    ordinary = only(sv.effect("steer_lag"))
    here = only(in_car(sv.effect("steer_lag"), wheelbase_m=0.5, mass_kg=20.0))
    assert here.matters == pytest.approx(0.5 * ordinary.matters)
    assert dataclasses.replace(here, matters=ordinary.matters) == ordinary


def test_a_model_has_the_sizes_of_its_car() -> None:
    car = model_car()
    model = sv.Model(car).add("tyre_relaxation")
    (mine,) = model.parts
    usual = only(sv.effect("tyre_relaxation"))
    assert only(mine).typical == pytest.approx(0.32 / 2.0 * usual.typical)
    candidates = {e.id: e for e in model.candidates}
    assert candidates["side_wind"].parameters[0].typical < 0.1 * car.mass_kg * 9.81
    assert model.bounds("tyre_relaxation.relaxation_length_m")[1] == only(mine).upper
    # What has these sizes already is not sized again.
    assert sv.Model(car).add(mine).parts == model.parts


def test_bounds_that_a_user_gave_stay() -> None:
    wide = only(sv.effect("steer_compliance"))
    given = dataclasses.replace(
        sv.effect("steer_compliance"), parameters=(dataclasses.replace(wide, upper=1.9e-5),)
    )
    (mine,) = sv.Model(model_car()).add(given).parts
    assert mine == given


def test_a_saved_model_keeps_its_sizes(tmp_path: object) -> None:
    model = sv.Model(model_car()).add("tyre_relaxation", "side_wind")
    path = f"{tmp_path}/model.npz"
    model.save(path)
    assert sv.load(path).parts == model.parts


def test_what_matters_follows_the_length_of_the_car() -> None:
    assert matters_in("m", 0.5) == pytest.approx(0.25)
    assert matters_in("s", 0.5) == pytest.approx(0.5)
    assert matters_in("rad/s", 14.0) == pytest.approx(0.5)
    assert {matters_in(unit, 2.6) for unit in KNOWN} == {1.0}
    assert {matters_in(unit, 0.3) for unit in ("1", "rad", "")} == {1.0}
