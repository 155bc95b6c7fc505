"""Cornering stiffness of a model car, whose yaw rate changes within the window of smoothing."""

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import online

STEP_S, PARTS, SAMPLES, SPEED_MPS = 0.02, 20, 2000, 3.5
CAR = sv.Vehicle(
    mass_kg=3.0,
    yaw_inertia_kgm2=0.045,
    lf_m=0.135,
    lr_m=0.125,
    cg_height_m=0.0,
    track_front_m=0.19,
    track_rear_m=0.19,
    drag_area_m2=0.0,
    brake_front_share=0.5,
    drive_front_share=0.5,
    tyre_front=sv.Tyre(4.0, 1.0, 2.4, 0.0),  # so wide a curve is straight
    tyre_rear=sv.Tyre(4.0, 1.0, 3.0, 0.0),
)


def driven(seed: int) -> sv.Log:
    """Linear tyres, steered at 0.7 to 1.6 Hz, by nothing of the package."""
    rng = np.random.default_rng(seed)
    front, rear = 9.6 * CAR.static_loads_n[0], 12.0 * CAR.static_loads_n[1]
    phases, rates = rng.uniform(0.0, 6.0, 4), 2.0 * np.pi * np.array([0.7, 0.9, 1.3, 1.6])
    v_y = r = 0.0
    rows, h = np.empty((SAMPLES, 4)), STEP_S / PARTS
    for k in range(SAMPLES * PARTS):
        steer = 0.035 * float(np.sin(rates * k * h + phases).sum())
        side_f = front * (steer - (v_y + CAR.lf_m * r) / SPEED_MPS)
        side_r = -rear * (v_y - CAR.lr_m * r) / SPEED_MPS
        a_y = (side_f + side_r) / CAR.mass_kg
        if k % PARTS == 0:
            rows[k // PARTS] = steer, v_y, r, a_y
        v_y += h * (a_y - SPEED_MPS * r)
        r += h * (CAR.lf_m * side_f - CAR.lr_m * side_r) / 0.045
    names, stds = ("steer_rad", "vy_mps", "yaw_rate_radps", "ay_mps2"), (0.0003, 0.03, 0.003, 0.08)
    columns = {
        name: y + std * rng.standard_normal(SAMPLES)
        for name, y, std in zip(names, rows.T, stds, strict=True)
    }
    columns |= {
        "time_s": STEP_S * np.arange(SAMPLES),
        "vx_mps": SPEED_MPS + 0.03 * rng.standard_normal(SAMPLES),
        "ax_mps2": 0.08 * rng.standard_normal(SAMPLES),
    }
    return sv.Log.from_arrays(columns, name="quick", check=False)


@pytest.mark.parametrize("seed", range(8))
def test_smoothing_does_not_take_the_yaw_acceleration_away(seed: int) -> None:
    """Slopes of parabolas fade sooner than their values: the stiffness was 40 % too small."""
    run = online.cornering_stiffness(CAR, driven(seed))
    loads = CAR.static_loads_n
    for found, std, true in (
        (run.cf_npr[-1], run.cf_std_npr[-1], 9.6 * loads[0]),
        (run.cr_npr[-1], run.cr_std_npr[-1], 12.0 * loads[1]),
    ):
        assert abs(found - true) < 3.0 * std
        assert abs(found / true - 1.0) < 0.05
