"""Arrow files, streams and Feather, by pyarrow: columns, and units in the fields' metadata."""

from __future__ import annotations

from pathlib import Path

from ..table import Table, table_of

STREAM = b"\xff\xff\xff\xff"


def read(path: Path, dbc: Path | None) -> Table:
    """Read an Arrow file or stream."""
    from pyarrow import feather, ipc

    with path.open("rb") as file:
        if file.read(len(STREAM)) == STREAM:
            file.seek(0)
            return table_of(ipc.open_stream(file).read_all())
    return table_of(feather.read_table(path))
