"""Reading logs of any format and any column names into canonical logs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .._common.files import as_path
from .._common.typed import typed
from ..errors import warn
from ..log import Columns, Log
from ..log.build import build
from ..vehicle import Vehicle
from .formats.csv import read_table
from .formats.objects import contents_of_object
from .long_table import recording_of_long
from .mapping.channel_map import ChannelMap
from .mapping.ground import Ground
from .mapping.proposal import Proposal
from .mapping.propose import propose_channels
from .mapping.source import Source
from .mapping.taken import Taken
from .recording import Recording
from .registry import FORMATS, Format, located, read_with, recognised
from .table import Table

__all__ = [
    "FORMATS",
    "ChannelMap",
    "Format",
    "Ground",
    "Proposal",
    "Source",
    "propose_channels",
    "read_log",
]

_OF_FRAMES = ("can_log", "mdf")  # modules of formats that may hold CAN frames


@typed
def read_log(
    source: str | Path | Columns,
    channels: str | Path | Mapping[str, Any] | ChannelMap | None = None,
    *,
    dbc: str | Path | None = None,
    name: str | None = None,
    check: bool = True,
    vehicle: Vehicle | None = None,
) -> Log:
    """Read a driving log from a file of any known format, or from what is in memory.

    Formats are recognised by what a file begins with: CSV in its dialects (MoTeC's and AiM's among
    them), VBOX, MATLAB, HDF5, Parquet, Arrow, ASAM MDF, MCAP, ROS bags, and logs of CAN frames.
    Where a format has a time for each channel, each keeps its own samples: the log has a row for
    every time, and what is not sampled then is missing there.

    Parameters
    ----------
    source : str, Path or table
        The file, or the folder of a ROS 2 bag. In text the first line names the columns; an empty
        cell or ``nan`` is a missing measurement, lines that begin with ``#`` are comments, a second
        line may state units, times may be ISO 8601 stamps. Long tables, with a row for each
        reading and a column of the channels' names, are read too. In memory: a dict of arrays, or
        of pairs of times [s] and values; a table of pandas, polars or Arrow; a data set of xarray.
    channels : str, Path, mapping or ChannelMap, optional
        Channel map for a log with other names or units: a TOML file, the content of its
        ``[channels]`` table, or the map itself. Units that the file states are converted where the
        map gives no factor.
    dbc : str or Path, optional
        Database of the CAN frames that the file holds.
    name : str, optional
        Name of the run; the file name without its suffix otherwise, ``log`` for a table.
    check, vehicle
        As in :meth:`Log.from_arrays`.

    Raises
    ------
    InvalidInput
        If the file, the channel map or the data cannot be used; the message names the file, the
        channel, the sample or line, and the remedy. If a library is absent it names the extra that
        brings it.

    Warns
    -----
    SysidWarning
        If the data can be used but something was corrected or looks implausible.
    """
    if channels is None:
        mapping = ChannelMap({})
    elif isinstance(channels, ChannelMap):
        mapping = channels
    elif isinstance(channels, Mapping):
        mapping = ChannelMap.from_dict(channels)
    else:
        mapping = ChannelMap.from_toml(channels)
    is_path = isinstance(source, (str, Path))
    path = as_path(source) if is_path else None
    run = name if name is not None else "log" if path is None else path.stem
    entry = None if path is None else recognised(path)
    where = run if path is None else str(path)
    notes: list[str] = []
    with located(where, entry=entry):
        table = contents(source, dbc, entry)
        if isinstance(table, Recording):
            table = mapping.rows_of(table, notes)
    with located(where):
        columns = mapping.apply(table, notes)
    for note in notes:
        warn(f"{run}: {note}")
    despike = mapping.despiked
    worded = Taken(mapping.factors(table)).beside
    with located(where, run):
        built = build(columns, run, despike, check, vehicle, worded=worded)
    return Log(run, built.rate_hz, built.uniform, built.channels)


def contents(
    source: str | Path | Columns, dbc: str | Path | None, entry: Format | None
) -> Table | Recording:
    """Return what a file or an object holds, under its own names."""
    held = _held(source, dbc, entry)
    long = recording_of_long(held) if isinstance(held, Table) else None
    return held if long is None else long


def _held(
    source: str | Path | Columns, dbc: str | Path | None, entry: Format | None
) -> Table | Recording:
    if not isinstance(source, (str, Path)):
        return contents_of_object(source)
    if dbc is not None and (entry is None or entry.module not in _OF_FRAMES):
        warn(f"{as_path(source).stem}: holds no CAN frames; {dbc} is not used")
    if entry is None:
        return read_table(source)
    return read_with(entry, Path(source), None if dbc is None else as_path(dbc))
