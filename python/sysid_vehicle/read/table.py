"""Columns of a file or of a table in memory, before they are given the names of channels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray
from ..errors import InvalidInput
from ..log import as_floats, as_seconds, named_columns
from .units import unit_in_name


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
    """

    names: tuple[str, ...]
    columns: Mapping[str, FloatArray]
    not_numbers: Mapping[str, BadCell]
    n: int
    units: Mapping[str, str] = field(default_factory=dict)
    seconds: Mapping[str, FloatArray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @cached_property
    def counts(self) -> Counter[str]:
        """How many columns have a name."""
        return Counter(self.names)

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
            raise InvalidInput(
                f"{name}: {self.not_numbers[name]} is not a number; correct the cell, or empty it "
                f"for a missing measurement"
            )
        return self.columns[name]


def table_of(data: object) -> Table:
    """Return the columns of a mapping of arrays or of a table in memory (pandas, polars, Arrow).

    An index of times becomes the column ``time_s`` where there is none. Units are taken from the
    metadata of Arrow's fields, and from ``attrs`` of pandas' columns.

    Raises
    ------
    InvalidInput
        If `data` has no named columns.
    """
    columns: dict[str, FloatArray] = {}
    not_numbers: dict[str, BadCell] = {}
    seconds: dict[str, FloatArray] = {}
    pairs = named_columns(data)
    index = getattr(data, "index", None)
    if index is not None and "time_s" not in dict(pairs) and _is_time(index):
        pairs = [("time_s", index), *pairs]
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
    n = max((values.size for values in (*columns.values(), *seconds.values())), default=0)
    names = tuple(name for name, _ in pairs)
    return Table(names, columns, not_numbers, n, _stated_units(data, pairs), seconds)


def _is_time(index: Any) -> bool:
    """Tell whether the index of a frame is one of stamps or durations, or says that it is time."""
    kind = getattr(getattr(index, "dtype", None), "kind", "O")
    named = str(getattr(index, "name", "")).lower() in ("time", "time_s", "timestamps", "t")
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
