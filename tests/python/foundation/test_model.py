"""The car model: effects, values, and what is free."""

import numpy as np
import pytest

from sysid_vehicle import InvalidInput, Model, Vehicle, catalogue
from sysid_vehicle.model import NUISANCES

TYRES = tuple(f"{letter}_{axle}" for axle in ("front", "rear") for letter in "BCDE")


def test_the_baseline_has_the_tyres_of_the_vehicle(truth: Model, car: Vehicle) -> None:
    assert truth.names == (*TYRES, "yaw_inertia_kgm2")
    assert truth.free_names == TYRES
    assert truth.value("B_front") == car.tyre_front.B
    assert truth.value("E_rear") == car.tyre_rear.E
    assert truth.value("yaw_inertia_kgm2") == car.yaw_inertia_kgm2


def test_effects_are_added_at_their_null_values_and_dropped_with_their_values(
    truth: Model,
) -> None:
    more = truth.add("steer_lag", "aero_drag").with_values({"aero_drag.drag_area_m2": 0.3})
    assert more.effects == ("steer_lag", "aero_drag")
    assert more.value("steer_lag.time_constant_s") == 0.0
    assert more.value("aero_drag.drag_area_m2") == 0.3
    less = more.drop("aero_drag")
    assert less.effects == ("steer_lag",)
    assert less.add("aero_drag").value("aero_drag.drag_area_m2") == 0.0
    assert truth.effects == ()


def test_what_makes_no_sense_is_refused(truth: Model) -> None:
    with pytest.raises(InvalidInput, match="named twice: mass, mass"):
        truth.add("mass", "mass")
    with pytest.raises(InvalidInput, match=r"no parameter 'mass\.relative_error'; it has B_front"):
        truth.with_values({"mass.relative_error": 0.1})
    with pytest.raises(InvalidInput, match="no effect is called 'wings'"):
        truth.add("wings")


def test_an_unknown_yaw_inertia_is_free_and_guessed(car: Vehicle) -> None:
    model = Model(car.replace(yaw_inertia_kgm2=None))
    assert model.free_names == (*TYRES, "yaw_inertia_kgm2")
    guess = car.mass_kg * car.lf_m * car.lr_m
    assert model.value("yaw_inertia_kgm2") == pytest.approx(guess)
    assert model.bounds("yaw_inertia_kgm2") == pytest.approx((0.2 * guess, 5.0 * guess))
    assert "yaw_inertia" not in [e.id for e in model.candidates]


def test_candidates_are_what_the_model_lacks(truth: Model) -> None:
    considered = [e.id for e in catalogue() if not (e.refines or e.on_request)]
    assert [e.id for e in truth.candidates] == considered
    left = [e.id for e in truth.add("mass").candidates]
    assert left == [e for e in considered if e != "mass"]


def test_the_core_vector_holds_values_and_null_values(truth: Model) -> None:
    model = truth.add("gyro_bias").with_values({"gyro_bias.bias_radps": 0.01, "B_rear": 9.0})
    p = model.vector()
    for e in catalogue():
        for parameter in e.parameters:
            expected = 0.01 if e.id == "gyro_bias" else parameter.null_value
            assert p[parameter.column] == expected
    assert p[model.parameters["B_rear"].column] == 9.0
    assert truth.with_values({"B_rear": 9.0}).vector()[0] == truth.value("B_front")


def test_free_parameters_come_back_from_a_vector(truth: Model) -> None:
    model = truth.add("steer_offset")
    p = model.vector()
    p[model.parameters["steer_offset.offset_rad"].column] = 0.004
    p[model.parameters["C_front"].column] = 1.7
    p[model.parameters["yaw_inertia_kgm2"].column] = 1.0
    back = model.from_vector(p)
    assert back.value("steer_offset.offset_rad") == 0.004
    assert back.value("C_front") == 1.7
    assert back.value("yaw_inertia_kgm2") == truth.value("yaw_inertia_kgm2")


def test_nuisances_have_priors_of_their_typical_sizes(truth: Model) -> None:
    model = truth.add("mass", "gyro_bias").with_nuisances()
    assert model.effects[:2] == ("mass", "gyro_bias")
    assert set(model.nuisances) == set(NUISANCES)
    assert "mass" not in model.nuisances
    # The logs of a car share the place of its instruments.
    assert "gyro_bias.bias_radps" in model.offset_names
    placed = truth.with_nuisances((*NUISANCES, "ins_lever_arm", "gyro_bias"))
    assert placed.nuisances == (*NUISANCES, "ins_lever_arm")
    assert set(placed.offset_names) == set(model.offset_names)
    assert model.priors["gyro_bias.bias_radps"] == (0.0, 0.006)
    assert model.vector().tolist() == truth.vector().tolist()
    # Known to be something is no nuisance, nor is an effect of which a part is unknown.
    told = truth.add("mass", "side_wind").with_priors(
        {"mass.relative_error": (0.1, 0.02), "side_wind.side_force_n": (0.0, 100.0)}
    )
    assert told.nuisances == ()
    with pytest.raises(InvalidInput, match="no effect is called 'gyro_bais'"):
        truth.with_nuisances(["gyro_bais"])


def test_mirrored_steering_mirrors_the_answer(truth: Model) -> None:
    core, p = truth.core(), truth.vector()
    left = core.evaluate(p, np.array([20.0, 0.3, 0.2]), 0.05, 500.0)[0]
    right = core.evaluate(p, np.array([20.0, -0.3, -0.2]), -0.05, 500.0)[0]
    # dv_x, a_x and the loads keep their sign; everything lateral changes it.
    sign = np.array([1, -1, -1, 1, -1, -1, -1, 1, 1, -1, -1])
    np.testing.assert_allclose(right, sign * left, rtol=1e-12)


def test_a_model_prints_values_with_units(truth: Model) -> None:
    text = str(truth.add("steer_lag"))
    assert "sports saloon" in text
    assert "steer_lag.time_constant_s" in text
    assert "kg m2  (given)" in text
    assert truth._repr_html_().startswith("<pre>sports saloon")
    assert "baseline" in str(truth)
