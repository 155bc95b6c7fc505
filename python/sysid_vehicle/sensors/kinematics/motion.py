"""The motion of a car as cubic splines, free of any assumption about its tyres."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy

from ..._common.arrays import FloatArray

IntArray = npt.NDArray[np.intp]

QUICK = ("vx", "vy", "yaw")
SLOW = ("grade", "bank")
SLOW_S = 1.0  # knots of what gravity adds on a road that is not level
_SMOOTH = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0  # of neighbouring knots
# What they may reach: gravity along and across, and the lateral speed where none is measured.
_LEVEL = {"grade": 2.0, "bank": 2.0, "vy": 3.0}


@dataclass(frozen=True)
class Stretch:
    """A piece of driving: log number, and time of its first and last sample [s]."""

    log: int
    first_s: float
    last_s: float


@dataclass(frozen=True, eq=False)
class Basis:
    """Values of four B-splines, or of two hat functions, at some times.

    Attributes
    ----------
    first : ndarray of int, shape (n,)
        Index of the first knot that acts.
    weights : ndarray, shape (3, n, k)
        Of the value, the first and the second derivative.
    """

    first: IntArray
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class Grid:
    """Knots of the splines over all stretches, and the order of the unknowns.

    The unknowns are sorted by time, so that their information matrix is banded.

    Attributes
    ----------
    stretches : sequence of Stretch
        Pieces of driving.
    step_s : float
        Distance of the knots of speeds and yaw rate.
    beyond_s : float
        How far they reach beyond the ends: readings come late.
    """

    stretches: Sequence[Stretch]
    step_s: float
    beyond_s: float = 0.3

    @cached_property
    def _counts(self) -> tuple[IntArray, IntArray]:
        quick, slow = [], []
        for s in self.stretches:
            span = s.last_s - s.first_s + 2.0 * self.beyond_s
            quick.append(int(np.ceil(span / self.step_s)) + 4)
            slow.append(int(np.ceil(span / SLOW_S)) + 2)
        return np.array(quick, dtype=np.intp), np.array(slow, dtype=np.intp)

    @cached_property
    def index(self) -> dict[str, IntArray]:
        """Place of each knot's coefficient among the unknowns, by signal."""
        quick, slow = self._counts
        times, names = [], []
        base = 0.0
        for s, n, m in zip(self.stretches, quick, slow, strict=True):
            for name in QUICK:
                times.append(base + self.step_s * (np.arange(n) - 1.0))
                names.append(np.full(n, QUICK.index(name)))
            for name in SLOW:
                times.append(base + SLOW_S * np.arange(m))
                names.append(np.full(m, 3 + SLOW.index(name)))
            base += s.last_s - s.first_s + 100.0
        when, what = np.concatenate(times), np.concatenate(names)
        rank = np.empty(when.size, dtype=np.intp)
        rank[np.argsort(when, kind="stable")] = np.arange(when.size)
        # Within a signal the knots stand in the order of the stretches.
        return {name: rank[what == i] for i, name in enumerate((*QUICK, *SLOW))}

    @cached_property
    def size(self) -> int:
        """Number of unknowns."""
        return sum(values.size for values in self.index.values())

    def quick(self, stretch: IntArray, time_s: FloatArray) -> Basis:
        """Cubic B-splines of speeds and yaw rate at times of given stretches."""
        first, f = self._place(stretch, time_s, self.step_s, self._counts[0], 4)
        g, h = 1.0 - f, self.step_s
        value = np.stack([g**3, 3 * f**3 - 6 * f**2 + 4, 3 * g**3 - 6 * g**2 + 4, f**3], 1) / 6.0
        slope = np.stack([-(g**2), 3 * f**2 - 4 * f, 4 * g - 3 * g**2, f**2], 1) / (2.0 * h)
        bend = np.stack([g, 3 * f - 2, 3 * g - 2, f], 1) / h**2
        return Basis(first, np.stack([value, slope, bend]))

    def slow(self, stretch: IntArray, time_s: FloatArray) -> Basis:
        """Straight lines between the knots of grade and bank."""
        first, f = self._place(stretch, time_s, SLOW_S, self._counts[1], 2)
        value = np.stack([1.0 - f, f], 1)
        slope = np.stack([-np.ones_like(f), np.ones_like(f)], 1) / SLOW_S
        return Basis(first, np.stack([value, slope, np.zeros_like(value)]))

    def _place(
        self, stretch: IntArray, time_s: FloatArray, step_s: float, counts: IntArray, wide: int
    ) -> tuple[IntArray, FloatArray]:
        starts = np.array([s.first_s for s in self.stretches]) - self.beyond_s
        u = (time_s - starts[stretch]) / step_s
        k = np.clip(np.floor(u).astype(np.intp), 0, counts[stretch] - wide)
        return (np.cumsum(counts) - counts)[stretch] + k, u - k

    def columns(self, signal: str, basis: Basis) -> IntArray:
        """Places of the unknowns that act, shape (n, k)."""
        at: IntArray = self.index[signal][basis.first[:, None] + np.arange(basis.weights.shape[2])]
        return at

    def smoothed(self, x: FloatArray) -> FloatArray:
        """Coefficients of the motion without what lies near the Nyquist frequency of the knots."""
        calm = x.copy()
        for signal in QUICK:
            for at in np.split(self.index[signal], np.cumsum(self._counts[0])[:-1]):
                padded = np.pad(x[at], _SMOOTH.size // 2, mode="edge")
                calm[at] = np.convolve(padded, _SMOOTH, mode="valid")
        return calm

    def changes(self, x: FloatArray, signal: str, order: int) -> FloatArray:
        """Changes of a speed or of the yaw rate within a second, or changes of these, and so on."""
        second = max(1, round(1.0 / self.step_s))
        found = []
        for at in np.split(self.index[signal], np.cumsum(self._counts[0])[:-1]):
            changed = x[at]
            for _ in range(order):
                changed = changed[second:] - changed[:-second]
            found.append(changed)
        together: FloatArray = np.concatenate(found)
        return together

    def levels(self, told: Collection[int]) -> scipy.sparse.csr_matrix:
        """Rows, divided by their standard deviation; of v_y only in stretches that are not `told`.

        There are so many that they would forbid a turned speed sensor the lateral speed it reads.
        """
        places = np.split(self.index["vy"], np.cumsum(self._counts[0])[:-1])
        untold = [at for k, at in enumerate(places) if k not in told]
        at = {**self.index, "vy": np.concatenate([np.empty(0, dtype=np.intp), *untold])}
        rows = [
            self._rows([at[signal]], np.array([1.0 / level])) for signal, level in _LEVEL.items()
        ]
        return scipy.sparse.vstack(rows, format="csr")

    def bends(self, signal: str) -> scipy.sparse.csr_matrix:
        """Rows of the second derivative of a speed or of the yaw rate from knot to knot."""
        places = np.split(self.index[signal], np.cumsum(self._counts[0])[:-1])
        rows = [
            self._rows([at[:-2], at[1:-1], at[2:]], np.array([1.0, -2.0, 1.0]) / self.step_s**2)
            for at in places
        ]
        return scipy.sparse.vstack(rows, format="csr")

    def steps(self, signal: str) -> scipy.sparse.csr_matrix:
        """Rows of the change of `signal` from knot to knot."""
        places = np.split(self.index[signal], np.cumsum(self._counts[1])[:-1])
        ahead = np.concatenate([at[1:] for at in places])
        behind = np.concatenate([at[:-1] for at in places])
        return self._rows([behind, ahead], np.array([-1.0, 1.0]))

    def _rows(self, picks: list[IntArray], weights: FloatArray) -> scipy.sparse.csr_matrix:
        n, k = picks[0].size, len(picks)
        values = np.broadcast_to(weights, (n, k)).ravel()
        pointers = np.arange(0, n * k + 1, k)
        return scipy.sparse.csr_matrix(
            (values, np.stack(picks, 1).ravel(), pointers), shape=(n, self.size)
        )
