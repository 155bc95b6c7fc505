"""Samples of logs by their place among all usable ones: what lies between two, and some of all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from .. import _core
from ..effects import effect
from ..log import Log

_REACH_S = effect("steer_delay").parameters[0].upper  # either way
_WINDOW_S, _SHORTEST = 2.0, 50  # of windows of thinned driving; samples, at least


class Samples(NamedTuple):
    """Samples `where` of a log, the first of which is number `at` among all usable ones."""

    log: Log
    where: slice
    at: int


def steering_reach(rate_hz: float) -> int:
    """Samples before and after others whose steering a delay may ask for."""
    return round(_REACH_S * rate_hz) + _core.SHIFT_REACH


def between(whole: Sequence[Samples], begin: int, end: int) -> list[Samples]:
    """What of the whole lies between two of all usable samples."""
    found: list[Samples] = []
    for log, where, at in whole:
        first, last = max(begin - at, 0), min(end - at, where.stop - where.start)
        if first < last:
            some = slice(where.start + first, where.start + last)
            found.append(Samples(log, some, at + first))
    return found


def thinned(whole: Sequence[Samples], most: int | None) -> list[Samples]:
    """At most about so many samples of the whole, or all.

    Short windows, evenly spread, keep every kind of driving in, and fill the lanes of the kernels,
    which each walk one.
    """
    every = sum(where.stop - where.start for _, where, _ in whole)
    if most is None or every <= most:
        return list(whole)
    found: list[Samples] = []
    share = most / every
    for log, where, at in whole:
        length = max(int(_WINDOW_S * log.rate_hz), _SHORTEST)
        for start in range(where.start, where.stop, max(int(length / share), 1)):
            stop = min(start + length, where.stop)
            if stop - start > length // 2 or not found:
                found.append(Samples(log, slice(start, stop), at + start - where.start))
    return found
