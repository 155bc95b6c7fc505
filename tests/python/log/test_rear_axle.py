"""The sign of the lateral speed is told where the car hardly slides, too."""

import numpy as np
import pytest

from sysid_vehicle.errors import InvalidInput
from sysid_vehicle.log import Log

Columns = dict[str, np.ndarray]


def road(ahead_m: float, compliance: float) -> Columns:
    """Slow bends at varying speed by a car that leans, on a road that leans with its bends."""
    t = np.arange(0.0, 240.0, 0.01)
    noise = np.random.default_rng(5).standard_normal((6, t.size))
    speed = 18.0 + 8.0 * np.sin(0.05 * t)
    yaw_rate = 3.0 * np.sin(0.21 * t) * np.sin(0.033 * t) / speed
    ay = speed * yaw_rate
    bank = 0.1 * 9.81 * np.sin(0.021 * t) ** 2 * np.sign(yaw_rate)
    side = speed * (ahead_m * yaw_rate / speed - compliance * ay + 0.004)
    return {
        "time_s": t,
        "vx_mps": speed + 0.03 * noise[0],
        "vy_mps": side + 0.03 * noise[1],
        "yaw_rate_radps": yaw_rate + 0.002 * noise[2],
        "ax_mps2": np.gradient(speed, t) - side * yaw_rate + 0.06 * noise[3],
        "ay_mps2": 1.12 * ay - 0.5 * bank + 0.1 + 0.06 * noise[4],
        "steer_rad": 2.7 * yaw_rate / speed + 0.002 * ay + 1e-4 * noise[5],
    }


def test_a_wrong_sign_is_refused() -> None:
    data = road(1.4, 0.006)
    data["vy_mps"] *= -1.0
    with pytest.raises(InvalidInput, match=r"vy_mps: wrong sign.*slow corners.*factor = -1"):
        Log.from_arrays(data)


@pytest.mark.parametrize(
    ("ahead_m", "compliance"),
    [(1.4, 0.006), (-0.8, 0.006), (1.4, -0.002)],
    ids=["at the centre", "sensor behind the axle", "rear wheels that steer"],
)
def test_a_right_sign_is_not(ahead_m: float, compliance: float) -> None:
    Log.from_arrays(road(ahead_m, compliance))
