"""CSV as MoTeC i2 and AiM Race Studio export it: lines about the session, names, units, numbers."""

from __future__ import annotations

import csv
from pathlib import Path

from ...errors import InvalidInput
from ..table import Table
from .csv import table_of_text
from .text import read_text_table

_FEWEST = 2  # cells that have a name


def read(path: Path, dbc: Path | None) -> Table:
    """Read a file; the column of the time, wherever it stands, is called ``time_s``."""
    lines = read_text_table(path).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    mark = max(",;\t", key=lines[0].count)
    for k, line in enumerate(lines):
        cells = _cells(line, mark)
        if (
            cells
            and cells[0].strip().lower() == "time"
            and len(cells) >= _FEWEST
            and all(cells[:2])
        ):
            # A line of the session has the hour behind that word; the columns have the most cells.
            width = max(len(_cells(other, mark)) for other in lines[k + 1 : k + 6])
            if len(cells) == width:
                break
    else:
        raise InvalidInput(
            f"{path}: has no line of column names with Time; export the channels too"
        )
    names = ["time_s", *cells[1:]]
    header = mark.join('"' + name.replace('"', '""') + '"' for name in names)
    # Lines before the columns are comments, so that messages give lines as an editor counts them.
    return table_of_text(
        "\n".join(["#"] * k + [header, *_without_blank(lines[k + 1 :])]), units_row=True
    )


def _cells(line: str, mark: str) -> list[str]:
    return next(csv.reader([line], delimiter=mark), [])


def _without_blank(lines: list[str]) -> list[str]:
    """Empty the lines that hold nothing but quotes and what stands between cells."""
    return [line if line.strip('",; \t') else "" for line in lines]
