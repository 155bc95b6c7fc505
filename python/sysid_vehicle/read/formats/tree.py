"""Arrays in nested structs or groups, with a time beside them or one for all."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from ...errors import InvalidInput, near_names
from ...log import listed
from ..recording import Entry, Recording, Signal, ends_with
from ..table import Table
from ..units import factor_to

T = TypeVar("T")

_TIMES = ("time_s", "time", "t", "times", "timestamp", "timestamps", "seconds", "tout")
_TIME_OF = re.compile(r"(?:t|time)_(.+)|(.+)_(?:t|time)", re.I)  # of one channel
VALUES = ("data", "values", "value", "signal")
_MOST_COLUMNS = 64  # of a matrix that are channels


@dataclass(frozen=True)
class Leaf:
    """An array with its place in the file; `time_s` where the file says which belongs to it."""

    path: tuple[str, ...]
    values: npt.NDArray[np.generic]
    unit: str = ""
    time_s: npt.NDArray[np.float64] | None = None


def contents_of(leaves: list[Leaf], where: str) -> Table | Recording:
    """Return a table where all arrays have one length and time, else channels with their own.

    A channel's time is the array called ``t_NAME``, ``time_NAME``, ``NAME_t`` or ``NAME_time``
    beside it, or the one called ``time``, ``t``, ... of its length beside it, or else in a
    struct around it, in seconds or in the unit that it states. A struct of a time and ``data`` is
    one channel, called like the struct.

    Raises
    ------
    InvalidInput
        If there are no arrays.
    """
    columns = [column for leaf in leaves for column in _columns(leaf)]
    columns = [leaf for leaf in columns if leaf.values.size > 1]
    if not columns:
        raise InvalidInput(f"{where}: holds no arrays of numbers; save the channels as arrays")
    times = {c.path: c for c in columns if c.path[-1].lower() in _TIMES and c.time_s is None}
    times |= {c.path: c for c in columns if c.time_s is None and _timed(c, columns) is not None}
    own_times = any(leaf.time_s is not None for leaf in columns) or len(times) > 1
    if not own_times and len({leaf.values.size for leaf in columns}) == 1:
        return _table(columns)
    return _recording([leaf for leaf in columns if leaf.path not in times], times)


def _table(columns: list[Leaf]) -> Table:
    """Arrays of one length, with one time for all."""
    named = _short({leaf.path: leaf for leaf in columns})
    arrays = {name: np.asarray(leaf.values, dtype=np.float64) for name, leaf in named.items()}
    units = {name: leaf.unit for name, leaf in named.items() if leaf.unit}
    return Table(tuple(arrays), arrays, {}, columns[0].values.size, units)


def _recording(columns: list[Leaf], times: Mapping[tuple[str, ...], Leaf]) -> Recording:
    """Channels with times of their own."""
    found: dict[tuple[str, ...], tuple[Leaf, npt.NDArray[np.float64] | None]] = {}
    for leaf in columns:
        path = leaf.path
        if path[-1].lower() in VALUES and len(path) > 1 and path[:-1] not in found:
            path = path[:-1]
        found[path] = leaf, leaf.time_s if leaf.time_s is not None else _time_of(leaf, times)
    named = _short(found)
    entries = {
        name: Entry(leaf.unit, str(id(time_s)) if time_s is not None else name)
        for name, (leaf, time_s) in named.items()
    }
    arrays = {**_short({c.path: c for c in (*times.values(), *columns)})}

    def clocked(name: str, rate_hz: float | None) -> Recording:
        clock = _found(arrays, name)
        n = clock.values.size
        time_s = _kept(clock) if rate_hz is None else np.arange(n) / rate_hz
        own = columns if rate_hz is not None else [c for c in columns if c is not clock]
        return _recording(
            [replace(c, time_s=time_s) if c.values.size == n else c for c in own], times
        )

    def fetch(names: list[str], notes: list[str]) -> dict[str, Signal]:
        result = {}
        for name in names:
            leaf, time_s = named[name]
            if time_s is None or time_s.size != leaf.values.size:
                raise InvalidInput(
                    f"{name}: has {leaf.values.size} samples and no time of that length beside it; "
                    f"save its time in the same struct, called 'time', or name the time in the "
                    f"channel map, time_s = 'its name'"
                )
            result[name] = Signal(time_s, np.asarray(leaf.values, dtype=np.float64))
        return result

    return Recording(entries, fetch, clocked)


def _found(arrays: Mapping[str, Leaf], name: str) -> Leaf:
    """The array that a channel map calls so, in full or by its last part."""
    found = [full for full in arrays if full == name] or [f for f in arrays if ends_with(f, name)]
    if len(found) != 1:
        hint = near_names(name, arrays) or f"; arrays are {listed(arrays)}"
        raise InvalidInput(
            f"time_s: the channel map names '{name}', which {len(found)} arrays of the file are "
            f"called{hint}"
        )
    return arrays[found[0]]


def _columns(leaf: Leaf) -> list[Leaf]:
    """One leaf for each column of a matrix, named as MATLAB would."""
    values = np.atleast_1d(leaf.values)
    if values.ndim == 1:
        return [Leaf(leaf.path, values, leaf.unit, leaf.time_s)]
    if values.ndim != 2:
        return []
    long = leaf.time_s.size if leaf.time_s is not None else max(values.shape)
    if values.shape[0] != long:
        values = values.T
    if values.shape[1] > _MOST_COLUMNS:
        return []
    return [
        Leaf((*leaf.path[:-1], f"{leaf.path[-1]}(:,{k})"), column, leaf.unit, leaf.time_s)
        for k, column in enumerate(values.T, 1)
    ]


def _timed(time: Leaf, columns: list[Leaf]) -> Leaf | None:
    """The channel beside an array of which that is the time by its name."""
    found = _TIME_OF.fullmatch(time.path[-1])
    if found is None or not (np.diff(time.values.astype(np.float64)) >= 0.0).all():
        return None
    own = (*time.path[:-1], found[1] or found[2])
    there = (c for c in columns if c.path == own and c.values.size == time.values.size)
    return next(there, None)


def _time_of(leaf: Leaf, times: Mapping[tuple[str, ...], Leaf]) -> npt.NDArray[np.float64] | None:
    for time in times.values():
        if _timed(time, [leaf]) is not None:
            return _kept(time)
    for depth in range(len(leaf.path) - 1, -1, -1):
        scope = leaf.path[:depth]
        for path, time in times.items():
            if path[:-1] == scope and time.values.size == leaf.values.size:
                return _kept(time)
    return None


def _kept(time: Leaf) -> npt.NDArray[np.float64]:
    """The time in seconds, the same array for all its channels, which makes them a group."""
    if time.time_s is None:
        seconds = time.values.astype(np.float64) * (factor_to("s", time.unit) or 1.0)
        object.__setattr__(time, "time_s", seconds)
    assert time.time_s is not None
    return time.time_s


def _short(found: dict[tuple[str, ...], T]) -> dict[str, T]:
    """Join the paths by points, without a struct that is around everything."""
    paths = list(found)
    while len(paths) > 1 and all(len(p) > 1 for p in paths) and len({p[0] for p in paths}) == 1:
        found = {path[1:]: value for path, value in found.items()}
        paths = list(found)
    return {".".join(path): value for path, value in found.items()}
