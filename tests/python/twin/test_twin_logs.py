"""The twin's car as a truth for models of the single track."""

import numpy as np
import pytest
from scipy import signal
from scipy.spatial.transform import Rotation

from sysid_vehicle import InvalidInput, Model, SensorNoise, compare, identify
from sysid_vehicle.manoeuvres import double_lane_change
from sysid_vehicle.twin import SPORTS_CAR, Drive14, on_manoeuvre, single_track, to_log


@pytest.fixture(scope="module")
def lanes() -> Drive14:
    return on_manoeuvre(SPORTS_CAR, None, double_lane_change((22.0,)))


def test_a_log_is_what_sensors_read(lanes: Drive14) -> None:
    log = to_log(SPORTS_CAR, lanes, seed=1, noise=SensorNoise.none())
    assert log.rate_hz == pytest.approx(100.0)
    np.testing.assert_allclose(log["yaw_rate_radps"], lanes["yaw_rate_radps"][::10])
    # What the tyres give, and what the rolling resistance takes before.
    weight = SPORTS_CAR.design.mass_kg * 9.81
    rolling = log["fx_n"] - lanes["wheel_force_n"][::10]
    assert np.mean(rolling) == pytest.approx(0.011 * weight, rel=0.2)
    assert np.std(rolling) < 0.1 * np.std(log["fx_n"])
    every = {"seed": 1, "noise": SensorNoise.none(), "rate_hz": 1000.0}
    asked = to_log(SPORTS_CAR, lanes, steer_lag_s=0.05, **every)["steer_rad"]  # type: ignore[arg-type]
    share = 1.0 - np.exp(-0.001 / 0.05)
    followed = signal.lfilter([share], [1.0, share - 1.0], asked)
    assert np.std(followed - lanes["steer_rad"]) < 0.02 * np.std(asked - lanes["steer_rad"])
    # The accelerometer turns with the body, and its axes with it.
    felt = np.column_stack([lanes["plane_ay_mps2"] * 0.0, lanes["plane_ay_mps2"], lanes["az_mps2"]])
    turned = Rotation.from_euler("x", lanes["roll_rad"][:, None]).inv().apply(felt)
    np.testing.assert_allclose(log["ay_mps2"], turned[::10, 1], atol=1e-12)
    felt = np.column_stack([lanes["plane_ax_mps2"], lanes["plane_ax_mps2"] * 0.0, lanes["az_mps2"]])
    turned = Rotation.from_euler("y", lanes["pitch_rad"][:, None]).inv().apply(felt)
    np.testing.assert_allclose(log["ax_mps2"], turned[::10, 0], atol=1e-12)
    with pytest.raises(InvalidInput, match="divisor"):
        to_log(SPORTS_CAR, lanes, seed=1, rate_hz=300.0)


def test_a_single_track_fits_it_but_not_to_the_noise(lanes: Drive14) -> None:
    log = to_log(SPORTS_CAR, lanes, seed=2)
    fit = identify(Model(single_track(SPORTS_CAR)), log, starts=1)
    assert 1.0 < compare(fit, log).error < 20.0
