"""Simulated drives whose sensors have known faults."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import signal

import sysid_vehicle as sv
from sysid_vehicle.simulate import drive_truth

Channels = dict[str, np.ndarray]
NOISE = sv.SensorNoise()
SENSORS = ("vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")


def clean(seed: int, seconds: float) -> Channels:
    """What perfect sensors would write: laps and handling courses, with wandering forces."""
    course = sv.manoeuvres.lap if seed % 2 else sv.manoeuvres.handling_course
    manoeuvre = course(seconds)
    push = sv.RoadDisturbance(150.0, 200.0, 100.0, 0.3)
    model = sv.Model(sv.example_vehicle())
    noise = sv.SensorNoise.none()
    log = drive_truth(model, manoeuvre, seed=seed, noise=noise, disturbance=push).log
    return {name: np.array(log[name]) for name in log.channels}


def noisy(c: Channels, seed: int) -> Channels:
    rng = np.random.default_rng([seed, 1])
    n = c["time_s"].size
    return {
        name: v + getattr(NOISE, name, 0.0) * rng.standard_normal(n) if name in SENSORS else v
        for name, v in c.items()
    }


def late(c: Channels, name: str, delay_s: float) -> None:
    c[name] = np.interp(c["time_s"] - delay_s, c["time_s"], c[name])


def moved(c: Channels, forward_m: float, left_m: float = 0.0) -> None:
    """Put the IMU elsewhere."""
    r = c["yaw_rate_radps"]
    dr = np.gradient(r, c["time_s"])
    c["ax_mps2"] = c["ax_mps2"] - forward_m * r**2 - left_m * dr
    c["ay_mps2"] = c["ay_mps2"] + forward_m * dr - left_m * r**2


def _nothing(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    return {}


def _ay_late(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    late(c, "ay_mps2", 0.02)
    return {"delay_ay_s": 0.02}


def _vy_late(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    late(c, "vy_mps", 0.02)
    return {"delay_vy_s": 0.02}


def _imu(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    moved(c, 0.4)
    return {"imu_forward_m": 0.4}


def _roll(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    gain = np.radians(5.0)
    c["ay_mps2"] = (1.0 + gain) * c["ay_mps2"]
    return {"gain_ay": gain}


def _scale(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    c["ay_mps2"] = 1.06 * c["ay_mps2"]
    return {"gain_ay": 0.06}


def _gyro_bias(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    c["yaw_rate_radps"] = c["yaw_rate_radps"] + 0.01
    return {"bias_yaw_rate_radps": 0.01}


def _several(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    """A roll gradient, an IMU ahead, and speeds of a slow and late sensor."""
    truth = {**_roll(c, rng), **_imu_before_roll(c, rng)}
    for name in ("vx_mps", "vy_mps"):
        late(c, name, 0.03)
    return {**truth, "delay_vx_s": 0.03, "delay_vy_s": 0.03}


def _imu_before_roll(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    r = c["yaw_rate_radps"]
    dr = np.gradient(r, c["time_s"])
    c["ax_mps2"] = c["ax_mps2"] - 0.4 * r**2
    c["ay_mps2"] = c["ay_mps2"] + 0.4 * (1.0 + np.radians(5.0)) * dr
    return {"imu_forward_m": 0.4}


def _bank(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    """A road that wanders by 1.5 deg rms across and along, over 5 s, in all that is felt."""
    n = c["time_s"].size
    keep = np.exp(-0.01 / 5.0)
    fresh = rng.standard_normal((2, n)) * np.sqrt(1.0 - keep**2)
    slope = 9.81 * np.radians(1.5) * signal.lfilter([1.0], [1.0, -keep], fresh)
    c["ax_mps2"] = c["ax_mps2"] + slope[0]
    c["ay_mps2"] = c["ay_mps2"] + slope[1]
    return {}


# Acting on the readings with their noise.
def _held(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    for name in ("ay_mps2", "ax_mps2"):
        c[name] = np.repeat(c[name][::2], 2)[: c[name].size]
    return {}


def _quantised(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    for name, q in (("ay_mps2", 0.1), ("ax_mps2", 0.1), ("yaw_rate_radps", 0.005), ("vx_mps", 0.1)):
        c[name] = q * np.round(c[name] / q)
    return {}


def _slow(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    for name in ("vx_mps", "vy_mps"):
        every = np.full(c[name].size, np.nan)
        every[::5] = c[name][::5]
        c[name] = every
    return {}


def _vibrating(c: Channels, rng: np.random.Generator) -> dict[str, float]:
    t = c["time_s"]
    phase = np.cumsum(rng.standard_normal(t.size)) * 0.05
    c["ay_mps2"] = c["ay_mps2"] + 0.7 * np.sin(2 * np.pi * 12.0 * t + phase)
    return {}


CASES: dict[str, tuple[Callable[[Channels, np.random.Generator], dict[str, float]], bool]] = {
    "nothing": (_nothing, False),
    "ay 20 ms late": (_ay_late, False),
    "vy 20 ms late": (_vy_late, False),
    "imu 0.4 m ahead": (_imu, False),
    "roll 5 deg/g": (_roll, False),
    "ay scale 6 %": (_scale, False),
    "gyro bias 0.01": (_gyro_bias, False),
    "several": (_several, False),
    "wandering road": (_bank, False),
    "held": (_held, True),
    "quantised": (_quantised, True),
    "slow speeds": (_slow, True),
    "vibration": (_vibrating, True),
}


def falsified(case: str, seed: int, seconds: float) -> tuple[sv.Log, dict[str, float]]:
    """A log with the fault, and the true values of the faults that are not zero."""
    act, on_readings = CASES[case]
    rng = np.random.default_rng([seed, 2])
    c = clean(seed, seconds)
    if on_readings:
        c = noisy(c, seed)
        truth = act(c, rng)
    else:
        truth = act(c, rng)
        c = noisy(c, seed)
    return sv.Log.from_arrays(c, name=f"{case}, seed {seed}", check=False), truth
