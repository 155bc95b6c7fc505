"""Simulated drives with one imperfection of real roads and sensors at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import signal

import sysid_vehicle as sv
from sysid_vehicle.simulate import drive_truth

Channels = dict[str, np.ndarray]
NOISE = sv.SensorNoise()
SPEEDS, INERTIAL = ("vx_mps", "vy_mps"), ("yaw_rate_radps", "ax_mps2", "ay_mps2")
TRUTHS = {
    "relaxation": ("tyre_relaxation", {"tyre_relaxation.relaxation_length_m": 0.45}),
    "sensitivity": ("tyre_load_sensitivity", {"tyre_load_sensitivity.sensitivity": 0.25}),
    "nothing": ("", {}),
}
_LOW_PASS_HZ = 15.0
# Of slow motion, by the bilinear transform at 100 Hz.
LOW_PASS_S = float(np.sqrt(2.0) / (200.0 * np.tan(np.pi * _LOW_PASS_HZ / 100.0)))
_DEVICES_S = {
    **dict.fromkeys(SPEEDS, 0.020),
    **dict.fromkeys(INERTIAL, 0.010),
    "steer_rad": 0.010,
}
# What a rung brings about: the wheel force is on time where all else is late by this at least.
_ON_TIME = {"force_lag.time_constant_s": min(_DEVICES_S.values())}
PRESENT = {"late": _ON_TIME, "all": _ON_TIME}
_QUANTA = {
    "vx_mps": 0.02,
    "vy_mps": 0.02,
    "yaw_rate_radps": 0.002,
    "ax_mps2": 0.05,
    "ay_mps2": 0.05,
    "steer_rad": 0.0005,
}


def _filtered(c: Channels, rng: np.random.Generator) -> None:
    """A causal second-order low-pass of 15 Hz in every sensor."""
    rate = 1.0 / float(c["time_s"][1] - c["time_s"][0])
    b, a = signal.butter(2, _LOW_PASS_HZ, fs=rate)
    for name in (*SPEEDS, *INERTIAL):
        start = signal.lfilter_zi(b, a) * c[name][0]
        c[name] = signal.lfilter(b, a, c[name], zi=start)[0]


def _late(c: Channels, rng: np.random.Generator) -> None:
    """Speeds 20 ms, inertial sensors 10 ms, steering 10 ms late."""
    for name, delay_s in _DEVICES_S.items():
        c[name] = np.interp(c["time_s"] - delay_s, c["time_s"], c[name])


def _coarse(c: Channels, rng: np.random.Generator) -> None:
    """In quanta of a CAN bus, every value held for two samples."""
    for name, quantum in _QUANTA.items():
        c[name] = np.repeat((quantum * np.round(c[name] / quantum))[::2], 2)[: c[name].size]


def _vibrating(c: Channels, rng: np.random.Generator) -> None:
    """12 Hz in accelerations and yaw rate, of a phase that wanders."""
    n = c["time_s"].size
    for name, amplitude in (("ax_mps2", 0.4), ("ay_mps2", 0.5), ("yaw_rate_radps", 0.004)):
        phase = np.cumsum(0.05 * rng.standard_normal(n)) + rng.uniform(0.0, 2.0 * np.pi)
        c[name] = c[name] + amplitude * np.sin(2.0 * np.pi * 12.0 * c["time_s"] + phase)


SENSORS: dict[str, tuple[tuple[Callable[[Channels, np.random.Generator], None], ...], ...]] = {
    # What acts on the motion, and what on the readings with their noise.
    "none": ((), ()),
    "pushes": ((), ()),
    "bumps": ((), ()),
    "road": ((), ()),
    "filtered": ((), (_filtered,)),
    "late": ((_late,), ()),
    "coarse": ((), (_coarse,)),
    "vibration": ((_vibrating,), ()),
    "all": ((_vibrating, _late), (_filtered, _coarse)),
}
_PUSHES, _SLOPE_RAD = (150.0, 200.0, 100.0), np.radians(1.5)
_DISTURBANCES = {
    "pushes": sv.RoadDisturbance(*_PUSHES, 0.3),
    "bumps": sv.RoadDisturbance(*_PUSHES, 0.03),
    "road": sv.RoadDisturbance(slope_rad=_SLOPE_RAD, slope_time_s=5.0),
    "all": sv.RoadDisturbance(*_PUSHES, 0.03, _SLOPE_RAD, 5.0),
}


def car(truth: str) -> sv.Model:
    """The car that is driven."""
    effect, values = TRUTHS[truth]
    model = sv.Model(sv.example_vehicle())
    return model.add(effect).with_values(values) if effect else model


def ride(rung: str, truth: str, manoeuvre: str, seed: int) -> sv.Log:
    """One drive on one rung; `manoeuvre` is `lap` or `handling_course`."""
    rng = np.random.default_rng([seed, len(manoeuvre)])
    drive = drive_truth(
        car(truth),
        getattr(sv.manoeuvres, manoeuvre)(),
        seed=rng,
        noise=sv.SensorNoise.none(),
        disturbance=_DISTURBANCES.get(rung),
    )
    # What perfect sensors would write.
    c = {name: np.array(drive.log[name]) for name in drive.log.channels}
    before, after = SENSORS[rung]
    for act in before:
        act(c, rng)
    n = c["time_s"].size
    for name in (*SPEEDS, *INERTIAL, "steer_rad"):
        c[name] = c[name] + getattr(NOISE, name) * rng.standard_normal(n)
    for act in after:
        act(c, rng)
    return sv.Log.from_arrays(c, name=f"{manoeuvre}, {rung}, seed {seed}")
