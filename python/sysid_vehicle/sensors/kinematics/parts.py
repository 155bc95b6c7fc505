"""Whether parts of the driving ask for the same faults.

A fault of a sensor is there all the time. What only imitates one, a road that is banked in its
corners, a body that leans late, or another fault that explains the same, changes from part to part
by more than noise tells. Estimates of the parts are taken as draws about the fault with a scatter
of their own (DerSimonian & Laird, Controlled Clinical Trials 7 (1986), 177-188).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ..._common.text import HALF_95
from .motion import Stretch

_PART_S = 60.0  # a shorter one may find another explanation by chance
_MOST = 4
_SHORTEST_S = 5.0
_APART = 3.0  # standard deviations between the whole and the mean of its parts


@dataclass(frozen=True)
class Scatter:
    """What the parts say of a fault.

    Attributes
    ----------
    mean, std : float
        Over the parts, with their scatter.
    more : float
        Standard deviation that the scatter adds to the estimate of the whole.
    """

    mean: float
    std: float
    more: float

    def widened(self, value: float, std: float) -> float:
        """Standard deviation of the whole's estimate that allows for its parts."""
        wide = float(np.hypot(std, self.more))
        off = abs(value - self.mean)
        # The whole has found another explanation than its parts: which is right, nothing tells.
        return max(wide, off) if off > _APART * np.hypot(wide, self.std) else wide


def cut(stretches: Sequence[Stretch]) -> list[list[Stretch]]:
    """Parts of about the same length; none where the driving is too short for two."""
    lengths = [s.last_s - s.first_s for s in stretches]
    count = min(int(sum(lengths) / _PART_S), _MOST)
    if count < 2:
        return []
    parts: list[list[Stretch]] = [[] for _ in range(count)]
    each, before = sum(lengths) / count, 0.0
    for s, length in zip(stretches, lengths, strict=True):
        edges = [k * each - before for k in range(1, count) if 0.0 < k * each - before < length]
        for a, b in zip([0.0, *edges], [*edges, length], strict=True):
            if b - a >= _SHORTEST_S:
                part = min(int((before + 0.5 * (a + b)) / each), count - 1)
                parts[part].append(Stretch(s.log, s.first_s + a, s.first_s + b))
        before += length
    return [part for part in parts if part]


def scatter(values: Sequence[float], stds: Sequence[float]) -> Scatter | None:
    """Mean and scatter of the parts' estimates; None where there are fewer than two."""
    if len(values) < 2:
        return None
    v, variance = np.array(values), np.square(stds)
    w = 1.0 / variance
    q = float(w @ (v - (w @ v) / w.sum()) ** 2)
    n = len(v)
    between = max(0.0, (q - (n - 1)) / float(w.sum() - (w @ w) / w.sum()))
    w = 1.0 / (variance + between)
    # Few parts tell their scatter badly.
    student = float(scipy.stats.t.isf(0.025, n - 1)) / HALF_95
    return Scatter(
        float(w @ v / w.sum()), float(w.sum() ** -0.5), student * float(np.sqrt(between / n))
    )
