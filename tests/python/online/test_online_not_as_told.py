"""The band of the sideslip where road or car are not what the observer was told."""

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
    """Filters that expect a level road err by 1.3 deg here, outside of bands of 0.2 deg."""
    found = runs(sv.Model(CAR), sv.RoadDisturbance(slope_rad=0.04))
    assert rms_deg(found) < 0.6
    assert covered(found) > 0.75


def test_late_wheels_are_noticed() -> None:
    """Without it the band holds the truth in 81 %."""
    late = sv.Model(CAR).add("steer_lag").with_values({"steer_lag.time_constant_s": 0.12})
    assert covered(runs(late)) > 0.84


@pytest.mark.parametrize(
    ("offset", "most_deg"),
    [({"steer_offset.offset_rad": 0.004}, 0.25), ({"gyro_bias.bias_radps": 0.004}, 0.125)],
)
def test_an_offset_of_a_sensor_is_no_bank(offset: dict[str, float], most_deg: float) -> None:
    """Filters that know of banks alone err by 0.40 and 0.15 deg, and hold 48 and 72 %."""
    (name,) = (name.split(".")[0] for name in offset)
    found = runs(sv.Model(CAR).add(name).with_values(offset))
    assert rms_deg(found) < most_deg
    assert covered(found) > 0.7


def test_what_is_as_told_has_no_wider_band() -> None:
    """Filters that allow for none of this have a standard deviation of 0.051 deg here."""
    found = runs(sv.Model(CAR))
    assert covered(found) > 0.95
    assert rms_deg(found) < 0.035
    assert np.degrees(np.mean([run.beta_std_rad for run in found])) < 0.056
