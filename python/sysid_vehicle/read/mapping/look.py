"""What a log shows before it is mapped: names, stated units, values on a common clock."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ...log import CHANNELS, standing
from ..recording import Recording
from ..table import Table
from ..units import factor_to, unit_at_end, unit_in_name
from .names import by_axes, rank, si_unit

_RATE_HZ = 50.0  # at which units and signs are looked for
_FEWEST = 100
_GAP_S, _GAP_PERIODS = 1.0, 5.0  # longer than both is a gap

Signal = tuple[FloatArray, FloatArray]
"""Times and values."""


class View:
    """A table or a recording, alike: names, units, values with times."""

    def __init__(self, held: Table | Recording) -> None:
        self._held = held
        self._read: dict[str, Signal] = {}
        self.has_times = isinstance(held, Recording)
        self.names = list(held.entries) if isinstance(held, Recording) else list(held.columns)
        if isinstance(held, Table):
            self.names += [n for n in held.seconds if n not in self.names]
        self.by_axes = by_axes(self.names)

    def unit(self, name: str, si_unit: str) -> str:
        """Return the unit that the file states, or the one in brackets behind the name."""
        if isinstance(self._held, Recording):
            return self._held.entries[name].unit or unit_in_name(name, si_unit)
        return self._held.unit(name, si_unit)

    def said(self, name: str, si_unit: str) -> str:
        """The unit that the file states, or else the one at the end of the name."""
        return self.unit(name, si_unit) or unit_at_end(name, si_unit)[1]

    @property
    def rising(self) -> list[str]:
        """Columns of a table that rise from each row to the next."""
        held = self._held
        columns = {**held.seconds, **held.columns} if isinstance(held, Table) else {}
        return [n for n, x in columns.items() if x.size >= _FEWEST and (np.diff(x) > 0.0).all()]

    @property
    def stamps(self) -> list[str]:
        """Columns of a table that hold dates and times of day."""
        return list(self._held.seconds) if isinstance(self._held, Table) else []

    def is_stamps(self, name: str) -> bool:
        """Whether a column of a table holds dates and times of day."""
        return name in self.stamps

    def moves(self, names: list[str]) -> list[str]:
        """The names of those that have two values or more."""
        held = self._held
        if isinstance(held, Recording):
            values = {name: x for name, (_, x) in self.values(names, None).items()}
        else:
            values = {name: held.columns[name] for name in names if name in held.columns}
        return [n for n, x in values.items() if np.unique(x[np.isfinite(x)]).size > 1]

    def values(self, names: list[str], time: str | None) -> dict[str, Signal]:
        """Return times and values by name; a table's column ``time`` tells its times."""
        if isinstance(self._held, Recording):
            # Messages are decoded one by one, which takes most of the time.
            signals = self._held.signals([n for n in names if n not in self._read], [])
            self._read.update({name: (s.time_s, s.values) for name, s in signals.items()})
            return {name: self._read[name] for name in names}
        if time is None:
            return {}
        clock = self._held.seconds.get(time, self._held.columns.get(time))
        assert clock is not None
        return {name: (clock, self._held.columns[name]) for name in names}


def ranked(view: View, channel: str) -> list[str]:
    """Columns that may be a channel by name and unit, likeliest first."""
    scored = [
        (rank(view.by_axes.get(n, n), view.unit(n, si_unit(channel, n)), channel), n)
        for n in view.names
    ]
    kept = [(score, name) for score, name in scored if score > 0.0]
    return [name for _, name in sorted(kept, key=lambda pair: -pair[0])]


def stated(view: View, columns: Mapping[str, str]) -> dict[str, float]:
    """Factors of what has a unit that is stated, or the name of the channel itself."""
    found: dict[str, float] = {}
    for channel, name in columns.items():
        unit = si_unit(channel, name)
        factor = factor_to(unit, view.said(name, unit))
        if factor is not None:
            found[channel] = factor
        elif name == channel and channel in CHANNELS:
            found[channel] = 1.0
    return found


def by_name(channel: str, name: str, unit: str) -> str:
    """Why a column is taken for a channel."""
    if channel == "time_s" and not rank(name, unit, channel):
        return "the only column that always rises"
    text = "by its name" if name != channel else "so called"
    return f"{text}, the file states '{unit}'" if unit else text


def ended(channel: str, name: str, unit: str) -> str:
    """What a unit at the end of a name is told as, if that is all there is."""
    found = "" if unit or name == channel else unit_at_end(name, si_unit(channel, name))[1]
    return f"in '{found}', as its name ends" if found else ""


def even(
    held: Mapping[str, Signal], factor: float
) -> tuple[FloatArray, dict[str, FloatArray]] | None:
    """The channels on common even times, to look at: interpolated, for nothing else.

    Times of gaps are left out, however long: what lies between is no driving. Rows that repeat or
    go back in time are left out too: reading the log will refuse them, with the remedy.
    """
    known = {}
    for channel, (clock, values) in held.items():
        there = np.isfinite(clock) & np.isfinite(values)
        there[standing(values, fewest=1)] = False  # a dropout, whatever its unit
        before = np.maximum.accumulate(np.where(there, clock, -np.inf))
        there[1:] &= clock[1:] > before[:-1]
        if np.count_nonzero(there) >= _FEWEST:
            known[channel] = factor * clock[there], values[there]
    if not known:
        return None
    begin = max(float(t[0]) for t, _ in known.values())
    end = min(float(t[-1]) for t, _ in known.values())
    if (end - begin) * _RATE_HZ < _FEWEST:
        return None
    time_s = _driven(begin, end, [clock for clock, _ in known.values()])
    if time_s.size < _FEWEST:
        return None
    return time_s, {c: np.interp(time_s, t, values) for c, (t, values) in known.items()}


def with_gaps(
    time_s: FloatArray, channels: Mapping[str, FloatArray], rate_hz: float
) -> dict[str, FloatArray]:
    """The channels that `even` gave with all times, a second of each gap, where they are NaN."""
    steps = np.minimum(np.diff(time_s), _GAP_S)
    row = np.rint(np.cumsum([0.0, *steps]) * rate_hz).astype(int)
    whole = {"time_s": as_float64(time_s[0] + np.arange(row[-1] + 1) / rate_hz)}
    for name, values in channels.items():
        whole[name] = np.full(row[-1] + 1, np.nan)
        whole[name][row] = values
    return whole


def _driven(begin: float, end: float, clocks: Iterable[FloatArray]) -> FloatArray:
    """Even times from `begin` to `end`, without those between two ends of a gap."""
    parts, at = [], begin
    for last, first in sorted({gap for clock in clocks for gap in _gaps(clock)}):
        if last >= at:
            parts.append((at, min(last, end)))
        at = max(at, first)
    parts.append((at, end))
    grids = [(np.ceil((a - begin) * _RATE_HZ), (b - begin) * _RATE_HZ) for a, b in parts if a < b]
    whole = [np.arange(first, last) for first, last in grids]
    return as_float64(begin + np.concatenate([np.zeros(0), *whole]) / _RATE_HZ)


def _gaps(clock: FloatArray) -> list[tuple[float, float]]:
    step = np.diff(clock)
    wide = np.flatnonzero(step > max(_GAP_S, _GAP_PERIODS * float(np.median(step))))
    return [(float(clock[i]), float(clock[i + 1])) for i in wide]
