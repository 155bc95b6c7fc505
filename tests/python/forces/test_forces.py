"""Axle forces from motion, against the forces of simulated cars."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli.main import main
from sysid_vehicle.forces import COLOURS
from sysid_vehicle.forces import motion as _motion
from sysid_vehicle.simulate import Drive, drive_truth

mpl.use("Agg")
# Columns of the core's evaluation.
SLIP, LOAD, SIDE = slice(5, 7), slice(7, 9), slice(9, 11)


@pytest.fixture(scope="module")
def truth() -> Drive:
    model = sv.Model(sv.example_vehicle())
    return drive_truth(model, sv.manoeuvres.handling_course(), seed=3)


@pytest.fixture(scope="module")
def found(truth: Drive) -> sv.AxleForces:
    return sv.axle_forces(truth.log.between(9.0, 18.0), truth.model.vehicle)


@pytest.fixture(scope="module")
def core(truth: Drive, found: sv.AxleForces) -> np.ndarray:
    """What the simulated car's equations say at the samples."""
    track, p = truth.model.core(), truth.model.vector()
    rows = np.searchsorted(truth.log["time_s"], found.time_s - 1e-6)
    return np.array(
        [
            track.evaluate(p, np.ascontiguousarray(truth.states[k]), *truth.inputs[k].tolist())[0]
            for k in rows
        ]
    )


def test_the_true_forces_lie_in_the_band(found: sv.AxleForces, core: np.ndarray) -> None:
    for value, std, true in (
        (found.lateral_n, found.lateral_std_n, core[:, SIDE]),
        (found.slip_rad, found.slip_std_rad, core[:, SLIP]),
    ):
        inside = np.abs(value - true) < 1.96 * std
        assert (inside.mean(axis=0) > 0.93).all()
    # A band that holds everything says nothing: 60 N of 5 kN, and 0.15 deg.
    assert float(np.median(found.lateral_std_n)) < 60.0
    assert float(np.median(found.slip_std_rad)) < np.radians(0.15)
    assert float(np.abs(core[:, SIDE]).max()) > 3000.0
    np.testing.assert_allclose(found.load_n, core[:, LOAD], atol=100.0)


def test_wheel_force_is_that_of_the_log(truth: Drive, found: sv.AxleForces) -> None:
    rows = np.searchsorted(truth.log["time_s"], found.time_s - 1e-6)
    error = found.longitudinal_n - truth.inputs[rows, 1]
    # Steps of the accelerator are smoothed over.
    assert float(np.median(np.abs(error))) < 60.0


def test_a_wrong_inertia_tilts_the_split(found: sv.AxleForces) -> None:
    car = found.vehicle
    heavy = car.replace(yaw_inertia_kgm2=1.2 * found.yaw_inertia_kgm2)
    (log,) = found.sensors.logs
    other = sv.axle_forces(log, heavy, sensors=found.sensors, count=2)
    tilt = 0.2 * found.yaw_inertia_kgm2 * found.yaw_acceleration_radps2 / car.wheelbase_m
    cos = np.cos(found.steer_rad)
    front, rear = (other.lateral_n - found.lateral_n).T
    # The front force of the axle is that along the car, over the cosine of the steering angle.
    np.testing.assert_allclose(front * cos, tilt, rtol=0.02, atol=1.0)
    np.testing.assert_allclose(rear, -tilt, rtol=1e-9, atol=1e-9)
    assert float(np.abs(tilt).max()) > 30.0


def test_an_unknown_inertia_is_said(found: sv.AxleForces) -> None:
    (log,) = found.sensors.logs
    car = found.vehicle.replace(yaw_inertia_kgm2=None)
    other = sv.axle_forces(log, car, sensors=found.sensors, count=2)
    assert other.yaw_inertia_kgm2 == car.mass_kg * car.lf_m * car.lr_m
    assert "gives no yaw inertia" in str(other)


def test_mass_scales_and_the_centre_of_gravity_moves(found: sv.AxleForces) -> None:
    (log,) = found.sensors.logs
    car = found.vehicle
    heavy = car.replace(mass_kg=1.1 * car.mass_kg, yaw_inertia_kgm2=1.1 * found.yaw_inertia_kgm2)
    other = sv.axle_forces(log, heavy, sensors=found.sensors, count=2)
    np.testing.assert_allclose(other.lateral_n[:, 1], 1.1 * found.lateral_n[:, 1])
    # Speeds of a place 0.5 m behind the centre of gravity: the same car, described from there.
    moved = sv.axle_forces(log, car, sensors=found.sensors, cg_ahead_m=0.5, count=2)
    behind = car.replace(lf_m=car.lf_m + 0.5, lr_m=car.lr_m - 0.5)
    same = sv.axle_forces(log, behind, sensors=found.sensors, count=2)
    np.testing.assert_allclose(moved.slip_rad, same.slip_rad, atol=1e-12)
    gain = moved.lateral_n - found.lateral_n
    side = car.mass_kg * 0.5 * found.yaw_acceleration_radps2
    np.testing.assert_allclose(gain[:, 1], car.lf_m / car.wheelbase_m * side, atol=1e-6)


@pytest.mark.parametrize("cg_ahead_m", [0.0, 0.5])
def test_forces_and_motion_meet_the_equations(found: sv.AxleForces, cg_ahead_m: float) -> None:
    """Newton's and Euler's, of a car whose front wheels are driven too."""
    (log,) = found.sensors.logs
    car = found.vehicle.replace(drive_front_share=0.4)
    told = sv.axle_forces(log, car, sensors=found.sensors, cg_ahead_m=cg_ahead_m, count=2)
    # From what the place of the speeds feels to what the centre of gravity feels.
    turn = log["yaw_rate_radps"][np.searchsorted(log["time_s"], told.time_s - 1e-6)]
    tolerance = 2.0 * cg_ahead_m * 0.01 + 1e-12  # m/s2, by noise of the rate
    np.testing.assert_allclose(
        told.ax_mps2, found.ax_mps2 - cg_ahead_m * turn**2, atol=tolerance, rtol=0.0
    )
    np.testing.assert_allclose(
        told.ay_mps2, found.ay_mps2 + cg_ahead_m * told.yaw_acceleration_radps2, atol=1e-12
    )
    sin, cos = np.sin(told.steer_rad), np.cos(told.steer_rad)
    pull, (front, rear) = told.longitudinal_n, told.lateral_n.T
    share = np.where(pull < 0.0, car.brake_front_share, car.drive_front_share)
    drag = 0.5 * car.air_density_kgpm3 * car.drag_area_m2 * told.vx_mps**2
    along = share * pull * cos - front * sin + (1.0 - share) * pull
    np.testing.assert_allclose(along, car.mass_kg * told.ax_mps2 + drag, atol=1e-6)
    across = front * cos + share * pull * sin
    np.testing.assert_allclose(across + rear, car.mass_kg * told.ay_mps2, atol=1e-6)
    np.testing.assert_allclose(car.lf_m * across - car.lr_m * rear, told.moment_nm, atol=1e-6)
    shift = car.mass_kg * told.ax_mps2 * car.cg_height_m / car.wheelbase_m
    np.testing.assert_allclose(told.load_n[:, 1] - car.static_loads_n[1], shift, atol=1e-6)
    np.testing.assert_allclose(told.load_n.sum(axis=1), sum(car.static_loads_n), rtol=1e-12)


def test_a_mean_slope_of_the_road_is_told(truth: Drive) -> None:
    log = truth.log.between(12.0, 18.0)
    columns = {c: np.array(log[c]) for c in log.channels}
    columns["ay_mps2"] = columns["ay_mps2"] + 0.5
    found = sv.axle_forces(sv.Log.from_arrays(columns, name="tilted"), truth.model.vehicle, count=2)
    assert "too much on average" in str(found)
    assert float(np.abs(found.sensors.offsets["ay_mps2"][0] - 0.5)) < 0.1


def test_it_prints_and_draws(found: sv.AxleForces) -> None:
    text = str(found)
    assert "front" in text
    assert "kN/rad" in text
    assert "axle forces of" in repr(found)
    assert "<table>" in found._repr_html_()
    assert json.loads(json.dumps(found.to_dict()))["axles"] == ["front", "rear"]
    slopes = found.slope_npr
    assert 6e4 < min(slopes) < max(slopes) < 1.6e5
    for colour in (COLOURS[0], COLOURS[3]):
        front, rear = found.plot(colour=colour)
        assert front.get_ylabel() == rear.get_ylabel() == "side force [kN]"
    with pytest.raises(sv.InvalidInput, match="did you mean 'load'"):
        found.plot(colour="lod")
    with pytest.raises(sv.InvalidInput, match="two axes"):
        found.plot(ax=front)  # type: ignore[arg-type]


def test_forces_of_a_model_car_are_told_in_newtons(found: sv.AxleForces) -> None:
    small = replace(found.vehicle, mass_kg=3.7, yaw_inertia_kgm2=None)
    model_car = replace(found, vehicle=small, lateral_n=1e-3 * found.lateral_n)
    assert " N/rad" in str(model_car)
    assert "kN" not in str(model_car)
    front, _ = model_car.plot()
    assert front.get_ylabel() == "side force [N]"


def test_wrong_arguments_are_refused(truth: Drive, found: sv.AxleForces) -> None:
    with pytest.raises(sv.InvalidInput, match="check of other logs"):
        sv.axle_forces(truth.log, found.vehicle, sensors=found.sensors)
    (log,) = found.sensors.logs
    with pytest.raises(sv.InvalidInput, match="cg_ahead_m"):
        sv.axle_forces(log, found.vehicle, sensors=found.sensors, cg_ahead_m=float("nan"))
    with pytest.raises(AttributeError):
        found.vehicle = replace(found.vehicle)  # type: ignore[misc]


def test_a_mass_that_is_not_the_cars_is_told(found: sv.AxleForces) -> None:
    (log,) = found.sensors.logs
    pounds = found.vehicle.replace(mass_kg=found.vehicle.mass_kg / 0.45359237)
    with pytest.raises(sv.InvalidInput, match="mass_kg seems to be in pounds"):
        sv.axle_forces(log, pounds, sensors=found.sensors)


def test_the_command(truth: Drive, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, car = tmp_path / "drive.csv", tmp_path / "car.toml"
    truth.log.between(12.0, 18.0).to_csv(log)
    truth.model.vehicle.to_toml(car)
    plot, figures = tmp_path / "forces.svg", tmp_path / "forces.json"
    options = ["--vehicle", str(car), "--colour", "a_x"]
    assert main(["forces", str(log), *options, "--plot", str(plot), "--json", str(figures)]) == 0
    assert "slip angle" in capsys.readouterr().out
    assert plot.read_text().startswith("<?xml")
    assert len(json.loads(figures.read_text())["lateral_n"]) > 300


def test_many_draws_are_made_a_block_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of all at once the memory would grow with their number, and Ctrl-C would wait for them."""
    asked: list[int] = []

    def draw(count: int, rng: np.random.Generator) -> tuple[np.ndarray]:
        asked.append(count)
        return (rng.standard_normal((3, count)),)

    plain = SimpleNamespace(motion=lambda x: x)
    monkeypatch.setattr(_motion, "_Evaluation", lambda check, places: plain)
    check = SimpleNamespace(estimate=SimpleNamespace(draw=draw))
    found = np.array(list(_motion.draws(check, None, 250, 0)))  # type: ignore[arg-type, call-overload]
    assert found.shape == (250, 3)
    assert sum(asked) == 250
    assert max(asked) <= 100
    assert len(np.unique(found[:, 0])) == 250
