"""Moments in which one channel contradicts the others: a jump of a sensor, or a blow.

Faults last; what lasts a moment is none of them, and would be taken for noise of another colour, a
late channel or a body that swings. The noise of a channel is told by the middle one of its blocks,
which a moment does not move.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._common.arrays import FloatArray, as_float64, filled
from .._common.moment import Span, commands, moment_of
from .._common.text import number, unit_after
from ..log import CHANNELS, Log
from ..rules import USUAL
from .kinematics.colour import Colour
from .kinematics.equations import Readings, predict
from .kinematics.estimate import Estimate
from .kinematics.motion import Stretch

_LONGEST_S = 1.0
_FAR = 0.25  # of the largest difference


@dataclass(frozen=True)
class Moment:
    """A time in which a channel contradicts the motion that the others tell.

    Attributes
    ----------
    log : str
        Name of the log.
    channel : str
    from_s, until_s : float
        First and last sample of it.
    off : float
        The largest difference from that motion, in the unit of the channel.
    times_noise : float
        The same, over the channel's noise.
    number : int
        Of the log, of those that were checked.
    """

    log: str
    channel: str
    from_s: float
    until_s: float
    off: float
    times_noise: float
    number: int = 0

    def __str__(self) -> str:
        return (
            f"{self.channel}: from {self.from_s:.2f} to {self.until_s:.2f} s of '{self.log}' it is "
            f"off by up to {number(self.off, 2)}{unit_after(CHANNELS[self.channel].unit)} "
            f"({self.times_noise:.0f} times its noise) from the motion that the others "
            "tell: a jump of the sensor, or a blow that is quicker than this motion. All else is "
            "told without these readings, and they are left out of a log that is put right"
        )

    def at_once_with(self, other: Moment) -> bool:
        """Whether both are in the same log at the same time, as far as this is told."""
        apart_s = max(self.from_s - other.until_s, other.from_s - self.until_s)
        return self.number == other.number and apart_s < _LONGEST_S

    def holds(self, readings: Readings, stretches: Sequence[Stretch]) -> np.ndarray:
        """Which samples of a channel it holds, of shape (n,)."""
        if readings.channel != self.channel:
            return np.zeros(readings.time_s.size, dtype=bool)
        own = np.array([s.log == self.number for s in stretches])[readings.stretch]
        return own & (readings.time_s >= self.from_s) & (readings.time_s <= self.until_s)


def without(
    readings: Sequence[Readings], stretches: Sequence[Stretch], moments: Sequence[Moment]
) -> list[Readings]:
    """The readings that no moment holds."""
    left = []
    for r in readings:
        out = [moment.holds(r, stretches) for moment in moments]
        left.append(r.only(~np.any(out, axis=0)) if np.any(out) else r)
    return left


def moments_of(
    readings: Sequence[Readings],
    expected: dict[str, FloatArray],
    stretches: Sequence[Stretch],
    logs: Sequence[Log],
) -> list[Moment]:
    """The moment of each channel that has one.

    Parameters
    ----------
    readings : sequence of Readings
    expected : dict of array
        What each channel should have read.
    stretches : sequence of Stretch
    logs : sequence of Log
    """
    found = []
    for r in readings:
        off = r.values - expected[r.channel]
        spans = _spans(r)
        noise = _noise(off, spans)
        if not noise > 0.0:
            continue
        squares = as_float64((off / noise) ** 2)
        moment = moment_of(
            squares,
            np.ones(squares.size),
            _commands(r, stretches, logs),
            spans,
            longest_s=_LONGEST_S,
            least=USUAL.taken,
            level=USUAL.level,
            known_floor=False,
        )
        if moment is None:
            continue
        here = moment.inside
        largest = off[here][np.argmax(np.abs(off[here]))]
        log = stretches[r.stretch[here.start]].log
        begin, end = (float(r.time_s[i]) for i in (here.start, here.stop - 1))
        size = abs(float(largest)) / noise
        found.append(Moment(logs[log].name, r.channel, begin, end, float(largest), size, log))
    return found


def measured(
    moment: Moment,
    readings: Sequence[Readings],
    stretches: Sequence[Stretch],
    found: Estimate,
    noise: Mapping[str, tuple[Colour, FloatArray]],
) -> Moment:
    """The moment by the motion that is told without it, which it no longer bends."""
    (own,) = (r for r in readings if r.channel == moment.channel)
    off = as_float64(own.values - predict(own, found.grid, found.x, found.faults)[0])
    std = noise[moment.channel][0].std
    held = np.flatnonzero(moment.holds(own, stretches))
    largest = float(off[held][np.argmax(np.abs(off[held]))])
    # Without this channel the motion is less sure: what is a little off need not be.
    far = held[np.abs(off[held]) > _FAR * abs(largest)]
    begin, end = (float(own.time_s[i]) for i in far[[0, -1]])
    return replace(moment, from_s=begin, until_s=end, off=largest, times_noise=abs(largest) / std)


def left_out(
    log: Log, logs: Sequence[Log], moments: Sequence[Moment]
) -> tuple[dict[str, FloatArray], list[str]]:
    """Channels of a log without what its moments hold, and sentences on that.

    A log that is none of those that were checked has none.
    """
    own = [
        m
        for m in moments
        if log.has(m.channel)
        and np.array_equal(log["time_s"], logs[m.number]["time_s"])
        and np.array_equal(log[m.channel], logs[m.number][m.channel], equal_nan=True)
    ]
    channels: dict[str, FloatArray] = {}
    for m in own:
        inside = (log["time_s"] >= m.from_s) & (log["time_s"] <= m.until_s)
        channels[m.channel] = as_float64(
            np.where(inside, np.nan, channels.get(m.channel, log[m.channel]))
        )
    said = [f"{m.channel}: {m.from_s:.2f} to {m.until_s:.2f} s left out" for m in own]
    return channels, said


def _spans(readings: Readings) -> list[Span]:
    spans: list[Span] = []
    starts = np.flatnonzero(np.diff(readings.stretch, prepend=-1))
    for first, end in zip(starts, [*starts[1:], readings.stretch.size], strict=True):
        step = np.diff(readings.time_s[first:end])
        spans.append((int(first), int(end), 1.0 / float(np.median(step)) if step.size else 1.0))
    return spans


def _noise(off: FloatArray, spans: Sequence[Span]) -> float:
    """Standard deviation of the middle one of all blocks."""
    squares = []
    for first, end, rate in spans:
        width = max(round(_LONGEST_S * rate), 1)
        squares += [np.mean(off[i : min(i + width, end)] ** 2) for i in range(first, end, width)]
    return float(np.sqrt(np.median(squares)))


def _commands(readings: Readings, stretches: Sequence[Stretch], logs: Sequence[Log]) -> FloatArray:
    energy = np.zeros(readings.time_s.size)
    of_log = np.array([s.log for s in stretches])[readings.stretch]
    for at, log in enumerate(logs):
        own = of_log == at
        if not own.any():
            continue
        along = "fx_n" if log.has("fx_n") else "ax_mps2"
        asked = (
            filled(log[c]) if log.has(c) else np.zeros(log.n)
            for c in ("steer_rad", "vx_mps", along)
        )
        energy[own] = np.interp(readings.time_s[own], log["time_s"], commands(*asked))
    return energy
