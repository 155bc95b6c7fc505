"""Logs of cars that reverse, as they park."""

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import InvalidInput

BASE_M, LR_M, RATE_HZ = 2.6, 1.45, 100.0


@pytest.fixture(scope="module")
def parked() -> dict[str, np.ndarray]:
    """A car without slip that reverses into a space, and draws forward for a moment."""
    time_s = np.arange(0.0, 40.0, 1.0 / RATE_HZ)
    vx = -1.5 * np.sin(np.pi * time_s / 30.0) ** 2
    vx[time_s > 30.0] = 0.5 * np.sin(np.pi * time_s[time_s > 30.0] / 10.0) ** 2
    steer = 0.45 * np.sin(0.4 * time_s)
    rate = vx * np.tan(steer) / BASE_M
    vy = LR_M * rate
    drift = np.random.default_rng(991_100)
    motion = {
        "vx_mps": (vx, 0.01),
        "vy_mps": (vy, 0.01),
        "yaw_rate_radps": (rate, 0.002),
        "ax_mps2": (np.gradient(vx, time_s) - vy * rate, 0.05),
        "ay_mps2": (np.gradient(vy, time_s) + vx * rate, 0.05),
    }
    noisy = {c: x + s * drift.standard_normal(x.size) for c, (x, s) in motion.items()}
    return {"time_s": time_s, **noisy, "steer_rad": steer}


def test_a_car_that_reverses_is_told_from_a_speed_of_the_wrong_sign(
    parked: dict[str, np.ndarray],
) -> None:
    """The log was refused with `factor = -1`, which makes it wrong."""
    with pytest.raises(InvalidInput, match="the car reverses for most of the drive") as refused:
        sv.read_log(parked)
    assert "factor" not in str(refused.value)


def test_no_map_turns_the_speed_of_a_car_round_that_reverses(
    parked: dict[str, np.ndarray],
) -> None:
    proposed = sv.propose_channels(parked).channels["vx_mps"]
    assert proposed.factor == 1.0
    assert "turned round" not in proposed.why


def test_a_speed_of_the_wrong_sign_is_still_told() -> None:
    log = sv.drive(sv.Model(sv.example_vehicle()), sv.manoeuvres.lap(20.0), seed=991_101)
    columns = {name: np.array(log[name]) for name in log.channels}
    columns["vx_mps"] *= -1.0
    with pytest.raises(InvalidInput, match="vx_mps: wrong sign"):
        sv.read_log(columns)
    assert sv.propose_channels(columns).channels["vx_mps"].factor == -1.0
