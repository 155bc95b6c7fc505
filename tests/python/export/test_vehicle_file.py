"""A vehicle file holds what a study changed of it, and drives like the model it is made of."""

from pathlib import Path

import numpy as np
import pytest
from exported import typical

import sysid_vehicle as sv
from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.export.vehicle_file import vehicle_and_rest

IN_FILE = tuple(e.id for e in sv.catalogue() if e.changes_car)


def predicted(model: sv.Model, fit: sv.Fit) -> np.ndarray:
    """Whitened innovations of all samples, with the noise of a fit."""
    problem = fit.driving.problem(model)
    p = model.vector()
    return np.asarray(problem.residuals(p, problem.freeze(p, fit.noise.vector())))


@pytest.mark.parametrize("effects", [*((e,) for e in IN_FILE), (*IN_FILE, "steer_lag")])
def test_the_file_predicts_what_the_model_predicts(
    tmp_path: Path, fit: sv.Fit, truth: sv.Model, effects: tuple[str, ...]
) -> None:
    model = typical(truth, *effects)
    car, rest = vehicle_and_rest(model)
    car.to_toml(tmp_path / "car.toml")
    read = sv.Vehicle.from_toml(tmp_path / "car.toml")
    again = sv.Model(read).add(*rest.parts).with_values(rest.values)
    wanted = predicted(model, fit)
    assert np.std(wanted - predicted(truth, fit)) > 1e-3  # these effects do something
    np.testing.assert_allclose(predicted(again, fit), wanted, rtol=1e-7, atol=1e-7)
    left = {e for e in again.effects if e != "ins_lever_arm"}
    assert left == {*effects} - {*IN_FILE}


def test_every_effect_that_changes_the_car_is_known_to_do_so() -> None:
    assert {"mass", "yaw_inertia", "cg_position", "aero_drag", "force_split"} < {*IN_FILE}
    assert not {"aero_downforce", "head_wind", "steer_lag"} & {*IN_FILE}


def test_only_what_has_no_place_is_named(tmp_path: Path, truth: sv.Model) -> None:
    path = tmp_path / "car.toml"
    sv.export(typical(truth, "mass"), path)  # no warning, which would be an error here
    heavier = sv.Vehicle.from_toml(path)
    assert heavier.mass_kg == pytest.approx(1.12 * truth.vehicle.mass_kg)
    with pytest.warns(SysidWarning, match=r"no place for effects \(steer_lag\)"):
        sv.export(typical(truth, "mass", "steer_lag"), path)
    assert sv.Vehicle.from_toml(path) == heavier


def test_sensors_stay_where_they_are(tmp_path: Path, truth: sv.Model) -> None:
    path = tmp_path / "car.toml"
    with pytest.warns(SysidWarning, match=r"0\.08 m further back.*forward_m': 0\.08"):
        sv.export(typical(truth, "cg_position"), path)
    assert sv.Vehicle.from_toml(path).lf_m == pytest.approx(truth.vehicle.lf_m + 0.08)


def test_what_a_file_may_not_say_stays_an_effect(tmp_path: Path, truth: sv.Model) -> None:
    """A centre of gravity below the road."""
    sunk = truth.add("longitudinal_load_transfer", "mass").with_values(
        {"longitudinal_load_transfer.height_error_m": -0.55, "mass.relative_error": 0.1}
    )
    with pytest.warns(SysidWarning, match=r"no place for effects \(longitudinal_load_transfer\)"):
        sv.export(sunk, tmp_path / "car.toml")
    read = sv.Vehicle.from_toml(tmp_path / "car.toml")
    assert read.cg_height_m == truth.vehicle.cg_height_m
    assert read.mass_kg == pytest.approx(1.1 * truth.vehicle.mass_kg)
