"""Long tables, as data bases of time series export them: a row for each reading.

One column holds the times, one the names of the channels or their numbers, one the values. Each
channel becomes one with its own times.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray
from ..errors import InvalidInput
from ..log import CHANNELS
from .recording import Entry, LeftOut, Recording, Signal
from .table import Table
from .units import factor_to, unit_at_end, without_unit

_TIMES = ("time", "timestamp", "datetime", "times", "t", "ts", "date", "seconds")
_NAMES = ("field", "signal", "channel", "name", "variable", "metric", "series", "parameter", "key",
          "sensor", "measurement", "tag", "topic", "id")  # fmt: skip
_OWNERS = ("device", "node", "source", "host", "car", "vehicle", "bus")
_VALUES = ("value", "values", "val", "reading", "data")
_UNITS = ("unit", "units")
_FEWEST = 2  # readings of a channel, on average
_ENDS = ("name", "id")
_NO_NAME = ("", "None", "nan", "<NA>", "null")

Rows = npt.NDArray[np.intp]


def recording_of_long(table: Table) -> Recording | None:
    """Return the channels of a long table, each with its own times; None of any other table.

    A table is long if it has columns for time, name and value that are called so, such as
    ``_time``, ``_field`` and ``_value`` of InfluxDB, or if there are only three and they can be
    nothing else; and if it has none of the canonical channels. Numbers in place of names, such as
    the keys of series in a data base, are names as they are written: ``17``.
    """
    if any(name in CHANNELS for name in table.names if name != "time_s"):
        return None
    found = _columns(table)
    if found is None:
        return None
    time, name, value = found
    time_s = _seconds(table, time)
    labels, ids = np.unique(_words(table, name), return_inverse=True)
    if labels.size * _FEWEST > ids.size:
        return None
    values, not_numbers = _numbers(table, value)
    order, ends = np.argsort(ids, kind="stable"), np.cumsum(np.bincount(ids))
    found_rows = zip(labels, np.split(order, ends[:-1]), strict=True)
    rows = {str(label): at for label, at in found_rows if label.strip() not in _NO_NAME}
    rows = _told_apart(rows, time_s, _others(table, (time, name, value)))
    text = {n: "text" for n, at in rows.items() if not_numbers[at].all()}
    units = _units(table)
    signals = {n: _signal(at, time_s, values) for n, at in rows.items() if n not in text}
    clocks = {n: s.time_s.tobytes() for n, s in signals.items()}
    number = {clock: str(k) for k, clock in enumerate(dict.fromkeys(clocks.values()))}
    entries = {
        n: Entry("" if units is None else units[rows[n][0]], number[clocks[n]]) for n in signals
    }
    if not signals:
        raise InvalidInput(
            f"{value}: holds no numbers, but the table has a row for each reading (column {name} "
            f"names the channels); export the readings as numbers"
        )
    left = LeftOut("channel", text, "with no numbers", "export numbers if they are wanted")

    def fetch(names: list[str], notes: list[str]) -> dict[str, Signal]:
        notes += table.notes
        return {name: signals[name] for name in names}

    return Recording(entries, fetch, left_out=(left,) if text else ())


def _columns(table: Table) -> tuple[str, str, str] | None:
    """The columns of times, names and values."""
    text = [n for n in table.texts if table.counts[n] == 1]
    numbers = [n for n in table.columns if n and n not in table.seconds and table.counts[n] == 1]
    time = _called(_TIMES, [*table.seconds, *numbers])
    name = _called(_NAMES, text) or _called(_NAMES, [n for n in numbers if _counts(table, n)])
    value = _called(_VALUES, [n for n in (*numbers, *text) if n != name])
    if len([n for n in table.names if n]) == 3 and len(text) == 1 and time:
        others = [n for n in numbers if n != time]
        name, value = text[0], others[0] if len(others) == 1 else value
    return (time, name, value) if time and name and value else None


def _counts(table: Table, name: str) -> bool:
    """Whether a column holds several whole numbers, which come again, and nothing else."""
    known = table.columns[name][~np.isnan(table.columns[name])]
    several = np.unique(known).size
    return bool((known == np.rint(known)).all()) and 1 < several <= known.size / _FEWEST


def _words(table: Table, name: str) -> npt.NDArray[np.str_]:
    """The cells of a column of names or of whole numbers, empty where there is none."""
    if name in table.texts:
        return np.array(table.texts[name], dtype=str)
    several, which = np.unique(table.columns[name], return_inverse=True)
    return np.array(["" if np.isnan(c) else f"{c:.0f}" for c in several], dtype=str)[which]


def _called(words: Sequence[str], names: Sequence[str]) -> str:
    """The column that is called by the first of some words; empty if none is."""
    plain = {}
    for name in reversed(names):
        bare = without_unit(unit_at_end(name, "s")[0], "s")
        word = re.sub(r"[^a-z]", "", bare.lower())
        plain[word] = name
        for end in _ENDS:
            plain.setdefault(word.removesuffix(end), name)
    return next((plain[word] for word in words if word in plain), "")


def _seconds(table: Table, time: str) -> FloatArray:
    if time in table.seconds:
        return table.seconds[time]
    unit = table.unit(time, "s") or unit_at_end(time, "s")[1]
    return table.columns[time] * (factor_to("s", unit) or 1.0)


def _numbers(table: Table, value: str) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Values, and where there is text in place of one."""
    if value in table.columns:
        return table.columns[value], np.zeros(table.n, dtype=bool)
    cells = table.texts[value]
    values = np.full(len(cells), np.nan)
    text = np.zeros(len(cells), dtype=bool)
    for k, cell in enumerate(cells):
        try:
            values[k] = float(cell)
        except (TypeError, ValueError):
            text[k] = bool(str(cell).strip())
    return values, text


def _others(table: Table, used: Sequence[str]) -> list[npt.NDArray[np.str_]]:
    """What tells channels apart beside their names: the device they are of, or its number."""
    numbers = (n for n in table.columns if n and table.counts[n] == 1 and n not in table.seconds)
    keys = (n for n in numbers if _called((*_NAMES, *_OWNERS), [n]) and _counts(table, n))
    found = [
        _words(table, name)
        for name in (*table.texts, *keys)
        if name not in used and _called(_UNITS, [name]) == ""
    ]
    return [cells for cells in found if (cells != cells[0]).any()]


def _told_apart(
    rows: Mapping[str, Rows], time_s: FloatArray, others: Sequence[npt.NDArray[np.str_]]
) -> dict[str, Rows]:
    """Split names that have several readings at one time by what else the rows say."""
    result: dict[str, Rows] = {}
    for name, at in rows.items():
        parts = {name: at}
        for cells in others:
            if all(np.unique(time_s[k]).size == k.size for k in parts.values()):
                break
            parts = {
                f"{cell}.{part}": k[cells[k] == cell]
                for part, k in parts.items()
                for cell in np.unique(cells[k])
            }
        result.update(parts)
    return result


def _units(table: Table) -> Sequence[str] | None:
    name = _called(_UNITS, list(table.texts))
    return [str(cell).strip() for cell in table.texts[name]] if name else None


def _signal(at: Rows, time_s: FloatArray, values: FloatArray) -> Signal:
    known = at[np.isfinite(time_s[at])]
    order = np.argsort(time_s[known], kind="stable")
    return Signal(time_s[known][order], values[known][order])
