"""The band of the sideslip where road or car are not what the observer was told."""

import dataclasses

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.online import SideslipRun, estimate_sideslip

CAR = sv.example_vehicle()
SEEDS = (17, 18)


def runs(model: sv.Model, disturbance: sv.RoadDisturbance | None = None) -> list[SideslipRun]:
    course = sv.manoeuvres.handling_course(40.0, lateral_mps2=4.0)
    exact = sv.SensorNoise(vy_mps=0.0)  # the truth that the observer is judged by
    logs = [
        sv.drive(model, course, seed=seed, noise=exact, disturbance=disturbance) for seed in SEEDS
    ]
    return [estimate_sideslip(CAR, log) for log in logs]


def covered(found: list[SideslipRun]) -> float:
    return float(np.mean([run.error().covered for run in found]))


def rms_deg(found: list[SideslipRun]) -> float:
    return float(np.sqrt(np.mean([run.error().rms_deg ** 2 for run in found])))


def test_a_bank_is_no_sideslip() -> None:
    """Filters that expect a level road err by 1.3 deg here, outside of bands of 0.2 deg.

    Where the filter of banked roads expects much less friction as well, 0.4 deg, and 82 % inside.
    """
    found = runs(sv.Model(CAR), sv.RoadDisturbance(slope_rad=0.04))
    assert rms_deg(found) < 0.15
    assert covered(found) > 0.93


def test_late_wheels_are_noticed() -> None:
    """Without it the band holds the truth in 81 %."""
    late = sv.Model(CAR).add("steer_lag").with_values({"steer_lag.time_constant_s": 0.12})
    assert covered(runs(late)) > 0.84


@pytest.mark.parametrize(
    ("cause", "most_deg", "least"),
    [
        ({"steer_offset.offset_rad": 0.006}, 0.1, 0.95),
        ({"gyro_bias.bias_radps": 0.006}, 0.1, 0.93),
        ({"accelerometer_bias.ay_mps2": 0.25}, 0.25, 0.95),
        ({"side_wind.side_force_n": 450.0, "side_wind.yaw_moment_nm": 250.0}, 0.1, 0.9),
        # Gravity across is what an accelerometer that is off reads.
        pytest.param({"road_bank.bank_rad": 0.02}, 0.1, 0.9, marks=pytest.mark.manual),
    ],
)
def test_what_lasts_is_learnt_or_allowed_for(
    cause: dict[str, float], most_deg: float, least: float
) -> None:
    """Typical sizes; a filter that has the offsets beside others without holds 58 to 90 %."""
    found = runs(sv.Model(CAR).add(next(iter(cause)).split(".")[0]).with_values(cause))
    assert rms_deg(found) < most_deg
    assert covered(found) > least


def test_what_is_as_told_has_no_wider_band() -> None:
    """Filters that allow for none of this have a standard deviation of 0.051 deg here.

    Of a wind that nothing tells and of slip without force the band takes a tenth more.
    """
    found = runs(sv.Model(CAR))
    assert covered(found) > 0.95
    assert rms_deg(found) < 0.035
    assert np.degrees(np.mean([run.beta_std_rad for run in found])) < 0.058


def test_a_slow_log_of_a_small_car_is_followed_in_short_steps() -> None:
    """With one step of 0.05 s for a sample the error is 0.092 deg."""
    kart = dataclasses.replace(
        CAR,
        mass_kg=170.0,
        lf_m=0.6,
        lr_m=0.45,
        yaw_inertia_kgm2=22.0,
        cg_height_m=0.2,
        track_front_m=0.8,
        track_rear_m=0.8,
        drag_area_m2=0.5,
    )
    course = sv.manoeuvres.handling_course(40.0, lateral_mps2=5.0, top_speed_mps=14.0)
    log = sv.drive(sv.Model(kart), course, seed=31, noise=sv.SensorNoise(vy_mps=0.0))
    slow = {name: log[name][::5] for name in log.channels}
    found = [estimate_sideslip(kart, sv.Log.from_arrays(slow, name="20 Hz"))]
    assert rms_deg(found) < 0.07
    assert covered(found) > 0.95
