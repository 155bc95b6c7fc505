"""Time stamps of any kind as seconds since the first."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from .._common.arrays import FloatArray, as_array

_STAMP = re.compile(
    r"(\d{4}-\d\d-\d\d[T ]|\d\d?[./]\d\d?[./]\d{4} )?"
    r"(\d\d?:\d\d:\d\d(?:[.,]\d+|:\d{3})?) ?([AP]M)? ?(Z|[+-]\d\d:?\d\d)?",
    re.I,
)
# Months by name, in English and German: 28-Nov-2026 10:59:59.5, Sat Nov 28 10:59:59 GMT+01:00 2026.
_ENGLISH = "jan feb mar apr may jun jul aug sep oct nov dec"
_MONTHS = {
    **{name: 1 + k for k, name in enumerate(_ENGLISH.split())},
    "jän": 1,
    "mär": 3,
    "mrz": 3,
    "mai": 5,
    "okt": 10,
    "dez": 12,
}
_NAMED = rf"({'|'.join(_MONTHS)})[a-z]*\.?"
_DAY_FIRST = re.compile(rf"(\d\d?)[.\- /]+{_NAMED}[\- /]+(\d{{4}})[ ,T]+(.*)", re.I)
_YEAR_FIRST = re.compile(r"(\d{4})[/.](\d\d?)[/.](\d\d?)[ T](.*)")
_AS_UNIX = re.compile(
    rf"(?:[a-z]{{3}},? )?{_NAMED} +(\d\d?) (\S+)(?: (?:[a-z]*([+-]\d\d:?\d\d)|[a-z]+))? (\d{{4}})",
    re.I,
)
_MINUTES = re.compile(r"(\d+):(\d\d[.,]\d+)")  # of a lap, or how spreadsheets show a time of day
_DAY_S, _HOUR_S, _WEEK_S = 86400.0, 3600.0, 604800.0
_TURN_S = 1.0  # readings on both sides of the end of a day or a week are nearer to it
_YEAR_LAST = re.compile(r"(\d\d?)[./](\d\d?)[./](\d{4})T(.*)")


def as_seconds(values: Any) -> FloatArray | None:
    """Return time stamps (datetime64, pandas, times of day, text) as seconds since the first.

    None if `values` are no time stamps.
    """
    raw = as_array(values)
    if raw.ndim != 1 or raw.size == 0:
        return None
    if raw.dtype.kind == "M":
        return _seconds(raw - raw[0])
    if raw.dtype.kind == "m":
        return _seconds(raw)
    if raw.dtype.kind in "US" or (raw.dtype.kind == "O" and isinstance(raw[0], str)):
        return seconds_of_stamps([str(value) for value in raw])
    if raw.dtype.kind == "O" and hasattr(raw[0], "tzinfo"):
        if not hasattr(raw[0], "year"):  # datetime.time
            return seconds_of_stamps(["" if value is None else str(value) for value in raw])
        try:  # datetime, pandas.Timestamp
            return np.array([(value - raw[0]).total_seconds() for value in raw], dtype=np.float64)
        except (TypeError, AttributeError):
            return None
    return None


def _seconds(span: np.ndarray) -> FloatArray:
    """Return timedelta64 as seconds; ``NaT`` becomes NaN."""
    seconds: FloatArray = span / np.timedelta64(1, "s")
    return seconds


def seconds_of_stamps(cells: Sequence[str]) -> FloatArray | None:
    """Return dates with time, times of day, or minutes and seconds, as seconds since the first.

    Dates are those of ISO 8601 or have the year last; of these, ``05/03/2026``, the order of day
    and month is the one in which less time passes. Months may be names. Times of day are counted on
    where the day ends, minutes where the hour ends. None if a cell is none of them, or if they are
    not all alike.

    Parameters
    ----------
    cells : sequence of str
        One stamp per sample; empty ones become NaN. Offsets from UTC may change only with a date.
    """
    texts = [cell.strip() for cell in cells]
    if all(_MINUTES.fullmatch(text) for text in texts if text) and any(texts):
        return _of_minutes(texts)
    stamps, zones, dated = [], [], set()
    for text in texts:
        if not text:
            stamps.append("NaT")
            zones.append("")
            continue
        match = _STAMP.fullmatch(text) or _STAMP.fullmatch(_with_numbers(text))
        if match is None:
            return None
        day, clock, half, zone = match.groups()
        zones.append(zone)
        dated.add(day is None)
        stamps.append((day or "1970-01-01T").replace(" ", "T") + _of_day(clock, half))
    known_zones = set(zones) - {""}
    if len(dated) != 1 or (len(known_zones) > 1 and (dated == {True} or None in known_zones)):
        return None
    east_s = np.array([_offset_s(zone) for zone in zones])
    read = [_times(stamps, day_at, east_s) for day_at in (0, 1)]
    known = [times for times in read if times is not None]
    if dated == {True}:
        known = [_counted_on(times, _DAY_S) for times in known]
    return min(known, key=lambda times: float(np.nanmax(times) - np.nanmin(times)), default=None)


def _with_numbers(text: str) -> str:
    """A stamp whose month is a name, or that begins with the year, with its date as ISO 8601."""
    if found := _YEAR_FIRST.fullmatch(text):
        year, number, day, rest = found.groups()
        return f"{year}-{int(number):02d}-{int(day):02d} {rest}"
    if found := _DAY_FIRST.fullmatch(text):
        day, month, year, rest = found.groups()
    elif found := _AS_UNIX.fullmatch(text):
        month, day, clock, zone, year = found.groups()
        rest = clock + (zone or "")
    else:
        return text
    return f"{year}-{_MONTHS[month.lower()]:02d}-{int(day):02d} {rest}"


def _of_day(clock: str, half: str | None) -> str:
    """A time of day as ISO 8601 has it; `half` is the half of the day, if it has twelve hours."""
    hour, minute, rest = clock.replace(",", ".").split(":", 2)
    rest = f"{minute}:{rest.replace(':', '.')}"  # milliseconds behind a colon
    if half is not None:
        hour = str(int(hour) % 12 + 12 * (half.upper() == "PM"))
    return f"{hour.zfill(2)}:{rest}"


def _of_minutes(texts: Sequence[str]) -> FloatArray:
    seconds = np.full(len(texts), np.nan)
    for k, text in enumerate(texts):
        if match := _MINUTES.fullmatch(text):
            seconds[k] = 60.0 * int(match[1]) + float(match[2].replace(",", "."))
    counted = _counted_on(seconds, _HOUR_S)
    result: FloatArray = counted - counted[np.isfinite(counted)][0]
    return result


def _offset_s(zone: str | None) -> float:
    """How far a zone is ahead of UTC [s]."""
    if not zone or zone.upper() == "Z":
        return 0.0
    digits = zone[1:].replace(":", "")
    ahead = 3600.0 * int(digits[:2]) + 60.0 * int(digits[2:])
    return -ahead if zone[0] == "-" else ahead


def _counted_on(seconds: FloatArray, period_s: float) -> FloatArray:
    """Add a period after each of its ends: a day, or an hour."""
    result = seconds.copy()
    there = np.flatnonzero(np.isfinite(seconds))
    ends = np.diff(seconds[there]) < -0.5 * period_s
    result[there[1:]] += period_s * np.cumsum(ends)
    return result


def counted_on(seconds: FloatArray) -> FloatArray:
    """Return times [s] that begin from 0 again, as seconds of the day or the week do, counted on.

    Others are returned as they are.
    """
    back = np.flatnonzero(np.diff(seconds) < 0.0)
    for period_s in (_DAY_S, _WEEK_S):
        before, after = seconds[back] - period_s, seconds[back + 1]
        if back.size and (np.abs(before) <= _TURN_S).all() and (np.abs(after) <= _TURN_S).all():
            return _counted_on(seconds, period_s)
    return seconds


def _times(stamps: Sequence[str], day_at: int, east_s: FloatArray) -> FloatArray | None:
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
    known = np.flatnonzero(~np.isnat(times))
    if not known.size:
        return None
    seconds: FloatArray = _seconds(times - times[known[0]]) - (east_s - east_s[known[0]])
    return seconds
