"""Reading a CSV file into columns, with the line number of whatever is not a number."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ..._common.arrays import FloatArray
from ...errors import InvalidInput
from ...log import seconds_of_stamps
from ..table import BadCell, Table
from ..units import is_unit, states_nothing
from .text import read_text_table

_DELIMITERS = ",;\t|"
_NUMBER_WITH = r"(?:^|[{0}\n])\s*\"?([+-]?\d*{1}\d+(?:[eE][+-]?\d+)?)\"?\s*(?=[{0}\n]|$)"
_DIGITS = re.compile(r"\W{0,2}\d[\d.,' ]*([eEdD][+-]?\d+)?\W?")
# What programs write for a measurement that is missing: R, SQL, spreadsheets, Windows, loggers.
_MISSING = {"na", "n/a", "#n/a", "#na", "#nv", "null", "none", "nil", "-", "--", "---",
            "1.#qnan", "-1.#ind", "1.#ind"}  # fmt: skip
_LAST_ROWS = 20  # that tell how many cells a row has
_MOST_BELOW = 3  # lines below them: one that breaks off, or text
_FEWEST_CELLS = 3
_LONGEST_PREAMBLE = 100
_MOST_LINES_OF_TEXT = 5  # below the first one: sensors, descriptions, units, types
_ANNOTATIONS = ("#datatype", "#group", "#default")  # of InfluxDB, which repeats names by design
_UNITLESS = {"-", "--", "---"}  # a line of units may hold nothing else


def read_table(path: str | Path) -> Table:
    """Read a CSV file whose first line names the columns.

    Between them is a comma, semicolon, tab or bar, or blanks where there is none of these. Lines
    that begin with ``#`` are comments; where only they come before the numbers the last of them
    names the columns. So are lines of another form before the one with the names. A line of units
    below is kept with the columns; of other lines of text above the numbers, such as sensors above
    their signals, the names are the one whose cells differ most.

    Raises
    ------
    InvalidInput
        If the file cannot be read, has no header or no rows, or a row has the wrong length.
    """
    return table_of_text(read_text_table(path))


def table_of_text(text: str, *, units_row: bool | None = None) -> Table:
    """Read the text of a CSV file; `units_row` tells whether the second line states units.

    Raises
    ------
    InvalidInput
        As :func:`read_table`.
    """
    text = _blanks_as_tabs(text.replace("\r\n", "\n").replace("\r", "\n"))
    annotated = text.startswith(_ANNOTATIONS)
    header, body, first_line = _split(text)
    delimiter = max(_DELIMITERS, key=header.count)
    _, cells = next(_rows(header, delimiter, 1), (1, []))
    names = tuple(name.strip() for name in cells)
    if not any(names):
        if not any(line.strip() and not line.startswith("#") for line in text.split("\n")):
            held = "nothing but comments and empty lines" if text.strip() else "nothing"
            raise InvalidInput(f"the file holds {held}; record or export the log again")
        raise InvalidInput("the first line is empty; it must hold the column names")
    if all(is_number(name) for name in names):
        raise InvalidInput(
            f"the first line holds numbers ({', '.join(names[:3])}, ...); put a line with the "
            f"column names before it"
        )
    lead, body = _lines_of_text(body, delimiter, len(names), first_line, units_row)
    names, units, others = _names_and_units(names, lead, units_row)
    first_line += len(lead)
    if not body.strip():
        raise InvalidInput("there are no rows below the column names; record the log again")
    if delimiter != "," and "," in body:
        body = _with_points(body, delimiter, first_line)
    table = _read_fast(body, delimiter, names, units)
    table = table or _read_slow(body, delimiter, names, units, first_line, annotated)
    notes = [
        f"the line '{delimiter.join(cells)[:60]}' above the numbers holds neither the names "
        f"of the columns nor their units, and was left out"
        for cells in others
    ]
    return replace(table, notes=(*table.notes, *notes))


def _blanks_as_tabs(text: str) -> str:
    """Return text whose cells are numbers with blanks between them with tabs in their place."""
    lines = text.split("\n")
    last = _even_rows(lines, str.split)
    if not last:
        return text
    if any(mark in line for line in last for mark in _DELIMITERS):
        return text
    if not all(is_number(cell) for cell in last[-1].split()):
        return text
    return "\n".join(
        ("# " if line.startswith("#") else "") + "\t".join(line.lstrip("#").split())
        for line in lines
    )


def _with_points(body: str, delimiter: str, first_line: int) -> str:
    """Return the body with decimal points: with other marks between cells a comma is a decimal one.

    Raises
    ------
    InvalidInput
        If numbers have points too, as then one of both separates thousands.
    """
    if "." not in body:
        return body.replace(",", ".")
    comma = re.search(_NUMBER_WITH.format(delimiter, ","), body)
    if comma is None:
        return body
    point = re.search(_NUMBER_WITH.format(delimiter, r"\."), body)
    if point is not None:
        k, text = min((m.start(1), m[1]) for m in (comma, point))
        other = comma[1] if text == point[1] else point[1]
        raise InvalidInput(
            f"line {first_line + body.count(chr(10), 0, k)} holds '{text}', and '{other}' stands "
            f"there or below: commas and points cannot both be decimal; export the file without "
            f"separators of thousands"
        )
    return body.replace(",", ".")


def _split(text: str) -> tuple[str, str, int]:
    """Return header, body and the number of the body's first line; comments become empty lines."""
    lines = text.split("\n")
    header, at = "", 0
    while at < len(lines) and lines[at].startswith("#"):
        at += 1
    if at < len(lines):
        header = lines[at]
    if 0 < at < len(lines):
        named = lines[at - 1].lstrip("# ")
        delimiter = max(_DELIMITERS, key=header.count)
        numbers = all(is_number(cell) for cell in header.split(delimiter) if cell.strip())
        if numbers and header.strip() and named.count(delimiter) == header.count(delimiter):
            header, at = named, at - 1
    ahead = _preamble(lines[at:])
    header, at = lines[at + ahead] if ahead else header, at + ahead
    rest = lines[at + 1 :]
    if any(line.startswith("#") for line in rest):
        rest = ["" if line.startswith("#") else line for line in rest]
    return header, "\n".join(rest), at + 2


def _preamble(lines: list[str]) -> int:
    """Lines about the log before the one that names the columns; 0 where that is the first.

    The names have as many cells as the rows at the end of the file, and are no numbers.
    """
    if len(lines) < 2 * _LAST_ROWS:
        return 0
    for delimiter in ";\t|,":  # a comma between others is one of decimals
        last = _even_rows(lines, partial(_cells, delimiter=delimiter))
        if not last:
            continue
        width = len(_cells(last[0], delimiter))
        for k, line in enumerate(lines[:_LONGEST_PREAMBLE]):
            named = _cells(line, delimiter)
            filled = sum(bool(cell.strip()) for cell in named)
            if len(named) == width < 2 * filled and not any(map(is_number, named)):
                above = _cells(lines[k - 1], delimiter) if k else []
                sensors = len(above) == width and any(above) and len({*named}) < width
                return k - 1 if sensors else k
    return 0


def _even_rows(lines: list[str], cells: Callable[[str], list[str]]) -> list[str]:
    """The last rows, all of one width; none where they have several, or too few cells."""
    last = [line for line in lines[-_LAST_ROWS:] if line.strip()]
    widths = [len(cells(line)) for line in last]
    for end in range(len(last), max(len(last) - _MOST_BELOW, 1) - 1, -1):
        if len({*widths[:end]}) == 1 and widths[0] >= _FEWEST_CELLS:
            return last[:end]
    return []


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:  # is told of where the rows are read
        return []


def _lines_of_text(
    body: str, delimiter: str, width: int, first_line: int, told_so: bool | None
) -> tuple[list[tuple[str, ...]], str]:
    """Take the lines without a number or a time off the body, and return their cells."""
    lead: list[tuple[str, ...]] = []
    while len(lead) < _MOST_LINES_OF_TEXT:
        row, _, rest = body.partition("\n")
        try:
            _, cells = next(_rows(row, delimiter, first_line), (first_line, []))
        except InvalidInput:  # is told of where the rows are read
            break
        told = [cell.strip() for cell in cells if cell.strip()]
        if len(cells) != width or any(map(_is_reading, told)):
            break
        units = [cell for cell in told if is_unit(cell)]
        if not (told_so or all(map(states_nothing, units)) or 2 * len(units) > len(told)):
            break  # of units that are mostly unknown the reader is told
        if all(cell.lower() in _MISSING - _UNITLESS for cell in told):
            break
        lead.append(tuple(cell.strip() for cell in cells))
        body = rest
    return lead, body


def _is_reading(cell: str) -> bool:
    """Tell whether a cell is a number, in whatever notation, or a time."""
    alike = is_number(cell) or _DIGITS.fullmatch(cell) is not None
    return alike or seconds_of_stamps([cell]) is not None


def _is_remark(row: Sequence[str]) -> bool:
    """Tell whether a row holds text and no reading: what a logger writes when it ends."""
    told = [cell.strip() for cell in row if cell.strip()]
    return not any(map(_is_reading, told)) and any(c.lower() not in _MISSING for c in told)


def _names_and_units(
    names: tuple[str, ...], lead: list[tuple[str, ...]], told_so: bool | None
) -> tuple[tuple[str, ...], dict[str, str], list[tuple[str, ...]]]:
    """Tell names and units from the other lines of text above the numbers.

    Units are mostly known ones, or stand in the first line below the names where it is told so.
    """
    lead = [cells for cells in lead if cells[1:] != names[1:]]  # the first may be renamed
    is_units = [2 * sum(map(is_unit, c)) > sum(map(bool, c)) for c in lead]
    if told_so and lead and not any(is_units):
        is_units[0] = True
    at = is_units.index(True) if any(is_units) else None
    texts = [names, *(cells for k, cells in enumerate(lead) if k != at)]
    named = own = max(texts, key=lambda cells: len({*cells} - {""}))
    above = next((cells for cells in texts if cells is not own), None)
    if above is not None and len({*own}) == len(own):
        above = None
    if above is not None:  # of signals with one name the sensor tells
        groups, last = [], ""
        for cell in above:
            last = cell or last
            groups.append(last)
        own = tuple(
            f"{group}.{name}" if group and own.count(name) > 1 else name
            for group, name in zip(groups, own, strict=True)
        )
    stated = () if at is None else lead[at]
    units = {name: unit for name, unit in zip(own, stated, strict=False) if unit}
    return own, units, [cells for cells in texts if cells not in (named, above)]


def is_number(text: str) -> bool:
    """Whether a cell holds a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _read_fast(
    body: str, delimiter: str, names: tuple[str, ...], units: dict[str, str]
) -> Table | None:
    """Read a body of numbers only; None if anything else is in it."""
    try:
        values = np.loadtxt(
            io.StringIO(body), delimiter=delimiter, comments=None, quotechar='"', ndmin=2
        )
    except ValueError:
        return None
    if values.shape[1] != len(names):
        return None
    first = {name: k for k, name in reversed(list(enumerate(names)))}
    columns = {name: np.ascontiguousarray(values[:, first[name]]) for name in dict.fromkeys(names)}
    return Table(names, columns, {}, values.shape[0], units)


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


def _read_slow(
    body: str,
    delimiter: str,
    names: tuple[str, ...],
    units: dict[str, str],
    first_line: int,
    annotated: bool,
) -> Table:
    # A logger that begins anew, or files that were joined.
    heads = {names, tuple(units.get(name, "") for name in names)} - {("",) * len(names)}
    notes: list[str] = []
    rows, lines, repeated = _full_rows(body, delimiter, names, heads, first_line, notes)
    columns, not_numbers, seconds, texts = {}, {}, {}, {}
    for name, cells in zip(names, zip(*rows, strict=True), strict=True):
        try:
            values = _floats(cells)
        except ValueError:
            first = next(k for k, c in enumerate(cells) if c.strip() and not is_number(c))
            not_numbers[name] = BadCell(cells[first].strip(), first, lines[first])
            stamps = seconds_of_stamps(cells)
            if stamps is not None:
                seconds[name] = stamps
            else:
                texts[name] = cells
        else:
            columns[name] = values
    notes += [
        f"line {line} repeats column names or units and was left out; read logs that were joined "
        f"one by one"
        for line in repeated[:1]
        if not annotated
    ]
    return Table(names, columns, not_numbers, len(rows), units, seconds, tuple(notes), texts)


def _full_rows(
    body: str,
    delimiter: str,
    names: tuple[str, ...],
    heads: set[tuple[str, ...]],
    first_line: int,
    notes: list[str],
) -> tuple[list[list[str]], list[int], list[int]]:
    """Rows with a cell for each name, their lines, and the lines that repeat one of `heads`."""
    rows: list[list[str]] = []
    lines: list[int] = []
    repeated: list[int] = []
    last = first_line + body.rstrip().count("\n")
    for line, row in _rows(body, delimiter, first_line):
        if not row or not any(cell.strip() for cell in row):
            continue
        if tuple(cell.strip() for cell in row) in heads:
            repeated.append(line)
            continue
        if len(row) == len(names) + 1 and not row[-1].strip():  # a mark behind the last cell
            del row[-1]
        elif len(row) == len(names) - 1 and not names[-1]:  # only behind the last name
            row.append("")
        if len(row) < len(names) and line == last and rows:
            notes.append(f"line {line}, the last, has only {len(row)} cells and was left out")
            continue
        if len(row) != len(names):
            raise InvalidInput(
                f"line {line} has {len(row)} cells, the header has {len(names)}; "
                f"complete or delete the line"
            )
        rows.append(row)
        lines.append(line)
    while len(rows) > 1 and _is_remark(rows[-1]) and not _is_remark(rows[0]):
        notes.append(f"line {lines[-1]} at the end holds text and no reading, and was left out")
        del rows[-1], lines[-1]
    if not rows:
        raise InvalidInput(
            "there are only empty cells below the column names; record the log again"
        )
    return rows, lines, repeated


def _floats(cells: Sequence[str]) -> FloatArray:
    """The numbers of a column, NaN where a cell is empty or says that there is none."""
    try:
        return np.array([float(cell) if cell.strip() else np.nan for cell in cells])
    except ValueError:
        missing = [not cell.strip() or cell.strip().lower() in _MISSING for cell in cells]
        if all(missing):
            raise
        return np.array([np.nan if m else float(c) for c, m in zip(cells, missing, strict=True)])
