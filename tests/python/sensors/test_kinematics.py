"""What sensors of a rigid body read, and how that depends on its motion and on their faults."""

import numpy as np
import pytest

from sysid_vehicle.sensors.kinematics.equations import (
    FAULTS,
    SLIPS,
    SWINGS,
    Readings,
    expected_of,
    predict,
)
from sysid_vehicle.sensors.kinematics.motion import Grid, Stretch

CHANNELS = ("vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
GRID = Grid([Stretch(0, 0.0, 3.0), Stretch(1, 5.0, 7.0)], step_s=0.1)


def readings(channel: str) -> Readings:
    """Samples of both stretches, of a body that swings and of wheels that slip."""
    rng = np.random.default_rng(7)
    time_s = np.concatenate([np.linspace(0.0, 3.0, 40), np.linspace(5.0, 7.0, 30)])
    stretch = np.repeat([0, 1], [40, 30])
    swings = rng.standard_normal((70, len(SWINGS))) if channel == "ay_mps2" else None
    slips = rng.standard_normal((70, len(SLIPS))) if channel == "vx_mps" else None
    return Readings(channel, stretch, time_s, np.zeros(70), swings, slips)


def motion() -> np.ndarray:
    """Any motion of a car: 20 m/s, with all else as large as it gets."""
    rng = np.random.default_rng(8)
    x = rng.standard_normal(GRID.size)
    x[GRID.index["vx"]] += 20.0
    return x


# Gravity counts where an axis feels more than the acceleration: both sides of that.
SIZES = {
    "with gravity": dict.fromkeys(FAULTS, 0.04),
    "without": {name: -0.04 if name.startswith("gain.a") else 0.03 for name in FAULTS},
}


@pytest.mark.parametrize("sizes", SIZES)
@pytest.mark.parametrize("channel", CHANNELS)
def test_derivatives_agree_with_differences(channel: str, sizes: str) -> None:
    faults, x, log = SIZES[sizes], motion(), readings(channel)
    expected, by_motion, by_fault = predict(log, GRID, x, faults)
    np.testing.assert_array_equal(expected, expected_of(log, GRID, x, faults))
    rng = np.random.default_rng(9)
    for _ in range(3):
        way = 1e-5 * rng.standard_normal(x.size)
        ahead, behind = (expected_of(log, GRID, x + s * way, faults) for s in (1.0, -1.0))
        np.testing.assert_allclose(by_motion @ way, (ahead - behind) / 2.0, rtol=1e-6, atol=1e-9)
    moved = set()
    for name, value in faults.items():
        ahead, behind = (
            expected_of(log, GRID, x, {**faults, name: value + s * 1e-6}) for s in (1.0, -1.0)
        )
        slope = (ahead - behind) / 2e-6
        told = by_fault.get(name, np.zeros(len(slope)))
        np.testing.assert_allclose(told, slope, rtol=1e-5, atol=1e-4, err_msg=name)
        if np.abs(slope).max() > 1e-3:
            moved.add(name)
    assert moved == {name for name, d in by_fault.items() if np.abs(d).max() > 1e-3}
    # Every fault of a channel moves it, but for a lean that nothing makes felt.
    own = {name for name, kind in FAULTS.items() if kind.channel == channel}
    assert own - moved <= {f"lean.{channel}"}


def test_speeds_are_those_of_the_motion_but_for_gain_bias_and_slip() -> None:
    x, none = motion(), dict.fromkeys(FAULTS, 0.0)
    for channel in CHANNELS[:3]:
        log = readings(channel)
        plain = expected_of(log, GRID, x, none)
        quick = GRID.quick(log.stretch, log.time_s)
        signal = {"vx_mps": "vx", "vy_mps": "vy", "yaw_rate_radps": "yaw"}[channel]
        value = np.sum(x[GRID.columns(signal, quick)] * quick.weights[0], axis=1)
        np.testing.assert_allclose(plain, value, rtol=1e-12)
        slipped = 1.0 if log.slips is None else 1.0 + log.slips @ [0.02, 0.03]
        given = dict(zip(SLIPS, (0.02, 0.03), strict=True))
        given |= {f"gain.{channel}": 0.05, f"bias.{channel}": 0.4}
        found = expected_of(log, GRID, x, none | given)
        np.testing.assert_allclose(found, 1.05 * slipped * value + 0.4, rtol=1e-12)


def test_accelerometers_feel_the_motion_of_their_place() -> None:
    """Of a car on a circle that speeds up, on a level road, by the path of the place in space."""
    grid = Grid([Stretch(0, 0.0, 4.0)], step_s=0.05)
    ahead, left, turn, slip = 0.7, -0.4, 0.03, 0.1

    def speeds(t: np.ndarray) -> tuple[np.ndarray, ...]:
        return 15.0 + 1.5 * t, slip * np.sin(t), 0.3 + 0.1 * t

    # Splines through the motion.
    t = np.linspace(0.0, 4.0, 801)
    quick = grid.quick(np.zeros(t.size, dtype=int), t)
    x = np.zeros(grid.size)
    for name, values in zip(("vx", "vy", "yaw"), speeds(t), strict=True):
        columns = grid.columns(name, quick)
        rows = np.zeros((t.size, grid.size))
        np.put_along_axis(rows, columns, quick.weights[0], axis=1)
        used = grid.index[name]
        x[used] = np.linalg.lstsq(rows[:, used], values, rcond=None)[0]
    # The place in space, and its acceleration by differences.
    fine = np.linspace(-0.01, 4.01, 40201)
    step = fine[1] - fine[0]
    vx, vy, r = speeds(fine)
    heading = np.concatenate([[0.0], np.cumsum(0.5 * (r[1:] + r[:-1]) * step)])
    body = (vx + 1j * vy) * np.exp(1j * heading)
    centre = np.concatenate([[0.0], np.cumsum(0.5 * (body[1:] + body[:-1]) * step)])
    place = centre + (ahead + 1j * left) * np.exp(1j * heading)
    felt = np.gradient(np.gradient(place, step), step) * np.exp(-1j * (heading + turn))
    at = np.linspace(0.5, 3.5, 31)
    faults = {"arm_x": ahead, "arm_y": left, "turn": turn}
    for channel, wanted in (("ax_mps2", felt.real), ("ay_mps2", felt.imag)):
        log = Readings(channel, np.zeros(31, dtype=int), at, np.zeros(31))
        told = expected_of(log, grid, x, faults)
        # The direction of the IMU enters to first order.
        np.testing.assert_allclose(told, np.interp(at, fine, wanted), atol=0.02)
