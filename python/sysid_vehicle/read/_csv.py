"""Reading a CSV file into columns, with the line number of whatever is not a number."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .._files import read_text
from ..errors import InvalidInput


@dataclass(frozen=True)
class Table:
    """Columns of a CSV file; cells that are no numbers are noted by line, not yet an error."""

    names: tuple[str, ...]
    columns: dict[str, npt.NDArray[np.float64]]
    not_numbers: dict[str, tuple[str, int, int]]
    n: int

    def column(self, name: str) -> npt.NDArray[np.float64]:
        """Return one column.

        Raises
        ------
        InvalidInput
            If it holds a cell that is not a number, or if several columns have this name.
        """
        if self.names.count(name) > 1:
            raise InvalidInput(
                f"{name}: {self.names.count(name)} columns have this name; rename or delete one"
            )
        if name in self.not_numbers:
            cell, line, sample = self.not_numbers[name]
            raise InvalidInput(
                f"{name}: '{cell}' in line {line} (sample {sample}) is not a number; correct the "
                f"cell, or empty it for a missing measurement"
            )
        return self.columns[name]


def read_table(path: str | Path) -> Table:
    """Read a CSV file whose first line names the columns (comma, semicolon or tab between).

    Raises
    ------
    InvalidInput
        If the file cannot be read, has no header or no rows, or a row has the wrong length.
    """
    text = read_text(path).replace("\r\n", "\n").replace("\r", "\n")
    header, _, body = text.partition("\n")
    delimiter = max(",;\t", key=header.count)
    _, cells = next(_rows(header, delimiter, 1), (1, []))
    names = tuple(name.strip() for name in cells)
    if not any(names):
        raise InvalidInput("the first line is empty; it must hold the column names")
    if all(_is_number(name) for name in names):
        raise InvalidInput(
            f"the first line holds numbers ({', '.join(names[:3])}, ...); put a line with the "
            f"column names before it"
        )
    if not body.strip():
        raise InvalidInput("there are no rows below the column names; record the log again")
    # With semicolons or tabs between cells a comma inside a cell is a decimal comma.
    if delimiter != "," and "," in body:
        body = body.replace(",", ".")
    fast = _read_fast(body, delimiter, names)
    return fast if fast is not None else _read_slow(body, delimiter, names)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _unique(names: tuple[str, ...]) -> Collection[str]:
    return dict.fromkeys(names)


def _read_fast(body: str, delimiter: str, names: tuple[str, ...]) -> Table | None:
    """Read a body of numbers only; None if anything else is in it."""
    try:
        values = np.loadtxt(
            io.StringIO(body), delimiter=delimiter, comments=None, quotechar='"', ndmin=2
        )
    except ValueError:
        return None
    if values.shape[1] != len(names):
        return None
    columns = {name: np.ascontiguousarray(values[:, names.index(name)]) for name in _unique(names)}
    return Table(names, columns, {}, values.shape[0])


def _rows(text: str, delimiter: str, first_line: int) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each row; `first_line` is the number of the first line in a file."""
    reader = csv.reader(io.StringIO(text), delimiter=delimiter)
    try:
        for row in reader:
            yield reader.line_num + first_line - 1, row
    except csv.Error as error:
        raise InvalidInput(
            f"line {reader.line_num + first_line - 1}: not a CSV row ({error}); close its quotes, "
            f"or export the file as text"
        ) from error


def _read_slow(body: str, delimiter: str, names: tuple[str, ...]) -> Table:
    rows: list[list[str]] = []
    lines: list[int] = []
    for line, row in _rows(body, delimiter, 2):
        if not row or not any(cell.strip() for cell in row):
            continue
        if len(row) != len(names):
            raise InvalidInput(
                f"line {line} has {len(row)} cells, the header has {len(names)}; "
                f"complete or delete the line"
            )
        rows.append(row)
        lines.append(line)
    columns, not_numbers = {}, {}
    for name, cells in zip(names, zip(*rows, strict=True), strict=True):
        try:
            values = np.array([float(cell) if cell.strip() else np.nan for cell in cells])
        except ValueError:
            first = next(k for k, c in enumerate(cells) if c.strip() and not _is_number(c))
            not_numbers[name] = (cells[first].strip(), lines[first], first)
        else:
            columns[name] = values
    return Table(names, columns, not_numbers, len(rows))
