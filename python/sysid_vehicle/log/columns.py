"""From whatever has named columns to private float64 arrays; times of day become seconds."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, Protocol

import numpy as np

from .._common.arrays import FloatArray
from ..errors import InvalidInput, near_names
from .channels import CHANNELS, REQUIRED
from .grid import at

_SHOWN_NAMES = 20
_LARGEST = 1e12  # in any channel's unit: nothing that a sensor of a car measures
_STAMP = re.compile(
    r"(\d{4}-\d\d-\d\d[T ]|\d\d?[./]\d\d?[./]\d{4} )?"
    r"(\d\d?:\d\d:\d\d(?:[.,]\d+)?) ?(Z|[+-]\d\d:?\d\d)?"
)
_DAY_S = 86400.0
_YEAR_LAST = re.compile(r"(\d\d?)[./](\d\d?)[./](\d{4})T(.*)")


class Columns(Protocol):
    """Anything with named columns: a dict of arrays, a DataFrame, ``numpy.load`` of an .npz."""

    def keys(self) -> Iterable[Any]:
        """Return the column names."""

    def __getitem__(self, key: Any, /) -> Any:
        """Return one column."""


def listed(names: Iterable[str]) -> str:
    """Return the names for a message, only the first of very many."""
    names = list(names)
    more = f", ... ({len(names)} in all)" if len(names) > _SHOWN_NAMES else ""
    return ", ".join(names[:_SHOWN_NAMES]) + more


def named_columns(data: object) -> list[tuple[str, Any]]:
    """Return names and columns of a mapping, a DataFrame (pandas, polars), an Arrow table, ...

    Raises
    ------
    InvalidInput
        If `data` has no named columns.
    """
    none = InvalidInput(
        f"a {type(data).__name__} has no named columns; give a dict of arrays by channel name, "
        f"or a table (pandas, polars, Arrow)"
    )
    if isinstance(data, np.ndarray) and data.dtype.names:
        keys: Sequence[Any] = data.dtype.names
    elif callable(getattr(data, "keys", None)):
        keys = list(data.keys())  # type: ignore[attr-defined]
    elif (names := getattr(data, "column_names", getattr(data, "columns", None))) is not None:
        keys = [str(name) for name in names]
    else:
        raise none
    try:
        return [(str(key), data[key]) for key in keys]  # type: ignore[index]
    except (LookupError, TypeError):
        raise none from None


def collect(data: object, notes: list[str]) -> dict[str, FloatArray]:
    """Return the numeric columns of `data`, canonical channels checked; tell `notes` what was left.

    Raises
    ------
    InvalidInput
        If a channel is absent, empty, of another length or kind, or holds values without end.
    """
    pairs = named_columns(data)
    names = [name for name, _ in pairs]
    _check_presence(names)
    columns: dict[str, FloatArray] = {}
    for name, raw in pairs:
        values = as_seconds(raw) if name == "time_s" else None
        if values is not None:
            _check_stamps(values)
        else:
            values = as_floats(raw, name, required=name in CHANNELS)
        if values is not None:
            columns[name] = values
    n = columns["time_s"].size
    for name in list(columns):
        values = columns[name]
        if values.size != n:
            raise InvalidInput(
                f"{name}: has {values.size} samples, time_s has {n}; give columns of equal length"
            )
        if name == "time_s":
            continue
        _check_finite(name, values, columns["time_s"])
        if n and name in CHANNELS and np.isnan(values).all():
            if CHANNELS[name].required:
                raise InvalidInput(
                    f"{name}: holds no value at any of the {n} samples; the model needs it: check "
                    f"the column or map another one to it"
                )
            del columns[name]
            notes.append(
                f"{name}: holds no value at any of the {n} samples and is treated as absent; "
                f"leave the column out"
            )
    if "fx_n" not in columns and "ax_mps2" not in columns:
        raise InvalidInput(
            f"fx_n and ax_mps2: both are absent, so nothing tells how the car is driven and braked "
            f"(columns: {listed(names)}); give at least one of them"
        )
    return columns


def _check_presence(names: list[str]) -> None:
    missing = [channel for channel in REQUIRED if channel not in names]
    if missing:
        others = [name for name in dict.fromkeys(names) if name not in CHANNELS]
        wanted = ", ".join(f"{channel}{near_names(channel, others)}" for channel in missing)
        raise InvalidInput(
            f"missing column{'s' if len(missing) > 1 else ''} {wanted}; rename the column, or name "
            f"its source in a channel map, which `sysid-vehicle map` or sv.propose_channels "
            f"proposes (columns: {listed(names)})"
        )
    name, count = Counter(names).most_common(1)[0]
    if count > 1:
        raise InvalidInput(f"{name}: {count} columns have this name; keep one")


def _check_stamps(seconds: FloatArray) -> None:
    step = float(np.median(np.diff(seconds))) if seconds.size > 1 else 0.0
    if step >= 1.0:
        raise InvalidInput(
            f"time_s: the stamps are {step:.4g} s apart from sample 0 on; a drive needs at least "
            f"several samples a second: map the column of the time of day, or give seconds"
        )


def _check_finite(name: str, values: FloatArray, time_s: FloatArray) -> None:
    endless = np.flatnonzero(np.isinf(values))
    if endless.size:
        raise InvalidInput(
            f"{name}: infinite at {at(int(endless[0]), time_s)} ({endless.size} "
            f"such samples); leave missing measurements empty or NaN"
        )
    if name in CHANNELS:
        endless = np.flatnonzero(np.abs(values) > _LARGEST)
        if endless.size:
            raise InvalidInput(
                f"{name}: {values[endless[0]]:.4g} at {at(int(endless[0]), time_s)} is no "
                f"measurement ({endless.size} such samples); leave missing measurements empty "
                f"or NaN"
            )


def as_floats(values: Any, name: str, required: bool) -> FloatArray | None:
    """Return a private float64 copy of a column; None if it is not numeric and not `required`.

    Raises
    ------
    InvalidInput
        If a `required` column is not one of numbers.
    """
    raw = _as_array(values)
    try:
        if raw.dtype.kind in "mMcV":  # dates would become nanoseconds, complex numbers lose a part
            raise TypeError
        array = raw.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        if not required:
            return None
        if raw.dtype.kind not in "cV":
            for i, value in enumerate(raw.flat):
                try:
                    float(value)
                except (TypeError, ValueError, OverflowError):
                    raise InvalidInput(
                        f"{name}: {str(value)!r} at sample {i} is not a number; correct it, or use "
                        f"NaN for a missing measurement"
                    ) from None
        raise InvalidInput(f"{name}: holds {raw.dtype}; give a column of plain numbers") from None
    if array.ndim != 1:
        if not required:
            return None
        raise InvalidInput(f"{name}: has shape {array.shape}; give a one-dimensional array")
    return array


def _as_array(values: Any) -> np.ndarray:
    """Return a column as an array; masked values become NaN, ragged ones an array of objects."""
    if isinstance(values, np.ma.MaskedArray) and values.dtype.kind in "biuf":
        return np.ma.filled(values.astype(np.float64), np.nan)
    try:
        raw = np.asarray(values)
        if raw.dtype.kind == "O" and hasattr(values, "to_numpy") and _is_nullable(values):
            return np.asarray(values.to_numpy(dtype=np.float64, na_value=np.nan))
        return raw
    except ValueError:
        ragged = np.empty(len(values), dtype=object)
        ragged[:] = list(values)
        return ragged


def _is_nullable(values: Any) -> bool:
    """Whether a pandas series holds numbers beside a mask, which numpy does not know."""
    kind = getattr(values, "dtype", None)
    return hasattr(kind, "na_value") and getattr(kind, "kind", "O") in tuple("biuf")


def as_seconds(values: Any) -> FloatArray | None:
    """Return time stamps (datetime64, pandas, ISO 8601 text) as seconds since the first.

    None if `values` are no time stamps.
    """
    raw = _as_array(values)
    if raw.ndim != 1 or raw.size == 0:
        return None
    if raw.dtype.kind == "M":
        return _seconds(raw - raw[0])
    if raw.dtype.kind == "m":
        return _seconds(raw)
    if raw.dtype.kind in "US" or (raw.dtype.kind == "O" and isinstance(raw[0], str)):
        return seconds_of_stamps([str(value) for value in raw])
    if raw.dtype.kind == "O" and hasattr(raw[0], "tzinfo"):  # datetime, pandas.Timestamp
        try:
            return np.array([(value - raw[0]).total_seconds() for value in raw], dtype=np.float64)
        except (TypeError, AttributeError):
            return None
    return None


def _seconds(span: np.ndarray) -> FloatArray:
    """Return timedelta64 as seconds; ``NaT`` becomes NaN."""
    seconds: FloatArray = span / np.timedelta64(1, "s")
    return seconds


def seconds_of_stamps(cells: Sequence[str]) -> FloatArray | None:
    """Return ISO 8601 dates with time, or times of day, as seconds since the first; else None.

    Of dates with the year last, ``05/03/2026``, the order of day and month is the one in which
    less time passes. Times of day are counted on where the day ends.

    Parameters
    ----------
    cells : sequence of str
        One stamp per sample, all with the same offset from UTC; empty ones become NaN.
    """
    stamps, zones, dated = [], set(), set()
    for cell in cells:
        if not cell.strip():
            stamps.append("NaT")
            continue
        match = _STAMP.fullmatch(cell.strip())
        if match is None:
            return None
        day, clock, zone = match.groups()
        zones.add(zone)
        dated.add(day is None)
        clock = clock.replace(",", ".").zfill(len(clock) + (clock[1] == ":"))
        stamps.append((day or "1970-01-01T").replace(" ", "T") + clock)
    if len(zones) != 1 or len(dated) != 1:
        return None
    read = [_times(stamps, day_at) for day_at in (0, 1)]
    known = [times for times in read if times is not None]
    if dated == {True}:
        known = [_counted_on(times) for times in known]
    return min(known, key=lambda times: float(np.nanmax(times) - np.nanmin(times)), default=None)


def _counted_on(seconds: FloatArray) -> FloatArray:
    """Add a day after each midnight."""
    result = seconds.copy()
    there = np.flatnonzero(np.isfinite(seconds))
    ends = np.diff(seconds[there]) < -0.5 * _DAY_S
    result[there[1:]] += _DAY_S * np.cumsum(ends)
    return result


def _times(stamps: Sequence[str], day_at: int) -> FloatArray | None:
    """Seconds since the first stamp, `day_at` the place of the day in dates with the year last."""

    def iso(stamp: str) -> str:
        parts = _YEAR_LAST.fullmatch(stamp)
        if parts is None:
            return stamp
        day, month = parts[1 + day_at].zfill(2), parts[2 - day_at].zfill(2)
        return f"{parts[3]}-{month}-{day}T{parts[4]}"

    try:
        times = np.array([iso(stamp) for stamp in stamps], dtype="datetime64[ns]")
    except ValueError:
        return None
    known = times[~np.isnat(times)]
    return _seconds(times - known[0]) if known.size else None
