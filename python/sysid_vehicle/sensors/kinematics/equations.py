"""What each sensor reads of a motion, and how that depends on motion and sensor faults.

Kinematics alone: the acceleration of a point of a rigid body that moves in the plane, in axes that
turn with it (Klein & Morelli, Aircraft System Identification, 2nd ed., ch. 10; Jategaonkar, Flight
Vehicle System Identification, ch. 10). No tyre, mass or inertia stands in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from ..._common.arrays import FloatArray
from ...vehicle import GRAVITY_MPS2
from .motion import QUICK, SLOW, Basis, Grid, IntArray


@dataclass(frozen=True)
class FaultKind:
    """A fault of a sensor.

    Attributes
    ----------
    name : str
        `delay.ay_mps2` and the like.
    channel : str
        Channel that reads wrongly.
    typical : float
        Scale of the Cauchy prior. Its tails are long: a fault that the log shows is not shrunk,
        and of several that would explain the same the small ones are taken.
    most : float
        Standard deviation of a normal prior on top, for what no sensor has.
    below : float
        Scale for negative values where these are to be claimed, if it differs: gravity by roll and
        pitch makes an accelerometer read more, never less.
    """

    name: str
    channel: str
    typical: float
    most: float = 10.0
    below: float = 0.0

    def cost(self, value: float, *, one_sided: bool = False) -> float:
        """How much less likely a value is than none, by the prior [nats]."""
        scale = self.below if one_sided and value < 0.0 < self.below else self.typical
        return float(np.log1p((value / scale) ** 2) + 0.5 * (value / self.most) ** 2)


# How late gravity by roll and pitch comes after the acceleration: 2 D/w and more towards the body's
# natural frequency, 1 to 2 Hz with a damping of 0.2 to 0.4.
LEAN_S, LEAN_STD_S = 0.1, 0.06
# Standard deviation of what an IMU feels of a roll that swings, per swing of the lateral
# acceleration [s2]: roll of 4 degrees per g, an IMU half a metre above or below the speed sensor.
SWING_STD_S2 = 0.5 * math.radians(4.0) / GRAVITY_MPS2
SWINGS = {"swing.slow": 1.2, "swing.quick": 2.2}
"""Faults by a body that swings, with natural frequencies that are spread as those of cars [Hz]."""

# Standard deviation of the slip of wheels per acceleration [s2/m]: a car's mass over the slip
# stiffness of the tyres of an axle.
SLIP_STD_S2PM = 0.01
SLIPS = ("slip.driven", "slip.braked")
"""Faults by wheels whose speed is logged and that slip."""

FAULTS = {
    kind.name: kind
    for kind in (
        FaultKind("delay.speeds", "vx_mps", 0.03),
        FaultKind("delay.vx_mps", "vx_mps", 0.003),
        FaultKind("delay.vy_mps", "vy_mps", 0.003),
        FaultKind("delay.ay_mps2", "ay_mps2", 0.003),
        FaultKind("gain.yaw_rate_radps", "yaw_rate_radps", 0.002, 0.03),
        FaultKind("gain.ax_mps2", "ax_mps2", 0.03, below=0.002),
        FaultKind("gain.ay_mps2", "ay_mps2", 0.03, below=0.002),
        FaultKind("bias.yaw_rate_radps", "yaw_rate_radps", 0.003),
        FaultKind("bias.vy_mps", "vy_mps", 0.05),
        FaultKind("arm_x", "ay_mps2", 0.4),
        FaultKind("arm_y", "ax_mps2", 0.15),
        FaultKind("turn", "ay_mps2", 0.01),
        # A body leans later than its wheels are pushed, more or less than is usual.
        FaultKind("lean.ax_mps2", "ax_mps2", 1e3, LEAN_STD_S),
        FaultKind("lean.ay_mps2", "ay_mps2", 1e3, LEAN_STD_S),
        # The body rolls as an oscillator, and an IMU above the speed sensor swings with it.
        *(FaultKind(name, "ay_mps2", 1e3, SWING_STD_S2) for name in SWINGS),
        *(FaultKind(name, "vx_mps", 1e3, SLIP_STD_S2PM) for name in SLIPS),
    )
}
_SPEEDS = ("vx_mps", "vy_mps")  # of one device as a rule
_NEEDS = {
    "vx_mps": ("vx",),
    "vy_mps": ("vy",),
    "yaw_rate_radps": ("yaw",),
    "ax_mps2": ("vx", "vy", "yaw", "grade"),
    "ay_mps2": ("vx", "vy", "yaw", "bank"),
}


@dataclass(frozen=True, eq=False)
class Readings:
    """The samples of one channel, each at its own time.

    Attributes
    ----------
    channel : str
        Canonical name.
    stretch : ndarray of int, shape (n,)
        Stretch of each sample.
    time_s : ndarray, shape (n,)
        When it was written.
    values : ndarray, shape (n,)
        What was written; never NaN.
    swings : ndarray, shape (n, len(SWINGS)), optional
        Second derivatives of what should have been written [m/s4], as a body follows it that
        swings, of an axis that feels them (`swing.py`).
    slips : ndarray, shape (n, len(SLIPS)), optional
        What the slip of wheels grows with [m/s2] (`slip.py`).
    """

    channel: str
    stretch: IntArray
    time_s: FloatArray
    values: FloatArray
    swings: FloatArray | None = None
    slips: FloatArray | None = None

    def only(self, kept: npt.NDArray[np.bool_]) -> Readings:
        """Some of the samples."""
        swings, slips = (None if x is None else x[kept] for x in (self.swings, self.slips))
        at, times, values = self.stretch[kept], self.time_s[kept], self.values[kept]
        return Readings(self.channel, at, times, values, swings, slips)


def predict(
    readings: Readings,
    grid: Grid,
    x: FloatArray,
    faults: dict[str, float],
    calm: FloatArray | None = None,
) -> tuple[FloatArray, scipy.sparse.csr_matrix, dict[str, FloatArray]]:
    """Return what the channel should read, and the derivatives.

    Those against the faults are taken from the motion `calm`, where it is given.

    Returns
    -------
    expected : ndarray, shape (n,)
    by_motion : csr_matrix, shape (n, grid.size)
    by_fault : dict of ndarray, shape (n,)
        Of the faults in `faults` that move this channel.
    """
    places = _Places(readings, grid, faults)
    expected, told, by_fault = _read(readings, places, x, faults)
    blocks = told()
    if calm is not None:
        by_fault = _read(readings, places, calm, faults)[2]
    columns = np.concatenate([c for c, _ in blocks], axis=1)
    weights = np.concatenate([w for _, w in blocks], axis=1)
    n, k = columns.shape
    by_motion = scipy.sparse.csr_matrix(
        (weights.ravel(), columns.ravel(), np.arange(0, n * k + 1, k)), shape=(n, grid.size)
    )
    return expected, by_motion, by_fault


def expected_of(
    readings: Readings, grid: Grid, x: FloatArray, faults: dict[str, float]
) -> FloatArray:
    """As `predict`: what the channel should read alone."""
    return _read(readings, _Places(readings, grid, faults), x, faults)[0]


class _Places:
    """Which splines act on the readings of a channel whose time is put right, and how much."""

    def __init__(self, readings: Readings, grid: Grid, faults: dict[str, float]) -> None:
        name = readings.channel
        late_s = faults.get(f"delay.{name}", 0.0)
        if name in _SPEEDS:
            late_s += faults.get("delay.speeds", 0.0)
        self.share, self.lean_s = lean(name, faults)
        late_s += self.share * self.lean_s
        time_s = readings.time_s - late_s
        signals = _NEEDS[name]
        self.quick = grid.quick(readings.stretch, time_s)
        self.at = {s: grid.columns(s, self.quick) for s in signals if s in QUICK}
        for signal in signals:
            if signal in SLOW:
                self.slow = grid.slow(readings.stretch, time_s)
                self.slow_at = grid.columns(signal, self.slow)


_Blocks = Callable[[], list[tuple[IntArray, FloatArray]]]


def _read(
    readings: Readings, places: _Places, x: FloatArray, faults: dict[str, float]
) -> tuple[FloatArray, _Blocks, dict[str, FloatArray]]:
    """What the channel should read, how the motion moves it in blocks of columns, and faults."""
    name, quick = readings.channel, places.quick
    share, lean_s = places.share, places.lean_s
    if name in ("ax_mps2", "ay_mps2"):
        expected, blocks, by_fault, rate = _felt(name, readings, places, x, faults)
    else:
        columns = places.at[_NEEDS[name][0]]
        value, rate = _evaluate(x, columns, quick)[:2]
        gain, weights = 1.0 + faults.get(f"gain.{name}", 0.0), quick.weights[0]
        by_fault = {f"bias.{name}": np.ones_like(value)}
        if readings.slips is not None:
            for kind, slip in zip(SLIPS, readings.slips.T, strict=True):
                by_fault[kind] = gain * value * slip
            slipped = 1.0 + readings.slips @ np.array([faults.get(kind, 0.0) for kind in SLIPS])
            value, weights, rate = value * slipped, slipped[:, None] * weights, rate * slipped
        rate = gain * rate
        by_fault[f"gain.{name}"] = value
        expected = gain * value + faults.get(f"bias.{name}", 0.0)

        def blocks() -> list[tuple[IntArray, FloatArray]]:
            return [(columns, gain * weights)]

    by_fault[f"delay.{name}"] = -rate
    if share:
        by_fault[f"lean.{name}"] = -share * rate
        by_fault[f"gain.{name}"] -= (1.0 - share) ** 2 * lean_s * rate
    if name in _SPEEDS:
        by_fault["delay.speeds"] = -rate
    return expected, blocks, {key: d for key, d in by_fault.items() if key in faults}


def lean(channel: str, faults: dict[str, float]) -> tuple[float, float]:
    """Share of gravity by roll or pitch in what an axis feels, and how late that share is [s].

    Both are 0 where the axis feels too little: gravity only adds.
    """
    gain = faults.get(f"gain.{channel}", 0.0)
    if gain <= 0.0 or f"lean.{channel}" not in faults:
        return 0.0, 0.0
    return gain / (1.0 + gain), LEAN_S + faults[f"lean.{channel}"]


def _evaluate(
    x: FloatArray, columns: IntArray, basis: Basis
) -> tuple[FloatArray, FloatArray, FloatArray]:
    known = x[columns]
    value, slope, bend = (np.einsum("ij,ij->i", known, w) for w in basis.weights)
    return value, slope, bend


def _felt(
    name: str,
    readings: Readings,
    places: _Places,
    x: FloatArray,
    faults: dict[str, float],
) -> tuple[FloatArray, _Blocks, dict[str, FloatArray], FloatArray]:
    """What an accelerometer feels: at its place, turned, on a road that is not level."""
    quick, at = places.quick, places.at
    vx, dvx, ddvx = _evaluate(x, at["vx"], quick)
    vy, dvy, ddvy = _evaluate(x, at["vy"], quick)
    r, dr, ddr = _evaluate(x, at["yaw"], quick)
    lx, ly, turn = (faults.get(key, 0.0) for key in ("arm_x", "arm_y", "turn"))
    along = dvx - vy * r - lx * r**2 - ly * dr
    across = dvy + vx * r + lx * dr - ly * r**2
    d_along = ddvx - dvy * r - vy * dr - 2 * lx * r * dr - ly * ddr
    d_across = ddvy + dvx * r + vx * dr + lx * ddr - 2 * ly * r * dr
    is_x = name == "ax_mps2"
    gain = 1.0 + faults.get(f"gain.{name}", 0.0)
    # Shares of the two accelerations in what this axis feels.
    cx, cy = (gain, turn) if is_x else (-turn, gain)
    slow, slow_at = places.slow, places.slow_at
    level, d_level, _ = _evaluate(x, slow_at, slow)
    value, slope, _ = quick.weights

    def times(factor: FloatArray, weights: FloatArray) -> FloatArray:
        return factor[:, None] * weights

    def blocks() -> list[tuple[IntArray, FloatArray]]:
        return [
            (at["vx"], cx * slope + times(cy * r, value)),
            (at["vy"], times(-cx * r, value) + cy * slope),
            (
                at["yaw"],
                times(cx * (-vy - 2 * lx * r) + cy * (vx - 2 * ly * r), value)
                + (cy * lx - cx * ly) * slope,
            ),
            (slow_at, slow.weights[0]),
        ]

    by_fault = {
        f"gain.{name}": along if is_x else across,
        "turn": across if is_x else -along,
        "arm_x": -cx * r**2 + cy * dr,
        "arm_y": -cx * dr - cy * r**2,
    }
    expected = cx * along + cy * across + level
    if readings.swings is not None:
        for name, swing in zip(SWINGS, readings.swings.T, strict=True):
            expected = expected + faults.get(name, 0.0) * swing
            by_fault[name] = swing
    return expected, blocks, by_fault, cx * d_along + cy * d_across + d_level
