"""Channels that each have times of their own, and how they come into one table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray
from ..errors import InvalidInput, near_names
from ..log import CHANNELS, counted_on, listed
from .table import Table

_SAME_TIME = 0.01  # of the shortest period: nearer samples of two channels are one row
_LATE_S = 1.0  # messages overtake each other by less; a clock that was set back, by more
_LISTED_EXTRAS = 1000  # other channels of the groups that are read
_TOLD = 6  # names of what is left out


@dataclass(frozen=True)
class Signal:
    """Values with their own times [s], both of shape (n,)."""

    time_s: FloatArray
    values: FloatArray


@dataclass(frozen=True)
class Entry:
    """What a file says of a channel before it is read.

    Attributes
    ----------
    unit : str
        As the file states it; empty if it states none.
    group : str
        What was sampled together has the same.
    text : str
        What else the file tells of it.
    """

    unit: str = ""
    group: str = ""
    text: str = ""


@dataclass(frozen=True)
class LeftOut:
    """What a file holds and nothing here reads: told once, and where a channel map names it.

    Attributes
    ----------
    what : str
        Singular, such as ``topic``.
    names : mapping of str
        By name in the file, of what kind it is; empty where that says nothing.
    why : str
        Why it is left out, behind "is left out" or "are left out".
    remedy : str
    """

    what: str
    names: Mapping[str, str]
    why: str
    remedy: str

    def __str__(self) -> str:
        told = [f"{name} ({kind})" if kind else name for name, kind in self.names.items()]
        more = ", ..." if len(told) > _TOLD else ""
        count = f"1 {self.what} is" if len(told) == 1 else f"{len(told)} {self.what}s are"
        return f"{count} left out, {self.why}: {', '.join(told[:_TOLD])}{more}; {self.remedy}"

    def holds(self, name: str) -> bool:
        """Tell whether what a channel map calls `name` is, or is part of, what is left out."""
        return any(
            ends_with(full, name) or name.startswith((f"{full}/", f"{full}."))
            for full in self.names
        )


@dataclass(frozen=True)
class Recording:
    """Channels of a file or an object, each with its own times; read when they are asked for.

    Attributes
    ----------
    entries : mapping of Entry
        By full name, such as ``/imu/data/angular_velocity/z`` or ``Motion.YawRate``.
    fetch : callable
        Gives the signals of some full names, and may tell what it noticed.
    clocked : callable, optional
        Where a time is an array like any other: gives the same channels, of which those that are as
        long as the array called so have it for their time, or, with a rate [Hz], are sampled so.
    left_out : tuple of LeftOut
    """

    entries: Mapping[str, Entry]
    fetch: Callable[[list[str], list[str]], Mapping[str, Signal]]
    clocked: Callable[[str, float | None], Recording] | None = None
    left_out: tuple[LeftOut, ...] = ()

    def resolve(self, name: str, channel: str) -> str:
        """Return the full name of what a channel map calls `name`: in full, or its last parts.

        Raises
        ------
        InvalidInput
            If there is no such channel, or if several have that last part.
        """
        if name in self.entries:
            return name
        found = [full for full in self.entries if ends_with(full, name)]
        if len(found) == 1:
            return found[0]
        if found:
            raise InvalidInput(
                f"{channel}: the channel map names '{name}', which is the last part of "
                f"{len(found)} channels; name one in full: {listed(found)}"
            )
        unread = next((left for left in self.left_out if left.holds(name)), None)
        if unread is not None:
            raise InvalidInput(
                f"{channel}: the channel map names '{name}', which cannot be read; {unread}"
            )
        hint = near_names(name, self.entries)
        raise InvalidInput(
            f"{channel}: the channel map names '{name}', which is not in the file{hint}; channels "
            f"are {listed(self.entries)}"
        )

    def signals(self, names: list[str], notes: list[str]) -> dict[str, Signal]:
        """Read some channels, their samples in the order of time."""
        found = self.fetch(names, notes) if names else {}  # to libraries none are all
        told: dict[str, list[str]] = {}
        result = {name: _ordered(name, found[name], told) for name in names}
        for text, which in told.items():  # once of what shares its times, as a message's fields do
            more = f" and {len(which) - 1} more" if len(which) > 1 else ""
            notes.append(f"{which[0]}{more}: {text}")
        return result

    def table(self, wanted: Mapping[str, str], absent: Iterable[str], notes: list[str]) -> Table:
        """Read the channels of a map, and bring them into rows without touching their values.

        Each row is a time at which at least one channel has a sample; the others are missing there.
        Samples that are nearer than 1 % of the shortest period share a row. Of the other channels
        those come along that were sampled together with one that is used.

        Parameters
        ----------
        wanted : mapping of str to str
            Name in the map of each canonical channel that the map names.
        absent : iterable of str
            Canonical channels to leave out although the file has their names.
        notes : list of str
            Where the warnings go.

        Raises
        ------
        InvalidInput
            If a channel is not there, or its times cannot be used.
        """
        notes += map(str, self.left_out)
        source = {channel: self.resolve(name, channel) for channel, name in wanted.items()}
        skipped = {*absent, "time_s", *wanted}
        own = [channel for channel in CHANNELS if channel not in skipped]
        found = {c: full for c in own if (full := self._called(c)) is not None}
        source.update(found)
        used = list(dict.fromkeys(source.values()))
        if not used:
            raise InvalidInput(
                f"none of the channels has a name that is known, such as vx_mps; name them in a "
                f"channel map, which `sysid-vehicle map` or sv.propose_channels proposes "
                f"(channels are {listed(self.entries)})"
            )
        lacking = [c for c in own if CHANNELS[c].required and c not in source]
        if lacking:
            others = [name for name in self.entries if name not in used]
            needed = ", ".join(f"{channel}{near_names(channel, others)}" for channel in lacking)
            raise InvalidInput(
                f"missing column{'s' if len(lacking) > 1 else ''} {needed}; name its source in a "
                f"channel map, which `sysid-vehicle map` or sv.propose_channels proposes (not used "
                f"yet are {listed(others) or 'none'})"
            )
        time_s, columns = self._rows(used, notes)
        # A channel that is found by the last part of its name is called by it from here on.
        called = {**{c: c for c in found}, **wanted}
        for channel, name in called.items():
            columns.setdefault(name, columns[source[channel]])
        units = {n: e.unit for n, e in self.entries.items() if n in columns and e.unit}
        for channel, name in called.items():
            if unit := self.entries[source[channel]].unit:
                units[name] = unit
        columns = {"time_s": time_s, **columns}
        return Table(tuple(columns), columns, {}, time_s.size, units)

    def _rows(self, used: list[str], notes: list[str]) -> tuple[FloatArray, dict[str, FloatArray]]:
        """The times of all samples [s], and the channels there, with others sampled beside them."""
        signals = self.signals(used, notes)
        empty = [name for name in used if signals[name].time_s.size == 0]
        if empty:
            raise InvalidInput(f"{empty[0]}: holds no sample; map another channel, or record it")
        _refuse_apart({name: signals[name].time_s for name in used})
        time_s, rows = common_rows({name: signals[name].time_s for name in used})
        columns = {
            name: _spread(signal.values, rows[name], time_s.size)
            for name, signal in signals.items()
        }
        for name, (like, values) in self._extras(used, signals).items():
            columns[name] = _spread(values, rows[like], time_s.size)
        return time_s, columns

    def _called(self, channel: str) -> str | None:
        try:
            return self.resolve(channel, channel)
        except InvalidInput:
            return None

    def _extras(
        self, used: list[str], signals: Mapping[str, Signal]
    ) -> dict[str, tuple[str, FloatArray]]:
        """Values of other channels, each with the used one whose times it has."""
        like = {self.entries[name].group: name for name in reversed(used)}
        beside = [
            name
            for name, entry in self.entries.items()
            if name not in used and entry.group in like and last_part(name) not in CHANNELS
        ][:_LISTED_EXTRAS]
        if not beside:
            return {}
        result: dict[str, tuple[str, FloatArray]] = {}
        for name, signal in self.fetch(beside, []).items():
            other = like[self.entries[name].group]
            if np.array_equal(signal.time_s, signals[other].time_s):
                result[name] = other, signal.values
        return result


def _refuse_apart(times: Mapping[str, FloatArray]) -> None:
    """Refuse channels of which one ends before another begins: their clocks are others."""
    first = min(times, key=lambda name: times[name][-1])
    last = max(times, key=lambda name: times[name][0])
    if times[last][0] - times[first][-1] > _LATE_S:
        raise InvalidInput(
            f"{first} and {last}: were never recorded together: the first ends at "
            f"{times[first][-1]:.6g} s, the other begins at {times[last][0]:.6g} s; map channels "
            f"of one clock, or give read_log pairs of times and values on a common one"
        )


def last_part(name: str) -> str:
    """Return what stands behind the last slash or point of a full name."""
    return name.rpartition("/")[2].rpartition(".")[2]


def ends_with(full: str, name: str) -> bool:
    """Tell whether a full name ends with some parts of a name, such as ``Message.Signal``."""
    return last_part(full) == name or full.endswith((f".{name}", f"/{name}"))


def common_rows(
    times: Mapping[str, FloatArray],
) -> tuple[FloatArray, dict[str, npt.NDArray[np.intp]]]:
    """Return the rows that several channels share, and the row of each sample.

    Parameters
    ----------
    times : mapping of ndarray, shape (n,)
        Rising times of each channel [s], none empty.

    Returns
    -------
    time_s : ndarray, shape (rows,)
        From the first sample of all on.
    rows : dict of ndarray of int, shape (n,)
    """
    periods = {name: _period(own) for name, own in times.items()}
    near = _SAME_TIME * min(periods.values())
    rows_s = np.empty(0)
    for name in sorted(times, key=lambda n: periods[n]):
        own = times[name]
        if rows_s.size:
            own = own[np.abs(rows_s[_nearest(rows_s, own)] - own) > near]
        if own.size:
            rows_s = np.unique(np.concatenate((rows_s, own)))
    found = {name: _nearest(rows_s, own) for name, own in times.items()}
    return rows_s - rows_s[0], found


def _period(time_s: FloatArray) -> float:
    return float(np.median(np.diff(time_s))) if time_s.size > 1 else np.inf


def _nearest(rows_s: FloatArray, time_s: FloatArray) -> npt.NDArray[np.intp]:
    right = np.clip(np.searchsorted(rows_s, time_s), 0, rows_s.size - 1)
    left = np.clip(right - 1, 0, None)
    closer = np.abs(rows_s[left] - time_s) < np.abs(rows_s[right] - time_s)
    result: npt.NDArray[np.intp] = np.where(closer, left, right)
    return result


def _spread(values: FloatArray, rows: npt.NDArray[np.intp], n: int) -> FloatArray:
    result = np.full(n, np.nan)
    result[rows] = values
    return result


def _ordered(name: str, signal: Signal, told: dict[str, list[str]]) -> Signal:
    """Return the samples in the order of their times, each time once."""
    time_s, values = counted_on(signal.time_s), signal.values
    step = np.diff(time_s)
    if not np.isfinite(time_s).all():
        k = int(np.flatnonzero(~np.isfinite(time_s))[0])
        raise InvalidInput(f"{name}: its time is not a number at sample {k}; mend the recording")
    if not step.size or (step > 0.0).all():
        return Signal(time_s, values)
    k = int(np.argmin(step)) + 1
    if step[k - 1] < -_LATE_S:
        raise InvalidInput(
            f"{name}: its time goes back by {-step[k - 1]:.4g} s at sample {k}; the clock was set: "
            f"cut the recording there and read the parts as separate logs"
        )
    order = np.argsort(time_s, kind="stable")
    swapped = int(np.count_nonzero(step < 0.0))
    time_s, values = time_s[order], values[order]
    fresh = np.concatenate(([True], np.diff(time_s) > 0.0))
    repeated = int(fresh.size - np.count_nonzero(fresh))
    what = [f"{swapped} samples came late and were sorted"] if swapped else []
    what += [f"{repeated} samples repeat the time of another and were left out"] if repeated else []
    text = f"{' and '.join(what)}, first at sample {k}; check the recorder"
    told.setdefault(text, []).append(name)
    return Signal(time_s[fresh], values[fresh])
