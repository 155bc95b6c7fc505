"""The laboratory refuses what would be nonsense, and takes heavy vehicles."""

from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import lab, published
from sysid_vehicle.errors import InvalidInput

N = 300
CAR = lab.GreyBoxVehicle.of(sv.example_vehicle())
TIME_S = 0.01 * np.arange(N)
WEIGHT_N = 9.80665 * CAR.mass_kg


def log(**changes: Any) -> lab.TyreLog:
    turn = np.sin(3.0 * TIME_S)
    given: dict[str, Any] = {
        "step_s": 0.01,
        "measurements": np.column_stack([20.0 + 0.0 * turn, 0.0 * turn, 0.1 * turn, 2.0 * turn]),
        "force_and_steer": np.column_stack([500.0 + 0.0 * turn, 0.01 * turn]),
        "loads": np.full((N, 2), 0.5 * WEIGHT_N),
    }
    return lab.TyreLog.of(**{**given, **changes})


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"step_s": 10.0}, r"step_s is 10.0; give seconds per sample, at most 0.2"),
        ({"step_s": np.nan}, r"step_s is nan; give seconds"),
        ({"loads": np.zeros((3, 2))}, r"loads has shape \(3, 2\); expected \(300, 2\)"),
        ({"load_delay_samples": N}, r"load_delay_samples = 300; give a number from 0"),
        ({"load_delay_samples": -3}, r"load_delay_samples = -3; give a number from 0"),
        ({"force_and_steer": np.full((N, 2), 4.0)}, r"steer_rad reaches 4, .*give radians"),
    ],
)
def test_wrong_arrays_are_refused(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(InvalidInput, match=told):
        log(**changes)


@pytest.mark.parametrize("unit", [1e-3, 1.0 / 9.80665])
def test_loads_in_another_unit_are_refused(unit: float) -> None:
    with pytest.raises(InvalidInput, match=r"the axle loads are .* N together, .* newtons"):
        lab.identify_tyres(CAR, log(loads=np.full((N, 2), 0.5 * unit * WEIGHT_N)), starts=1)


def test_a_multi_sine_begins_below_its_end() -> None:
    with pytest.raises(InvalidInput, match=r"from_hz = 1 lies above to_hz = 0.2"):
        lab.excitation.multi_sine(5.0, from_hz=1.0, to_hz=0.2)


def test_a_lorry_holds_its_speed() -> None:
    car = sv.example_vehicle()
    lorry = car.replace(
        mass_kg=15500.0, yaw_inertia_kgm2=92000.0, lf_m=3.1, lr_m=2.2, cg_height_m=1.3
    )
    drive = lab.excitation.multi_sine(2.5, speed_mps=16.0, duration_s=20.0)
    loop = lab.run_closed_loop(drive, lab.Setup.of(sv.Model(lorry)), seed=3)
    assert np.abs(loop.truth["vx_mps"] - 16.0).max() < 1.5  # 3.2 rms before
    light = lab.Setup.of(sv.Model(car.replace(mass_kg=900.0)))
    assert light.force == lab.Setup.default().force


def test_a_drive_that_no_memory_holds_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"duration_s = 1e\+09: 1e\+11 samples at 100 Hz"):
        lab.run_closed_loop(published.Identification(duration_s=1e9), lab.Setup.default(), seed=0)


def test_a_seed_that_is_none_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"seed = -4: give a whole number, 0 or more"):
        lab.identify_tyres(CAR, log(), starts=2, seed=-4)


@pytest.mark.parametrize("horizon_s", [np.nan, np.inf, -1.0])
def test_a_horizon_that_is_none_is_refused(horizon_s: float) -> None:
    values = np.array([10.0, 1.4, 1.0, 0.0] * 2 + [0.0, 0.0, 0.0, 1.0, 1.0, 0.5])
    car = lab.IdentifiedCar(CAR, values, np.full(7, 0.01))
    with pytest.raises(InvalidInput, match=r"s ahead in a drive of 3 s.* choose a horizon"):
        lab.validate_tyres(car, log(), horizon_s=horizon_s)


@pytest.mark.parametrize("drag", [-5.0, np.nan, np.inf, 1e9])
def test_a_drag_that_no_car_has_is_refused(drag: float) -> None:
    with pytest.raises(InvalidInput, match=r"drag_nspm = .*give newtons per m/s"):
        lab.ObserverCar.of(sv.example_vehicle(), drag_nspm=drag)


def test_a_stiffness_in_newtons_per_radian_is_refused() -> None:
    time_s = 0.01 * np.arange(600)
    turn = 0.3 * np.sin(2.0 * time_s)
    driven = sv.Log.from_arrays(
        {
            "time_s": time_s,
            "vx_mps": 20.0 + 0.0 * turn,
            "yaw_rate_radps": turn,
            "ay_mps2": 20.0 * turn,
            "ax_mps2": 0.0 * turn,
            "steer_rad": 0.15 * turn,
            "fx_n": 500.0 + 0.0 * turn,
        },
        check=False,
    )
    car = lab.ObserverCar.of(sv.example_vehicle())
    with pytest.raises(InvalidInput, match=r"stiffness, rear = 90000: .*divided by the load"):
        lab.ObserverRecord.from_log(driven, car, (15.0, 9e4))
    record = lab.ObserverRecord.from_log(driven, car, (15.0, 20.0))
    observer = lab.Observer(car, lab.ObserverNoise.first_guess(record, car))
    with pytest.raises(InvalidInput, match=r"most_iterations = 0: give a whole number, 1 or more"):
        lab.learn_observer_noise(observer, record, most_iterations=0)
    with pytest.raises(InvalidInput, match=r"tolerance = nan: give a log-likelihood"):
        lab.learn_observer_noise(observer, record, tolerance=np.nan)
