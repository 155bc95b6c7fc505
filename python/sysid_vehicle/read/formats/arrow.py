"""Arrow files and Feather, by pyarrow: columns, and units where the fields' metadata have them."""

from __future__ import annotations

from pathlib import Path

from ..table import Table, table_of


def read(path: Path, dbc: Path | None) -> Table:
    """Read an Arrow file."""
    from pyarrow import feather

    return table_of(feather.read_table(path))
