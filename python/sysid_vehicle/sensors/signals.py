"""What can be seen of a log's channels before any motion is estimated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray, filled
from ..errors import InvalidInput
from ..log import CHANNELS, MEASURED, Log, held_rows
from ..log.laws.regression import in_most
from ..log.signals import runs
from ..vehicle import GRAVITY_MPS2
from .kinematics.colour import neighbours
from .kinematics.equations import Readings
from .kinematics.motion import IntArray, Stretch

MOVING = MEASURED  # channels of which the motion is made
_SHORTEST_S = 3.0
_LONGEST_HOLE_S = 0.6  # without a sample of a channel the motion is not told
_PIECE_S = 20.0
_MOST_S = 200.0  # of all logs: more does not change what is found
_FEWEST = 50


@dataclass(frozen=True)
class Signal:
    """How one channel was recorded.

    Attributes
    ----------
    log, channel : str
        Where.
    rate_hz : float
        Rate of its own samples.
    held_rows : float
        For how many rows a value is repeated; 0 where it is not.
    quantum : float
        Step in which it counts; 0 where none is seen.
    missing : float
        Share of rows without a value, beyond its own rate.
    """

    log: str
    channel: str
    rate_hz: float
    held_rows: float
    quantum: float
    missing: float


def signals(log: Log) -> list[Signal]:
    """Rate, hold and quantum of each canonical channel."""
    found = []
    for channel in CHANNELS:
        if channel == "time_s" or not log.has(channel):
            continue
        values = log[channel]
        known, every = own_samples(values)
        if known.size < 2:
            continue
        held = held_rows(values)
        lost = 1.0 - known.size * every / max(1, known[-1] - known[0] + every)
        found.append(
            Signal(
                log.name,
                channel,
                log.rate_hz / max(every, held),
                held,
                quantum(values[known]),
                max(0.0, float(lost)),
            )
        )
    return found


def own_samples(values: FloatArray) -> tuple[IntArray, int]:
    """Rows at which a channel has a value, and how many rows lie between two as a rule."""
    known = np.flatnonzero(np.isfinite(values))
    return known, max(1, int(np.median(np.diff(known)))) if known.size > 1 else 1


def quantum(values: FloatArray) -> float:
    """Step of which all values are multiples, where they are; else 0."""
    levels = np.unique(values)
    if levels.size < 3 or levels.size > 0.5 * values.size:
        return 0.0
    gaps = np.diff(levels)
    step = float(np.median(gaps[gaps <= 1.5 * np.percentile(gaps, 10)]))
    counts = gaps / step
    whole = np.abs(counts - np.round(counts)) < 0.05
    return step if step > 0.0 and float(np.mean(whole)) > 0.98 else 0.0


def pieces(logs: Sequence[Log]) -> list[Stretch]:
    """Stretches in which the car moves and all channels are alive, the liveliest ones."""
    found: list[tuple[float, Stretch]] = []
    for number, log in enumerate(logs):
        time_s = log["time_s"]
        usable = filled(log["vx_mps"]) > log.least_speed_mps
        for channel in MOVING:
            if log.has(channel):
                usable &= ~_in_holes(time_s, log[channel])
        for a, b in runs(usable):
            count = max(1, round((time_s[b - 1] - time_s[a]) / _PIECE_S))
            cuts = np.linspace(a, b, count + 1).astype(np.intp)
            for i, j in pairwise(cuts):
                if time_s[j - 1] - time_s[i] >= _SHORTEST_S:
                    lively = float(np.nanstd(log["ay_mps2"][i:j]) + np.nanstd(log["vx_mps"][i:j]))
                    piece = Stretch(number, float(time_s[i]), float(time_s[j - 1]))
                    found.append((lively, piece))
    kept: list[Stretch] = []
    for _, piece in sorted(found, key=lambda item: -item[0]):
        if sum(s.last_s - s.first_s for s in kept) < _MOST_S:
            kept.append(piece)
    if not kept:
        names = ", ".join(log.name for log in logs)
        least = min(log.least_speed_mps for log in logs)
        raise InvalidInput(
            f"{names}: nowhere does the car move faster than {least:.3g} m/s for "
            f"{_SHORTEST_S:g} s with all channels alive; give a log of driving"
        )
    return _joined(sorted(kept, key=lambda s: (s.log, s.first_s)), logs)


def _joined(kept: list[Stretch], logs: Sequence[Log]) -> list[Stretch]:
    result: list[Stretch] = []
    for piece in kept:
        last = result[-1] if result else None
        if last and last.log == piece.log:
            gap = piece.first_s - last.last_s
            if gap < 1.5 / logs[piece.log].rate_hz:
                result[-1] = Stretch(piece.log, last.first_s, piece.last_s)
                continue
        result.append(piece)
    return result


def readings_of(logs: Sequence[Log], stretches: Sequence[Stretch]) -> list[Readings]:
    """The samples of each channel of the motion; repeated values of held channels count once."""
    result = []
    for channel in MOVING:
        if not all(log.has(channel) for log in logs):
            continue
        at, times, values = [], [], []
        for number, stretch in enumerate(stretches):
            log = logs[stretch.log]
            inside = (log["time_s"] >= stretch.first_s) & (log["time_s"] <= stretch.last_s)
            inside &= np.isfinite(log[channel]) & ~_repeated(log[channel])
            times.append(log["time_s"][inside])
            values.append(log[channel][inside])
            at.append(np.full(times[-1].size, number, dtype=np.intp))
        joined = np.concatenate(values)
        if joined.size < _FEWEST:
            names = ", ".join(log.name for log in logs)
            raise InvalidInput(
                f"{names}: {channel} holds only {joined.size} samples while the car moves; give a "
                f"log with at least {_FEWEST}"
            )
        result.append(Readings(channel, np.concatenate(at), np.concatenate(times), joined))
    return result


def averaged(readings: Readings, over_s: float) -> Readings:
    """Means of a few samples each, at their mean time: faster, and the splines lose nothing.

    Parameters
    ----------
    readings : Readings
        At the rate of the sensor.
    over_s : float
        Length of a mean.
    """
    period = float(np.median(np.diff(readings.time_s)[np.diff(readings.stretch) == 0]))
    every = int(over_s / period + 1e-6)
    if every < 2:
        return readings
    run = neighbours(readings.stretch, readings.time_s)
    last = np.flatnonzero(run % every == every - 1)
    at = last[:, None] - np.arange(every)
    return Readings(
        readings.channel,
        readings.stretch[last],
        readings.time_s[at].mean(axis=1),
        readings.values[at].mean(axis=1),
        None if readings.swings is None else readings.swings[at].mean(axis=1),
        None if readings.slips is None else readings.slips[at].mean(axis=1),
    )


def refuse_mixed_up(logs: Sequence[Log], readings: Sequence[Readings]) -> None:
    """Refuse channels that are mirrored, swapped or of another unit.

    Raises
    ------
    InvalidInput
        The message says what to put into the channel map.
    """
    name = ", ".join(log.name for log in logs)
    by = {r.channel: r for r in readings}
    base = by["ay_mps2"]
    vx, yaw = (_at(by[c], base) for c in ("vx_mps", "yaw_rate_radps"))
    turn, felt = _slowly(vx * yaw, base), _slowly(base.values, base)
    if float(np.std(turn)) < 0.3:
        return
    # ay = vx r + d(vy)/dt: a car that slides feels far less than its turn.
    changes = []
    if "vy_mps" in by:
        changes = [_slowly(_rate_of(_at(by["vy_mps"], base), base), base)]
    slope, fit = _slope(*_without(changes, felt, turn))
    if "ax_mps2" in by:
        other = _slowly(_at(by["ax_mps2"], base), base)
        if fit < 0.5 and _slope(other, turn)[1] > 0.9:
            raise InvalidInput(
                f"{name}: ay_mps2 does not follow vx_mps * yaw_rate_radps and ax_mps2 does: the "
                f"two are swapped; exchange their columns in the channel map"
            )
    if fit < 0.8:
        return
    if slope < -0.02:
        raise InvalidInput(
            f"{name}: ay_mps2 is {slope:.3g} times vx_mps * yaw_rate_radps: one of ay_mps2 and "
            f"yaw_rate_radps is positive to the right; put factor = -1 for it in the channel map"
        )
    for factor, words in (
        (1 / GRAVITY_MPS2, "ay_mps2 is in g: put factor = 9.80665 for ay_mps2"),
        (1 / 57.29578, "yaw_rate_radps is in deg/s: put factor = 0.01745329 for yaw_rate_radps"),
        (1 / 3.6, "vx_mps is in km/h: put factor = 0.2777778 for vx_mps"),
        (1 / 2.236936, "vx_mps is in mph: put factor = 0.44704 for vx_mps"),
    ):
        alike = changes or in_most(slope, turn, felt, 0.3)
        if 0.87 < slope / factor < 1.15 and alike:
            raise InvalidInput(
                f"{name}: ay_mps2 is {slope:.3g} times vx_mps * yaw_rate_radps: probably {words} "
                f"in the channel map"
            )


def _slope(y: FloatArray, x: FloatArray) -> tuple[float, float]:
    y, x = y - y.mean(), x - x.mean()
    both, own = float(x @ y), float(x @ x)
    return both / own, both**2 / (own * max(float(y @ y), 1e-300))


def _without(columns: list[FloatArray], *values: FloatArray) -> list[FloatArray]:
    """Values without what these columns and a constant explain of them."""
    x = np.column_stack([*columns, np.ones_like(values[0])])
    return [v - x @ np.linalg.lstsq(x, v, rcond=None)[0] for v in values]


def _rate_of(values: FloatArray, base: Readings) -> FloatArray:
    """Derivative of a channel over the times of another."""
    return np.asarray(np.gradient(values, base.time_s + 1e6 * base.stretch))


def _at(readings: Readings, base: Readings) -> FloatArray:
    """Values of a channel at the times of another; time goes on from stretch to stretch."""
    offset = 1e6
    own = readings.time_s + offset * readings.stretch
    return np.interp(base.time_s + offset * base.stretch, own, readings.values)


def _slowly(values: FloatArray, base: Readings) -> FloatArray:
    """Means over half a second."""
    keys = np.floor(base.time_s / 0.5) + 1e7 * base.stretch
    _, at, count = np.unique(keys, return_inverse=True, return_counts=True)
    means: FloatArray = np.bincount(np.ravel(at), values) / count
    return means


def _repeated(values: FloatArray) -> npt.NDArray[np.bool_]:
    result = np.zeros(values.size, dtype=bool)
    if held_rows(values):
        known = np.flatnonzero(np.isfinite(values))
        result[known[1:][np.diff(values[known]) == 0.0]] = True
    return result


def _in_holes(time_s: FloatArray, values: FloatArray) -> npt.NDArray[np.bool_]:
    own = time_s[np.isfinite(values)]
    if own.size < 2:
        return np.ones(time_s.size, dtype=bool)
    k = np.clip(np.searchsorted(own, time_s), 1, own.size - 1)
    hole = np.maximum(own[k] - own[k - 1], 0.0) > _LONGEST_HOLE_S
    outside = (time_s < own[0] - _LONGEST_HOLE_S) | (time_s > own[-1] + _LONGEST_HOLE_S)
    lost: npt.NDArray[np.bool_] = (hole & (time_s > own[0])) | outside
    return lost
