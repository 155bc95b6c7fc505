"""Reading log files of any column names into canonical logs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import InvalidInput, warn
from ..log import Columns, Log
from ._channel_map import ChannelMap, Source
from ._csv import read_table
from ._table import table_of

__all__ = ["ChannelMap", "Source", "read_log"]


def read_log(
    path: str | Path | Columns,
    channels: str | Path | Mapping[str, Any] | ChannelMap | None = None,
    *,
    name: str | None = None,
    check: bool = True,
) -> Log:
    """Read a driving log from a CSV file, or from columns in memory under other names.

    Parameters
    ----------
    path : str, Path or table
        File whose first line names the columns. An empty cell or ``nan`` is a missing measurement.
        Lines that begin with ``#`` are comments, a second line may state units, times may be ISO
        8601 stamps. A dict of arrays or a table (pandas, polars, Arrow) is taken as it is.
    channels : str, Path, mapping or ChannelMap, optional
        Channel map for a file with other column names or units: a TOML file, the content of its
        ``[channels]`` table, or the map itself.
    name : str, optional
        Name of the run; the file name without its suffix otherwise, ``log`` for a table.
    check : bool
        As in :meth:`Log.from_arrays`.

    Returns
    -------
    Log

    Raises
    ------
    InvalidInput
        If the file, the channel map or the data cannot be used; the message names the channel, the
        sample or line, and the remedy.

    Warns
    -----
    SysidWarning
        If the data can be used but something was mended or looks doubtful.
    """
    if channels is None:
        mapping = ChannelMap({})
    elif isinstance(channels, ChannelMap):
        mapping = channels
    elif isinstance(channels, Mapping):
        mapping = ChannelMap.from_dict(channels)
    else:
        mapping = ChannelMap.from_toml(channels)
    run = name if name is not None else Path(path).stem if isinstance(path, (str, Path)) else "log"
    notes: list[str] = []
    try:
        table = read_table(path) if isinstance(path, (str, Path)) else table_of(path)
        columns = mapping.apply(table, notes)
    except InvalidInput as error:
        raise InvalidInput(f"{run}: {error}") from error
    for note in notes:
        warn(f"{run}: {note}")
    return Log.from_arrays(columns, name=run, despike=mapping.despiked, check=check)
