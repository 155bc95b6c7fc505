"""Parameters under noise that stays as it is; the time of a change is tried at many values.

When something changes has a likelihood with several tops: between two bends no time is likelier
than another, and no slope leads a search across. How quickly a car answers has one: searches from
either end of the usual time constants and frequencies meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..._common.arrays import FloatArray
from ...effects import Effect
from ...estimate import Driving
from ...model import Model
from .box import free_box
from .objective import Objective
from .settle import moved

_ENOUGH = 0.05  # nats: a round that gains less is the last one
_VALUES, _CLOSER = 48, 8  # tried at first, and between the neighbours of the best
_NEAR_S = 0.5  # from so near a search finds the time of a change, which takes about a second


class Scan(NamedTuple):
    """A time that is tried at many values: its place among all parameters, and between which."""

    column: int
    low_s: float
    high_s: float


def scans(model: Model, effects: Sequence[Effect], driving: Driving) -> tuple[Scan, ...]:
    """Of the free parameters of these effects those that are times within a log."""
    found = []
    for e in effects:
        p = e.scanned
        if p is not None and p.scan == "time" and f"{e.id}.{p.name}" in model.free_names:
            low, high = model.bounds(f"{e.id}.{p.name}")
            scan = Scan(p.column, max(low, 0.0), min(high, longest_s(driving)))
            if scan.low_s < scan.high_s:
                found.append(scan)
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

    It begins anew at likelier times for as long as that gains anything.
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
    """The parameters with the likeliest time."""
    low, high, count = scan.low_s, scan.high_s, _VALUES
    while True:
        tried = np.linspace(low, high, count + 2)[1:-1]
        sets = np.repeat(p[None, :], 1 + count, axis=0)
        sets[1:, scan.column] = tried
        told = objective.log_likelihoods(sets, noise)
        best = int(np.argmax(told))
        if told[best] > told[0] + _ENOUGH:
            p = sets[best]
        k = int(np.argmin(np.abs(tried - p[scan.column])))
        low = tried[k - 1] if k > 0 else low
        high = tried[k + 1] if k + 1 < count else high
        if high - low < 2.0 * _NEAR_S:
            return p
        count = _CLOSER
