"""Parameters under noise that stays as it is; what is scanned is tried at many values.

When something changes, and how quickly it answers, has likelihoods with several tops: between two
bends no time is likelier than another, and no slope leads a search across.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ...effects import Effect
from ...estimate import Driving
from ...model import Model
from .box import free_box
from .objective import Objective
from .settle import moved

_ENOUGH = 0.05  # nats: a round that gains less is the last one
_VALUES, _CLOSER = 48, 8  # tried at first, and between the neighbours of the best
# From so near a search finds the time of a change, which takes about a second, and a frequency.
_NEAR_S, _NEAR_RATIO = 0.5, 1.1
_BEYOND = 2.0  # times the largest typical value, and the smallest by it


@dataclass(frozen=True)
class Scan:
    """A parameter that is tried at many values.

    Attributes
    ----------
    column : int
        Its place among all parameters.
    low, high : float
        Between which.
    ratio : bool
        Whether values stand in equal ratios, or at equal distances.
    """

    column: int
    low: float
    high: float
    ratio: bool

    def values(self, low: float, high: float, count: int) -> FloatArray:
        """So many values between two others."""
        spaced = np.geomspace if self.ratio else np.linspace
        return as_float64(spaced(low, high, count + 2)[1:-1])

    def is_near(self, low: float, high: float) -> bool:
        """Whether a search finds the best of what lies between."""
        return high < _NEAR_RATIO**2 * low if self.ratio else high - low < 2.0 * _NEAR_S


def scans(model: Model, effects: Sequence[Effect], driving: Driving) -> tuple[Scan, ...]:
    """Of the free parameters of these effects those that are scanned."""
    found = []
    for e in effects:
        p = e.scanned
        if p is not None and f"{e.id}.{p.name}" in model.free_names:
            low, high = model.bounds(f"{e.id}.{p.name}")
            if p.scan == "time":
                low, high = max(low, 0.0), min(high, longest_s(driving))
            else:
                low, high = max(low, p.typical_low / _BEYOND), min(high, p.typical_high * _BEYOND)
            if low < high:
                found.append(Scan(p.column, low, high, p.scan != "time"))
    return tuple(found)


def longest_s(driving: Driving) -> float:
    """Duration of the longest log [s]."""
    return max(float(s.where.stop / driving.logs[s.log].rate_hz) for s in driving.stretches)


def go_on(
    objective: Objective,
    model: Model,
    noise: FloatArray,
    rounds: int,
    tried: Sequence[Scan] = (),
) -> tuple[FloatArray, Any]:
    """Where a search from the model's values ends, and the gains of the filter there.

    It begins anew at likelier values of what is scanned for as long as that gains anything.
    """
    box = free_box(model)
    p, gains, value = box.inside(model.vector()), None, -np.inf
    for _ in range(1 + rounds):
        there = p
        for scan in tried:
            there = _likeliest(objective, scan, there, noise)
        if gains is not None and there is p:
            break
        p = there
        for _ in range(rounds):
            last, best = p, value
            p, gains = moved(objective, p, noise, box, rounds=8, tolerance=0.2)
            value = objective.reached(p, gains)
            if value < best + _ENOUGH or box.near(p, last, 1e-4):
                break
    return p, gains


def _likeliest(objective: Objective, scan: Scan, p: FloatArray, noise: FloatArray) -> FloatArray:
    """The parameters with the likeliest value of the one that is scanned."""
    tried = scan.values(scan.low, scan.high, _VALUES)
    while True:
        sets = np.repeat(p[None, :], 1 + len(tried), axis=0)
        sets[1:, scan.column] = tried
        told = objective.log_likelihoods(sets, noise)
        best = int(np.argmax(told))
        if told[best] > told[0] + _ENOUGH:
            p = sets[best]
        k = int(np.argmin(np.abs(tried - p[scan.column])))
        low = tried[k - 1] if k > 0 else scan.low
        high = tried[k + 1] if k + 1 < len(tried) else scan.high
        if scan.is_near(low, high):
            return p
        tried = scan.values(low, high, _CLOSER)
