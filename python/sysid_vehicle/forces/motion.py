"""The smoothed motion of a car at the samples of its log, and draws of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray, as_float64
from ..sensors import SensorCheck
from ..sensors.kinematics.motion import Basis, Grid, IntArray

_AT_ONCE = 100  # draws


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of the speed sensor's place; every array has the shape (n,).

    Attributes
    ----------
    vx, vy : ndarray
        Velocity along and across the car [m/s].
    yaw, yaw_dot : ndarray
        Yaw rate [rad/s] and yaw acceleration [rad/s2].
    ax, ay : ndarray
        What an accelerometer without faults feels there: acceleration and gravity along a road
        that is not level, without the mean that bias and slope share [m/s2].
    """

    vx: FloatArray
    vy: FloatArray
    yaw: FloatArray
    yaw_dot: FloatArray
    ax: FloatArray
    ay: FloatArray


@dataclass(frozen=True, eq=False)
class Places:
    """Where in the splines the samples of the logs lie.

    Attributes
    ----------
    log, row, stretch : ndarray of int, shape (n,)
        Number of the log, of its row, and of the stretch of driving.
    time_s : ndarray, shape (n,)
    """

    log: IntArray
    row: IntArray
    stretch: IntArray
    time_s: FloatArray

    @classmethod
    def of(cls, check: SensorCheck) -> Places:
        """All samples within the stretches that the check used."""
        logs, rows, stretches, times = [], [], [], []
        for number, s in enumerate(check.stretches):
            time_s = check.logs[s.log]["time_s"]
            inside = np.flatnonzero((time_s >= s.first_s) & (time_s <= s.last_s))
            logs.append(np.full(inside.size, s.log, dtype=np.intp))
            rows.append(inside)
            stretches.append(np.full(inside.size, number, dtype=np.intp))
            times.append(time_s[inside])
        return cls(
            np.concatenate(logs),
            np.concatenate(rows),
            np.concatenate(stretches),
            as_float64(np.concatenate(times)),
        )

    def values(self, check: SensorCheck, channel: str) -> FloatArray:
        """Readings of a channel; a hole is bridged by a straight line."""
        out = np.empty(self.time_s.size)
        for number, log in enumerate(check.logs):
            own = self.log == number
            if own.any():
                known = np.isfinite(log[channel])
                at, read = log["time_s"][known], log[channel][known]
                out[own] = np.interp(self.time_s[own], at, read)
        return as_float64(out)

    def slope(self, values: FloatArray) -> FloatArray:
        """Time derivative of a signal, stretch by stretch."""
        out = np.zeros_like(values)
        for number in np.unique(self.stretch):
            own = self.stretch == number
            if np.count_nonzero(own) > 1:
                out[own] = np.gradient(values[own], self.time_s[own])
        return as_float64(out)


def smoothed(check: SensorCheck, places: Places) -> Motion:
    """The most likely motion at the samples."""
    return _Evaluation(check, places).motion(check.estimate.x)


def draws(check: SensorCheck, places: Places, count: int, seed: int) -> Iterator[Motion]:
    """Motions as likely as what the sensors leave open."""
    evaluation = _Evaluation(check, places)
    rng = np.random.default_rng(seed)
    for begun in range(0, count, _AT_ONCE):  # Ctrl-C is heard in between, and memory is bounded
        for x in check.estimate.draw(min(count - begun, _AT_ONCE), rng)[0].T:
            yield evaluation.motion(as_float64(x))


class _Evaluation:
    def __init__(self, check: SensorCheck, places: Places) -> None:
        self.grid: Grid = check.estimate.grid
        self.quick = self.grid.quick(places.stretch, places.time_s)
        self.slow = self.grid.slow(places.stretch, places.time_s)
        self.at = {s: self.grid.columns(s, self.quick) for s in ("vx", "vy", "yaw")}
        self.road_at = {s: self.grid.columns(s, self.slow) for s in ("grade", "bank")}

    def motion(self, x: FloatArray) -> Motion:
        vx, dvx = self._of(x, "vx")
        vy, dvy = self._of(x, "vy")
        r, dr = self._of(x, "yaw")
        grade, bank = (
            _value(x, self.road_at[s], self.slow, 0) - float(np.mean(x[self.grid.index[s]]))
            for s in ("grade", "bank")
        )
        return Motion(vx, vy, r, dr, dvx - vy * r + grade, dvy + vx * r + bank)

    def _of(self, x: FloatArray, signal: str) -> tuple[FloatArray, FloatArray]:
        at = self.at[signal]
        return _value(x, at, self.quick, 0), _value(x, at, self.quick, 1)


def _value(x: FloatArray, at: npt.NDArray[np.intp], basis: Basis, order: int) -> FloatArray:
    return as_float64(np.einsum("ij,ij->i", x[at], basis.weights[order]))
