"""From whatever has named columns to private float64 arrays; times of day become seconds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, Protocol

import numpy as np

from .._common.arrays import FloatArray, as_array
from ..errors import InvalidInput, near_names
from .channels import CHANNELS, REQUIRED
from .grid import at
from .stamps import as_seconds

_SHOWN_NAMES = 20
_LARGEST = 1e12  # in any channel's unit: nothing that a sensor of a car measures


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
    raw = as_array(values)
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
