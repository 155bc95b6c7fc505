"""Steps of damped BFGS, which the slopes that are met on the way teach the curvature.

After Nocedal & Wright, Numerical Optimization, 2006, 6.1 and 18.3.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from .search import SLIGHT, least_within
from .ways import Place, Ways

DAMPINGS = (0.0, 1e-3, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0)
"""Of steps, in units of the curvature of each parameter."""
_KEPT = 10  # slopes that correct the curvature
_BENT = 0.2  # of the curvature that was expected: what is less is damped (Nocedal & Wright, 18.3)


@dataclass
class Met:
    """Slopes that were met on the way, and how they changed: the curvature itself."""

    last: tuple[FloatArray, FloatArray] | None = None
    changes: list[tuple[FloatArray, FloatArray]] = field(default_factory=list)

    def meet(self, at: FloatArray, slope: FloatArray) -> None:
        """One slope more."""
        if self.last is not None:
            self.changes = [*self.changes[1 - _KEPT :], (at - self.last[0], self.last[1] - slope)]
        self.last = at, slope

    def corrected(self, curvature: FloatArray, scale: FloatArray) -> FloatArray:
        """The curvature in units of `scale`, such that the slopes change as they did."""
        found = curvature / np.outer(scale, scale)
        for way, change in self.changes:
            step, seen = way * scale, change / scale
            expected = found @ step
            most, seen_most = step @ expected, step @ seen
            if not most > 0.0:
                continue
            if seen_most < _BENT * most:
                share = (1.0 - _BENT) * most / (most - seen_most)
                seen = share * seen + (1.0 - share) * expected
            found = (
                found - np.outer(expected, expected) / most + np.outer(seen, seen) / (step @ seen)
            )
        return as_float64(found)


class Trials:
    """Steps from one place that are damped more or less."""

    def __init__(
        self,
        ways: Ways,
        here: Place,
        slope: FloatArray,
        curvature: FloatArray,
        scale: FloatArray,
    ) -> None:
        self._ways, self._here, self._scale = ways, here, scale
        self._slope, self._curvature = slope / scale, curvature
        self._values, self._vectors = np.linalg.eigh(curvature)
        self._room = [r * scale for r in ways.room(here)]
        self._known: dict[int, Place] = {}

    @property
    def promised(self) -> float:
        """What a step that is hardly damped promises to gain [nats]."""
        step = self._step(SLIGHT)
        return float(self._slope @ step - 0.5 * step @ self._curvature @ step)

    def best(self, damping: int) -> tuple[int, Place]:
        """The damping that gains most, beginning with one that did, and where it leads."""
        most = len(DAMPINGS) - 1
        while damping < most and not self._at(damping).value > self._here.value:
            damping += 1
        for way in (-1, 1):
            while (
                0 <= damping + way <= most
                and self._at(damping + way).value > self._at(damping).value
            ):
                damping += way
        there = self._at(damping)
        return damping, there if there.value > self._here.value else self._here

    def _at(self, damping: int) -> Place:
        if damping not in self._known:
            step = self._step(SLIGHT + DAMPINGS[damping]) / self._scale
            self._known[damping] = self._ways.moved(self._here, step)
        return self._known[damping]

    def _step(self, damping: float) -> FloatArray:
        values = np.maximum(self._values, 0.0) + damping
        return least_within(values, self._vectors, self._slope, *self._room)
