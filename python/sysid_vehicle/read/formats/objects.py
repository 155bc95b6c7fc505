"""What is in memory: tables, xarray data sets, pairs of times and values, an opened MDF."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...log import as_floats, as_seconds
from ..recording import Entry, Recording, Signal
from ..table import Table, table_of
from ..units import factor_to

_PAIR = 2


def contents_of_object(data: Any) -> Table | Recording:
    """Return the columns of a table in memory, or the channels of what has several times.

    A mapping may hold pairs of times and values, ``{"vx_mps": (t, v), ...}``: then each channel
    has its own. So it is with the coordinates of xarray's data sets.

    Raises
    ------
    InvalidInput
        If `data` has no named columns.
    """
    if hasattr(data, "data_vars") and hasattr(data, "coords"):
        return _of_xarray(data)
    if isinstance(data, Mapping) and data and all(_is_pair(value) for value in data.values()):
        return _of_pairs(data)
    return table_of(data)


def _is_pair(value: Any) -> bool:
    return isinstance(value, tuple) and len(value) == _PAIR and all(np.ndim(v) == 1 for v in value)


def _of_pairs(data: Mapping[Any, Any]) -> Recording:
    pairs = {str(name): pair for name, pair in data.items()}
    return Recording(
        {name: Entry("", str(id(pair[0]))) for name, pair in pairs.items()},
        lambda names, notes: {name: _signal(name, *pairs[name]) for name in names},
    )


def _of_xarray(data: Any) -> Recording:
    entries, found = {}, {}
    for name, array in data.data_vars.items():
        if array.ndim != 1 or array.dims[0] not in data.coords:
            continue
        dim = array.dims[0]
        entries[str(name)] = Entry(str(array.attrs.get("units", "")), str(dim))
        found[str(name)] = data.coords[dim], array
    if not entries:
        raise InvalidInput(
            "the data set has no variable over one coordinate of time; add the times as the "
            "coordinate of their dimension"
        )
    begins = _begins([time for time, _ in found.values()])

    def fetch(names: list[str], notes: list[str]) -> dict[str, Signal]:
        result = {}
        for name in names:
            time, array = found[name]
            values = time.values if begins is None else time.values - begins
            if values.dtype.kind in "iuf":
                values = values * (factor_to("s", str(time.attrs.get("units", ""))) or 1.0)
            result[name] = _signal(name, values, array.values)
        return result

    return Recording(entries, fetch)


def _begins(times: list[Any]) -> Any:
    """The first stamp of all, from which stamps are counted; None where times are numbers."""
    stamps = [t.values[0] for t in times if t.values.dtype.kind == "M" and t.size]
    return min(stamps) if stamps else None


def _signal(name: str, time: Any, values: Any) -> Signal:
    raw = np.asarray(time)
    seconds = as_seconds(raw) if raw.dtype.kind != "M" else None
    if raw.dtype.kind == "M":
        raise InvalidInput(f"{name}: has stamps for times; give seconds from one common start")
    time_s = seconds if seconds is not None else as_floats(raw, name, required=True)
    numbers = as_floats(values, name, required=True)
    assert time_s is not None
    assert numbers is not None
    if time_s.size != numbers.size:
        raise InvalidInput(
            f"{name}: has {time_s.size} times and {numbers.size} values; give as many of both"
        )
    return Signal(time_s, numbers)
