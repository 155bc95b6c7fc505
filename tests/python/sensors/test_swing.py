"""An IMU above the speed sensor on a body that rolls."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
import scipy

import sysid_vehicle as sv

G = 9.80665
ROLL = 0.07  # rad per g
_DELAYS = ("delay_vy_s", "delay_ay_s")


def rolling(log: sv.Log, above_m: float, natural_hz: float, damping: float) -> sv.Log:
    """What an IMU reads at this height above the speed sensor: g phi - l_z phi'' beside a_y."""
    w = 2.0 * np.pi * natural_hz
    t, ay = log["time_s"], log["ay_mps2"]
    roll = scipy.signal.lti(
        [[0.0, 0.0, w**2 * ROLL / G], [w**2 * ROLL / G, 0.0, 0.0]],
        [1.0, 2.0 * damping * w, w**2],
    ).to_ss()
    phi, phi2 = np.asarray(scipy.signal.lsim(roll, ay, t)[1]).T
    noise = np.random.default_rng(7).normal(0.0, 0.1, t.size)
    return log.corrected({"ay_mps2": ay + G * phi - above_m * phi2 + noise}, [])


@pytest.fixture(scope="module")
def lap() -> sv.Log:
    model = sv.Model(sv.example_vehicle())
    quiet = sv.SensorNoise(ay_mps2=0.0)
    return sv.drive(model, sv.manoeuvres.lap(60.0), noise=quiet, seed=11, rate_hz=50.0)


@pytest.fixture(scope="module")
def checked(lap: sv.Log) -> Callable[..., sv.SensorCheck]:
    """The check of such readings."""
    return cache(lambda *of: sv.check(rolling(lap, *of)))


@pytest.mark.parametrize(
    ("natural_hz", "damping"),
    [(1.8, 0.35), pytest.param(1.5, 0.25, marks=pytest.mark.manual)],
)
@pytest.mark.parametrize("above_m", [0.5, pytest.param(-0.3, marks=pytest.mark.manual), -0.5])
def test_an_imu_at_another_height_is_no_other_fault(
    checked: Callable[..., sv.SensorCheck], above_m: float, natural_hz: float, damping: float
) -> None:
    check = checked(above_m, natural_hz, damping)
    assert [fault.name for fault in check.found] == ["gain_ay"]
    roll = check["gain_ay"]
    assert abs(roll.value - ROLL) < 3.0 * roll.std
    for name in (*_DELAYS, "gain_yaw_rate", "imu_forward_m"):
        assert abs(check[name].value) < 3.0 * check[name].std
    if above_m > 0.0:  # below the speed sensor it is hidden by how late gravity by roll comes
        assert "where the roll of the body swings" in str(check)
        assert "speeds that were smoothed" in str(check)


def test_what_a_swinging_body_explains_as_well_is_no_fault(
    checked: Callable[..., sv.SensorCheck],
) -> None:
    delay = checked(-0.5, 1.8, 0.35)["delay_vy_s"]
    assert not delay.found
    assert "an IMU above the speed sensor, on a body that rolls" in delay.why_not


@pytest.mark.parametrize(
    "seed", [835833, 400135, *(pytest.param(s, marks=pytest.mark.manual) for s in (29175, 490582))]
)
def test_a_body_that_does_not_swing_is_not_said_to(seed: int) -> None:
    """Readings that swing with their own noise said so of one log in three."""
    truth = sv.Model(sv.example_vehicle())
    for road in (sv.manoeuvres.lap(60.0), sv.manoeuvres.handling_course()):
        check = sv.check(sv.drive(truth, road, seed=seed), truth.vehicle)
        assert check.found == ()
        assert "swings" not in str(check)
