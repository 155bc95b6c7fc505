"""RaceLogic VBOX ``.vbo``: sections of text, columns apart by spaces.

The lines of ``[header]`` title the columns and often end with the unit; ``[channel units]`` has the
units of the last columns, those of input modules. Time is that of day, HHMMSS.ss.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import InvalidInput
from ..table import BadCell, Table
from ..units import is_unit
from .csv import is_number
from .text import read_text_table

_DAY_S = 86400.0
_TIME = "time"


def read(path: Path, dbc: Path | None) -> Table:
    """Read a file; its time is seconds since midnight, counted on where the day ends."""
    parts, first_line = _sections(read_text_table(path))
    names = " ".join(parts.get("column names", [])).split()
    data = parts.get("data", [])
    if all("." not in text for text in data):  # written where the comma is decimal
        data = [text.replace(",", ".") for text in data]
    rows = [(line, text.split()) for line, text in enumerate(data, first_line)]
    rows = [(line, cells) for line, cells in rows if cells]
    if not names or not rows:
        raise InvalidInput(f"{path}: has no [column names] or no [data]; export it again")
    notes: list[str] = []
    if len(rows) > 1 and len(rows[-1][1]) < len(names):
        line, cells = rows.pop()
        notes.append(f"line {line}, the last, has only {len(cells)} cells and was left out")
    columns: dict[str, np.ndarray] = {}
    bad: dict[str, BadCell] = {}
    for line, cells in rows:
        if len(cells) != len(names):
            raise InvalidInput(
                f"line {line} has {len(cells)} cells, [column names] has {len(names)}; complete or "
                f"delete the line"
            )
    for k, name in enumerate(names):
        try:
            columns[name] = np.array([cells[k] for _, cells in rows], dtype=np.float64)
        except ValueError:
            sample = next(i for i, (_, cells) in enumerate(rows) if not is_number(cells[k]))
            bad[name] = BadCell(rows[sample][1][k], sample, rows[sample][0])
    if _TIME in columns:
        columns["time_s"] = _since_midnight(columns.pop(_TIME))
        names = ["time_s" if name == _TIME else name for name in names]
    units = _units(names, parts, notes)
    return Table(tuple(names), columns, bad, len(rows), units, notes=tuple(notes))


def _sections(text: str) -> tuple[dict[str, list[str]], int]:
    """Lines by section, and the number of the first line of data."""
    parts: dict[str, list[str]] = {}
    current: list[str] = []
    first_line = 1
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("[") and line.rstrip().endswith("]"):
            name = line.strip()[1:-1].lower()
            current = parts.setdefault(name, [])
            if name == "data":
                first_line = number + 1
        else:
            current.append(line)
    return parts, first_line


def _units(names: list[str], parts: dict[str, list[str]], notes: list[str]) -> dict[str, str]:
    units: dict[str, str] = {}
    titles = [line.strip() for line in parts.get("header", []) if line.strip()]
    ended = [title.rpartition(" ") for title in titles]
    if len(titles) == len(names):
        for name, (words, _, unit) in zip(names, ended, strict=True):
            if words and is_unit(unit):
                units[name] = unit
    elif titles:
        units = {words: unit for words, _, unit in ended if words in names and is_unit(unit)}
        notes.append(
            f"[header] has {len(titles)} titles for {len(names)} columns, so units are known only "
            f"of {', '.join(units) or 'none'} and of [channel units]; put factors of the others in "
            f"the channel map"
        )
    told = [line.strip() for line in parts.get("channel units", [])]
    while told and not told[-1]:
        told.pop()
    if 0 < len(told) < len(names):
        own = names[len(names) - len(told) :]
        units.update({n: u for n, u in zip(own, told, strict=True) if u})
    units.pop("time_s", None)
    return units


def _since_midnight(clock: np.ndarray) -> np.ndarray:
    hours, rest = np.divmod(clock, 10000.0)
    minutes, seconds = np.divmod(rest, 100.0)
    time_s = 3600.0 * hours + 60.0 * minutes + seconds
    days = np.cumsum(np.diff(time_s, prepend=time_s[:1]) < -0.5 * _DAY_S)
    result: np.ndarray = np.round(time_s + _DAY_S * days, 6)
    return result
