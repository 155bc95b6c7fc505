"""Columns of a file or of a table in memory, before they are given the names of channels."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray
from ..errors import InvalidInput
from ..log import as_floats, as_seconds, named_columns
from .units import unit_in_name

_SEPARATED = re.compile(r"[+-]?\d+([.,'\s]\d{3})*([.,]\d+)?")  # no number to a computer


@dataclass(frozen=True)
class BadCell:
    """The first cell of a column that is not a number."""

    text: str
    sample: int
    line: int | None = None

    def __str__(self) -> str:
        where = f"at sample {self.sample}"
        if self.line is not None:
            where = f"in line {self.line} (sample {self.sample})"
        return f"'{self.text}' {where}"


@dataclass(frozen=True)
class Table:
    """Columns by name; cells that are no numbers are noted, not yet an error.

    Attributes
    ----------
    names : tuple of str
        All columns as they come.
    columns : mapping of ndarray, shape (n,)
        Those of numbers.
    not_numbers : mapping of BadCell
        The others.
    n : int
        Number of rows.
    units : mapping of str
        Units that the file states.
    seconds : mapping of ndarray, shape (n,)
        Columns of time stamps, as seconds since the first.
    notes : tuple of str
        What was corrected while reading.
    texts : mapping of sequence
        Cells of the columns that hold neither numbers nor stamps.
    """

    names: tuple[str, ...]
    columns: Mapping[str, FloatArray]
    not_numbers: Mapping[str, BadCell]
    n: int
    units: Mapping[str, str] = field(default_factory=dict)
    seconds: Mapping[str, FloatArray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    texts: Mapping[str, Sequence[Any]] = field(default_factory=dict)

    @cached_property
    def counts(self) -> Counter[str]:
        """How many columns have a name."""
        return Counter(self.names)

    def renamed(self, name: str, to: str) -> Table:
        """Return the table with another name for one column of numbers."""
        names = tuple(to if n == name else n for n in self.names)
        columns = {to if n == name else n: values for n, values in self.columns.items()}
        return replace(self, names=names, columns=columns)

    def unit(self, name: str, si_unit: str) -> str:
        """Return the unit that the file states for a column of some quantity; empty if none."""
        return self.units.get(name) or unit_in_name(name, si_unit)

    def column(self, name: str) -> FloatArray:
        """Return one column.

        Raises
        ------
        InvalidInput
            If it holds a cell that is not a number, or if several columns have this name.
        """
        if self.counts[name] > 1:
            raise InvalidInput(
                f"{name}: {self.counts[name]} columns have this name; rename or delete one"
            )
        if name in self.not_numbers:
            bad = self.not_numbers[name]
            remedy = "correct the cell, or empty it for a missing measurement"
            if _SEPARATED.fullmatch(bad.text):
                remedy = "export it with decimal points and without separators of thousands"
            raise InvalidInput(f"{name}: {bad} is not a number; {remedy}")
        return self.columns[name]


def table_of(data: object) -> Table:
    """Return the columns of a mapping of arrays or of a table in memory (pandas, polars, Arrow).

    An index of times becomes the column ``time_s`` where there is none, and keeps its own name
    beside it; so does one that pandas wrote into Arrow or Parquet. An array of one column or one
    row counts as a column. Units are taken from the metadata of Arrow's fields, and from ``attrs``
    of pandas' columns.

    Raises
    ------
    InvalidInput
        If `data` has no named columns.
    """
    columns: dict[str, FloatArray] = {}
    not_numbers: dict[str, BadCell] = {}
    seconds: dict[str, FloatArray] = {}
    texts: dict[str, Sequence[Any]] = {}
    pairs = [(name, _one_dimensional(raw)) for name, raw in named_columns(data)]
    name, index = _index(data, dict(pairs))
    if index is not None and _is_time(index, name):
        new = [n for n in dict.fromkeys(("time_s", name)) if n and n not in dict(pairs)]
        pairs = [*((n, index) for n in new), *pairs]
    for name, raw in pairs:
        stamps = as_seconds(raw)
        values = as_floats(raw, name, required=False) if stamps is None else None
        if stamps is not None:
            seconds[name] = stamps
            if name == "time_s":
                columns[name] = stamps
        if values is not None:
            columns[name] = values
        elif name not in columns:
            cells = np.asarray(raw, dtype=object).ravel()
            not_numbers[name] = _first_bad(cells)
            if stamps is None and np.ndim(cells) == 1:
                texts[name] = list(cells)
    n = max((values.size for values in (*columns.values(), *seconds.values())), default=0)
    names = tuple(name for name, _ in pairs)
    units = _stated_units(data, pairs)
    return Table(names, columns, not_numbers, n, units, seconds, texts=texts)


def _one_dimensional(raw: Any) -> Any:
    """Return an array with one dimension longer than 1 as one of a single dimension."""
    if isinstance(raw, np.ndarray) and raw.ndim > 1 and raw.size == max(raw.shape) > 1:
        return raw.ravel()
    return raw


def _index(data: object, columns: Mapping[str, Any]) -> tuple[str, Any]:
    """Name and values of the index of a frame, or of the one that pandas left in Arrow's schema."""
    index = getattr(data, "index", None)
    if index is not None and not callable(index):
        own = getattr(index, "name", None)
        return ("" if own is None else str(own)), index
    told = getattr(getattr(data, "schema", None), "pandas_metadata", None) or {}
    names = [name for name in told.get("index_columns", ()) if isinstance(name, str)]
    if len(names) != 1 or names[0] not in columns:
        return "", None
    return names[0], np.asarray(columns[names[0]])


def _is_time(index: Any, name: str) -> bool:
    """Tell whether the index of a frame is one of stamps or durations, or says that it is time."""
    kind = getattr(getattr(index, "dtype", None), "kind", "O")
    named = name.lower() in ("time", "time_s", "timestamps", "t")
    return kind in tuple("mM") or (named and kind in tuple("iuf"))


def _stated_units(data: object, pairs: list[tuple[str, Any]]) -> dict[str, str]:
    units: dict[str, str] = {}
    for entry in getattr(data, "schema", None) or () if hasattr(data, "column_names") else ():
        told = entry.metadata or {}
        unit = next((told[key] for key in (b"unit", b"units") if key in told), b"")
        units[entry.name] = unit.decode("utf-8", errors="replace")
    for name, raw in pairs:
        attrs = getattr(raw, "attrs", None)
        if isinstance(attrs, Mapping):
            units.setdefault(name, str(attrs.get("units", attrs.get("unit", ""))))
    return {name: unit for name, unit in units.items() if unit}


def _first_bad(cells: npt.NDArray[np.object_]) -> BadCell:
    for k, cell in enumerate(cells):
        try:
            float(cell)
        except (TypeError, ValueError, OverflowError):
            return BadCell(str(cell), k)
    return BadCell(str(cells[0]) if cells.size else "", 0)
