"""Simulated drives with one imperfection of real roads and sensors at a time."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

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


_ALONE: dict[str, Callable[[Channels, np.random.Generator], None]] = {
    # What acts on the motion comes before what acts on readings with their noise.
    "vibration": _vibrating,
    "late": _late,
    "filtered": _filtered,
    "coarse": _coarse,
}
_ON_MOTION = ("vibration", "late")
_PUSHES, _SLOPE_RAD = (150.0, 200.0, 100.0), np.radians(1.5)
_ROADS: dict[str, dict[str, float]] = {
    "pushes": dict(zip(("fx_n", "fy_n", "mz_nm"), _PUSHES, strict=True), correlation_time_s=0.3),
    "bumps": dict(zip(("fx_n", "fy_n", "mz_nm"), _PUSHES, strict=True), correlation_time_s=0.03),
    "road": {"slope_rad": _SLOPE_RAD, "slope_time_s": 5.0},
}
_ALL = ("bumps", "road", *_ALONE)
RUNGS = ("none", *_ROADS, "filtered", "late", "coarse", "vibration", "all")
PAIRS = tuple(
    f"{one}+{other}"
    for one, other in combinations(RUNGS[1:-1], 2)
    if {one, other} != {"pushes", "bumps"}  # the road pushes with one correlation time
)


def imperfections(rung: str) -> tuple[str, ...]:
    """What a rung is made of: `none`, `all`, one, or several with a plus between them.

    Raises
    ------
    SystemExit
        If there is none of that name.
    """
    if rung in ("none", "all"):
        return _ALL if rung == "all" else ()
    parts = tuple(rung.split("+"))
    for name in parts:
        if name not in RUNGS[1:-1]:
            raise SystemExit(f"no rung '{name}': use {', '.join(RUNGS)}, or several as late+coarse")
    return parts


def present(rung: str) -> dict[str, float]:
    """What a rung brings about itself, by parameter of the catalogue."""
    # The wheel force is on time where all else is late by this at least.
    late = "late" in imperfections(rung)
    return {"force_lag.time_constant_s": min(_DEVICES_S.values())} if late else {}


def low_pass_s(rung: str) -> float:
    """Delay of the low-pass of a rung's sensors [s]."""
    return LOW_PASS_S if "filtered" in imperfections(rung) else 0.0


def car(truth: str) -> sv.Model:
    """The car that is driven."""
    effect, values = TRUTHS[truth]
    model = sv.Model(sv.example_vehicle())
    return model.add(effect).with_values(values) if effect else model


def ride(rung: str, truth: str, manoeuvre: str, seed: int) -> sv.Log:
    """One drive on one rung (`imperfections`); `manoeuvre` is `lap` or `handling_course`."""
    rng = np.random.default_rng([seed, len(manoeuvre)])
    parts = imperfections(rung)
    road = {key: value for name in parts for key, value in _ROADS.get(name, {}).items()}
    drive = drive_truth(
        car(truth),
        getattr(sv.manoeuvres, manoeuvre)(),
        seed=rng,
        noise=sv.SensorNoise.none(),
        disturbance=sv.RoadDisturbance(**road) if road else None,
    )
    # What perfect sensors would write.
    c = {name: np.array(drive.log[name]) for name in drive.log.channels}
    acting = [name for name in _ALONE if name in parts]
    for name in acting:
        if name in _ON_MOTION:
            _ALONE[name](c, rng)
    n = c["time_s"].size
    for name in (*SPEEDS, *INERTIAL, "steer_rad"):
        c[name] = c[name] + getattr(NOISE, name) * rng.standard_normal(n)
    for name in acting:
        if name not in _ON_MOTION:
            _ALONE[name](c, rng)
    return sv.Log.from_arrays(c, name=f"{manoeuvre}, {rung}, seed {seed}")
