"""Parquet, by pyarrow: columns, and units where the fields' metadata have them."""

from __future__ import annotations

from pathlib import Path

from ..table import Table, table_of


def read(path: Path, dbc: Path | None) -> Table:
    """Read a Parquet file."""
    from pyarrow import parquet

    return table_of(parquet.ParquetFile(path).read())
