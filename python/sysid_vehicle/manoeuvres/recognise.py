"""Standard manoeuvres found in a log: which were driven, when, and what each measures.

Driving is cut where the car goes straight. What lies between two straight pieces is judged by the
steering and by the path: a step that is held, a sine of changing frequency, to the next lane and
back, steady cornering. What is none of these is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from .._common.arrays import FloatArray, filled
from .._common.typed import typed
from ..log import Log
from ..vehicle import Vehicle

_STRAIGHT_MPS2 = 0.6  # lateral acceleration of a car that goes straight
_STRAIGHT_S = 0.7  # for so long
_SMOOTHED_S = 0.15
_LEAST_S = 1.0
_STEADY_SPEED = 0.1  # relative change of a speed that counts as held
_STEP_RISE_S = 0.6  # from a tenth to nine tenths of the angle
_HELD_S = 1.0
_HELD_SHARE = 0.08  # of the angle that a held angle varies by
_LEAST_HALF_WAVES = 8
_FREQUENCY_RATIO = 1.8  # of the ends of a sweep
_OFFSET_M = (1.5, 6.0)  # to the next lane
_BETWEEN_S = 3.0  # of straight running within a double lane change
_BACK = 0.35  # of the offset: how far from its lane the car may end
_LONG_CHANGE_M = 75.0  # a double lane change of ISO 3888-2 is shorter
_LONGEST_CHANGE_M = 180.0
_CIRCLE_S = 8.0
_SAME_RADIUS = 0.12
_QUIET_MPS3 = 1.0  # change of the lateral acceleration in steady cornering
_LINEAR_MPS2 = 4.0  # range of the understeer gradient


@dataclass(frozen=True)
class Recognised:
    """A manoeuvre that was driven.

    Attributes
    ----------
    standard, name : str
        Such as `ISO 7401` and `step steer`.
    log_name : str
    start_s, stop_s : float
        In the time of the log.
    speed_mps : float
        Mean speed.
    lateral_mps2 : float
        Largest lateral acceleration.
    measures : mapping of str to float
        What the standard asks for, by name with unit.
    """

    standard: str
    name: str
    log_name: str
    start_s: float
    stop_s: float
    speed_mps: float
    lateral_mps2: float
    measures: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "measures", MappingProxyType(dict(self.measures)))

    def part(self, log: Log, margin_s: float = 1.0) -> Log:
        """The driving itself, with some straight running on either side."""
        return log.between(self.start_s - margin_s, self.stop_s + margin_s)

    def __reduce__(self) -> tuple[type[Recognised], tuple[object, ...]]:
        where = (self.standard, self.name, self.log_name, self.start_s, self.stop_s)
        return Recognised, (*where, self.speed_mps, self.lateral_mps2, dict(self.measures))

    def __str__(self) -> str:
        told = ", ".join(f"{name} {value:.3g}" for name, value in self.measures.items())
        return (
            f"{self.start_s:8.1f} to {self.stop_s:8.1f} s  {self.standard:11s} {self.name:26s} "
            f"{self.speed_mps:5.1f} m/s  {self.lateral_mps2:4.1f} m/s2  {told}"
        )


@typed
def recognise(log: Log, vehicle: Vehicle) -> tuple[Recognised, ...]:
    """Find the standard manoeuvres that a log holds.

    Parameters
    ----------
    log : Log
        However long; it may hold any other driving too.
    vehicle : Vehicle
        Its wheelbase is what steering is measured against.

    Returns
    -------
    tuple of Recognised
        In the order of time. Known are: ISO 4138, steady-state circular driving at constant radius
        or at constant speed; ISO 7401, step input and continuous sinusoidal input; ISO 3888-1 and
        3888-2, double lane change.
    """
    found = []
    for stretch in log.stretches():
        whole = _Motion.of(log, stretch)
        events = _events(whole)
        while events:
            start, stop = events.pop(0)
            event = whole.cut(start, stop)
            told = _step(event) or _sweep(event) or _lane_change(event) or _steady(event, vehicle)
            if told is None and events and events[0][0] - stop < _BETWEEN_S * log.rate_hz:
                # The straight between two lane changes may be long enough to count as one.
                event = whole.cut(start, events[0][1])
                told = _lane_change(event)
                if told is not None:
                    del events[0]
            if told is None:
                continue
            standard, name, measures = told
            found.append(
                Recognised(
                    standard,
                    name,
                    log.name,
                    float(event.time_s[0]),
                    float(event.time_s[-1]),
                    float(event.v.mean()),
                    float(np.abs(event.a_y).max()),
                    measures,
                )
            )
    return tuple(found)


Told = tuple[str, str, dict[str, float]]


@dataclass(frozen=True)
class _Motion:
    """Smoothed motion over a piece of driving."""

    rate_hz: float
    time_s: FloatArray
    v: FloatArray
    r: FloatArray
    a_y: FloatArray
    steer: FloatArray

    @classmethod
    def of(cls, log: Log, where: slice) -> _Motion:
        """Of a log; the steering angle counts from where the car goes straight."""
        width = max(1, round(_SMOOTHED_S * log.rate_hz)) | 1

        def smooth(name: str) -> FloatArray:
            values = log[name][where]
            if not np.isfinite(values).any():
                return np.zeros(values.size)
            padded = np.pad(filled(values), width // 2, mode="edge")
            return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")

        steer, a_y = smooth("steer_rad"), smooth("ay_mps2")
        straight = np.abs(a_y) < _STRAIGHT_MPS2
        zero = float(np.median(steer[straight])) if straight.any() else 0.0
        v, r = smooth("vx_mps"), smooth("yaw_rate_radps")
        return cls(log.rate_hz, log["time_s"][where], v, r, a_y, steer - zero)

    def cut(self, start: int, stop: int) -> _Motion:
        """Some of its samples."""
        part = (x[start:stop] for x in (self.time_s, self.v, self.r, self.a_y, self.steer))
        return _Motion(self.rate_hz, *part)

    @property
    def speed_held(self) -> bool:
        """Whether the speed hardly changes."""
        return bool(np.ptp(self.v) < _STEADY_SPEED * self.v.mean())

    @property
    def distance_m(self) -> FloatArray:
        """Distance since the first sample."""
        return np.cumsum(self.v) / self.rate_hz


def _events(motion: _Motion) -> list[tuple[int, int]]:
    """Ranges of samples between straight running, with a little of it on either side."""
    turning = np.abs(motion.a_y) >= _STRAIGHT_MPS2
    at = np.flatnonzero(turning)
    if at.size == 0:
        return []
    gaps = np.flatnonzero(np.diff(at) > _STRAIGHT_S * motion.rate_hz)
    starts, stops = at[np.r_[0, gaps + 1]], at[np.r_[gaps, at.size - 1]]
    margin = round(0.3 * motion.rate_hz)
    return [
        (max(int(a) - margin, 0), min(int(b) + margin, len(motion.v)))
        for a, b in zip(starts, stops, strict=True)
        if (b - a) >= _LEAST_S * motion.rate_hz
    ]


def _step(event: _Motion) -> Told | None:
    """ISO 7401, step input: the angle rises at once and is held; the car comes to a steady turn."""
    size = np.abs(event.steer)
    if not event.speed_held or (event.steer.max() > 0.2 * size.max() < -event.steer.min()):
        return None
    high = np.flatnonzero(size > 0.9 * size.max())
    low = np.flatnonzero(size[: high[0]] < 0.1 * size.max())
    if low.size == 0:
        return None
    begin, end = int(low[-1]), int(high[0])
    held = event.steer[end : int(high[-1]) + 1]
    plateau = float(np.median(held))
    inside = np.abs(held - plateau) < _HELD_SHARE * abs(plateau)
    if (
        (end - begin) > _STEP_RISE_S * event.rate_hz
        or held.size < _HELD_S * event.rate_hz
        or inside.mean() < 0.95
    ):
        return None
    half = begin + int(np.argmax(size[begin:] > 0.5 * abs(plateau)))
    last = end + held.size
    tail = max(round(0.3 * event.rate_hz), 1)
    yaw = event.r * np.sign(plateau)
    final = float(yaw[last - 2 * tail : last - tail // 2].mean())
    reached = half + int(np.argmax(yaw[half:] >= 0.9 * final))
    measures = {
        "yaw_gain_ps": final / abs(plateau),
        "response_time_s": (reached - half) / event.rate_hz,
        "overshoot": float(yaw[half:last].max()) / final - 1.0,
    }
    return "ISO 7401", "step input", measures


def _sweep(event: _Motion) -> Told | None:
    """ISO 7401, continuous sinusoidal input: gain and phase of the yaw rate."""
    signs = np.sign(event.steer)
    crossings = np.flatnonzero(signs[1:] * signs[:-1] < 0.0)
    if not event.speed_held or len(crossings) <= _LEAST_HALF_WAVES:
        return None
    half_waves = np.diff(crossings) / event.rate_hz
    ends = half_waves[:3].mean() / half_waves[-3:].mean()
    falling = np.mean(np.sign(np.diff(half_waves)) != np.sign(np.log(ends)))
    if not (ends > _FREQUENCY_RATIO or ends < 1.0 / _FREQUENCY_RATIO) or falling < 0.7:
        return None
    n = len(event.steer)
    frequency = np.fft.rfftfreq(4 * n, 1.0 / event.rate_hz)
    steer, yaw = (np.fft.rfft(x, 4 * n) for x in (event.steer, event.r))
    measures = {}
    slow = 0.5 / max(half_waves[:3].mean(), half_waves[-3:].mean())
    fast = 0.5 / min(half_waves[:3].mean(), half_waves[-3:].mean())
    for hz in (0.5, 1.0, 2.0):
        near = (frequency > 0.85 * hz) & (frequency < 1.15 * hz)
        if slow < 0.85 * hz and 1.15 * hz < fast:
            gain = np.sum(yaw[near] * steer[near].conj()) / np.sum(np.abs(steer[near]) ** 2)
            measures[f"yaw_gain_at_{hz:g}hz_ps"] = float(np.abs(gain))
            measures[f"phase_at_{hz:g}hz_deg"] = float(np.degrees(np.angle(gain)))
    return "ISO 7401", "continuous sinusoidal input", measures


def _lane_change(event: _Motion) -> Told | None:
    """ISO 3888: to the next lane and back, parallel to where it began."""
    dt = 1.0 / event.rate_hz
    # The course follows from the lateral acceleration: the sideslip need not be known.
    course = np.cumsum(event.a_y / event.v) * dt
    aside = np.cumsum(event.v * np.sin(course)) * dt
    length = float(event.distance_m[-1])
    offset = float(aside[np.argmax(np.abs(aside))])
    # A course that drifts by the noise of a sensor ends beside its lane: a line takes that out.
    straight = aside - np.linspace(0.0, aside[-1], aside.size)
    if not (
        _OFFSET_M[0] < abs(offset) < _OFFSET_M[1]
        and abs(aside[-1]) < _BACK * abs(offset)
        and abs(course[-1]) < 0.06
        and length < _LONGEST_CHANGE_M
        and np.count_nonzero(np.diff(np.sign(event.steer)) != 0) >= 2
        and event.a_y.max() > _STRAIGHT_MPS2 < -event.a_y.min()
    ):
        return None
    standard = "ISO 3888-2" if length < _LONG_CHANGE_M else "ISO 3888-1"
    measures = {
        "entry_speed_mps": float(event.v[0]),
        "offset_m": float(straight[np.argmax(np.abs(straight))]),
        "length_m": length,
    }
    return standard, "double lane change", measures


def _steady(event: _Motion, vehicle: Vehicle) -> Told | None:
    """ISO 4138: steady-state circular driving, by radius or by speed."""
    duration = len(event.v) / event.rate_hz
    left = np.sign(np.median(event.a_y))
    a_y, steer = left * event.a_y, left * event.steer
    inner = a_y > 1.0
    if duration < _CIRCLE_S or inner.mean() < 0.6:
        return None
    second = max(round(event.rate_hz), 1)
    slow = np.convolve(a_y, np.full(second, 1.0 / second), mode="valid")
    changes = np.abs(slow[second:] - slow[:-second])
    if changes.size == 0 or np.quantile(changes, 0.85) > _QUIET_MPS3 or np.ptp(a_y[inner]) < 1.0:
        return None
    curvature = left * event.r[inner] / event.v[inner]
    mean = float(np.median(curvature))
    same = np.abs(curvature - mean) < _SAME_RADIUS * mean
    if same.mean() > 0.85 and not event.speed_held:
        name = "steady circle, constant radius"
        measures = {"radius_m": 1.0 / mean}
    elif event.speed_held:
        name, measures = "steady circle, constant speed", {}
    else:
        return None
    linear = inner & (a_y < _LINEAR_MPS2)
    if linear.sum() > second:
        over = steer[linear] - vehicle.wheelbase_m * left * event.r[linear] / event.v[linear]
        measures["understeer_radps2pm"] = float(np.polyfit(a_y[linear], over, 1)[0])
    return "ISO 4138", name, measures
