"""ASAM MDF 3 and 4, by asammdf: every group has its own times, every channel its unit.

Where the file holds raw CAN frames a database decodes them.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ..recording import Entry, Recording, Signal

_TIME = 1  # kind of a group's master channel, beside angle, distance and index


def read(path: Path, dbc: Path | None) -> Recording:
    """List the channels of a file; with a database, those of its frames."""
    _check_header(path)
    with _opened(path, dbc) as mdf:
        entries, places = _listed(mdf)
    if not entries:
        remedy = (
            "give the database of its frames, dbc='car.dbc'"
            if dbc is None
            else "check the database"
        )
        raise InvalidInput(f"{path}: holds no channel over time; {remedy}")

    def fetch(names: list[str], notes: list[str]) -> dict[str, Signal]:
        with _opened(path, dbc) as mdf:
            asked = [(None, *places[name]) for name in names]
            read = mdf.select(asked, ignore_value2text_conversions=True)
        return {name: _signal(name, signal) for name, signal in zip(names, read, strict=True)}

    return Recording(entries, fetch)


def _check_header(path: Path) -> None:
    """Refuse a file without its second block: asammdf would leave a half-made object behind."""
    with path.open("rb") as file:
        begin = file.read(68)
    if begin[64:66] != b"HD" and begin[64:68] != b"##HD":
        raise InvalidInput(
            f"{path}: begins as an ASAM MDF file, but its header block is missing; record it again"
        )


def _opened(path: Path, dbc: Path | None) -> Any:
    from asammdf import MDF

    mdf = MDF(path)
    if dbc is None:
        return mdf
    with mdf:
        return mdf.extract_bus_logging({"CAN": [(dbc, 0)]})


def _listed(mdf: Any) -> tuple[dict[str, Entry], dict[str, tuple[int, int]]]:
    found: list[tuple[str, str, Entry, tuple[int, int]]] = []
    for g, group in enumerate(mdf.groups):
        master = mdf.masters_db.get(g)
        if master is None or not _is_time(group.channels[master]):
            continue
        told = getattr(group.channel_group, "acq_name", None) or f"group {g}"
        for c, channel in enumerate(group.channels):
            if c != master:
                unit = mdf.get_channel_unit(group=g, index=c) or ""
                found.append((channel.name, told, Entry(unit, str(g), told), (g, c)))
    entries: dict[str, Entry] = {}
    places: dict[str, tuple[int, int]] = {}
    often = Counter(name for name, *_ in found)
    for name, told, entry, place in found:
        # The same channel may be in several groups; then both have the group's name before theirs.
        full = name if often[name] == 1 else f"{told}.{name}"
        full = full if full not in entries else f"group {place[0]}.{name}"
        entries[full], places[full] = entry, place
    return entries, places


def _is_time(channel: Any) -> bool:
    return int(getattr(channel, "sync_type", _TIME)) == _TIME


def _signal(name: str, read: Any) -> Signal:
    samples = np.asarray(read.samples)
    if samples.ndim != 1 or samples.dtype.kind not in "biuf":
        raise InvalidInput(f"{name}: holds {samples.dtype}, no numbers; map another channel")
    values = samples.astype(np.float64)
    if read.invalidation_bits is not None:
        values = np.where(np.asarray(read.invalidation_bits, dtype=bool), np.nan, values)
    return Signal(np.asarray(read.timestamps, dtype=np.float64), values)
