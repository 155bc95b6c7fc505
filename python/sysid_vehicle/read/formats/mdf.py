"""ASAM MDF 3 and 4, by asammdf: every group has its own times, every channel its unit.

Where the file holds raw CAN frames a database decodes them. Elements of an array are channels,
called ``Name[0]``; text and structures are none. A reading to which the file gives a name in place
of a number, such as "signal not available", is no measurement.
"""

from __future__ import annotations

import gc
import sys
import traceback
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ..recording import Entry, Recording, Signal
from ..units import factor_to
from .named import without_named

_TIME = 1  # kind of a group's master channel, beside angle, distance and index
# Types of data that are integers and floats, of any byte order, by the version of the format.
_OF_NUMBERS = {3: (*range(4), *range(9, 17)), 4: tuple(range(6))}
_RAW_FRAMES = ("CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame", "CAN_OverloadFrame")
_VALUE_TO_TEXT, _RANGE_TO_TEXT = 7, 8  # types of conversions, of which some values may be numbers
_MOST_ELEMENTS = 64  # of an array that are channels

Place = tuple[int, int, int | None]  # group, channel, element of an array


def read(path: Path, dbc: Path | None) -> Recording:
    """List the channels of a file; with a database, those of its frames."""
    _check_header(path)
    with _opened(path, dbc) as mdf:
        entries, places = _listed(mdf)
    if dbc is None and all(name.startswith(_RAW_FRAMES) for name in entries):
        raise InvalidInput(
            f"{path}: holds no channel over time; if it holds CAN frames, give the car's database: "
            f"read_log(path, dbc='car.dbc'), or --dbc car.dbc on the command line"
        )
    if not entries:
        raise InvalidInput(f"{path}: holds no channel over time; check the database {dbc}")

    def fetch(names: list[str], notes: list[str]) -> dict[str, Signal]:
        with _opened(path, dbc) as mdf:
            asked = [(None, *places[name][:2]) for name in names]
            read = mdf.select(asked, ignore_value2text_conversions=True)
            return {
                name: _signal(mdf, name, places[name], signal, notes)
                for name, signal in zip(names, read, strict=True)
            }

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

    try:
        mdf = MDF(path)
    except Exception as error:
        _forget(error)
        raise
    if dbc is None:
        return mdf
    with mdf:
        return mdf.extract_bus_logging({"CAN": [(dbc, 0)]})


def _forget(error: Exception) -> None:
    """Delete the half-made object of a broken file here, where what it writes then is not heard."""
    told, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        traceback.clear_frames(error.__traceback__)
        gc.collect()
    finally:
        sys.unraisablehook = told


def _listed(mdf: Any) -> tuple[dict[str, Entry], dict[str, Place]]:
    found: list[tuple[str, str, Entry, Place]] = []
    of_numbers = _OF_NUMBERS[4 if mdf.version >= "4" else 3]
    for g, group in enumerate(mdf.groups):
        master = mdf.masters_db.get(g)
        if master is None or not _is_time(group.channels[master]):
            continue
        told = getattr(group.channel_group, "acq_name", None) or f"group {g}"
        there = {channel.name for channel in group.channels}
        for c, channel in enumerate(group.channels):
            if c == master or int(channel.data_type) not in of_numbers:
                continue
            unit = mdf.get_channel_unit(group=g, index=c) or ""
            for name, element in _parts(channel, group.channel_dependencies[c], there):
                found.append((name, told, Entry(unit, str(g), told), (g, c, element)))
    entries: dict[str, Entry] = {}
    places: dict[str, Place] = {}
    often = Counter(name for name, *_ in found)
    for name, told, entry, place in found:
        # The same channel may be in several groups; then both have the group's name before theirs.
        full = name if often[name] == 1 else f"{told}.{name}"
        full = full if full not in entries else f"group {place[0]}.{name}"
        entries[full], places[full] = entry, place
    return entries, places


def _parts(channel: Any, within: Any, there: set[str]) -> list[tuple[str, int | None]]:
    """Names of what is a number in a channel: itself, or the elements of an array."""
    if within:
        if isinstance(within[0], tuple):  # a structure, whose members are channels too
            return []
        if within[0].dims != 1 or within[0].dim_size_0 > _MOST_ELEMENTS:
            return []
        names = [(f"{channel.name}[{k}]", k) for k in range(within[0].dim_size_0)]
        return [(name, k) for name, k in names if name not in there]
    return [(channel.name, None)]


def _is_time(channel: Any) -> bool:
    return int(getattr(channel, "sync_type", _TIME)) == _TIME


def _signal(mdf: Any, name: str, place: Place, read: Any, notes: list[str]) -> Signal:
    group, channel, element = place
    samples = np.asarray(read.samples)
    if element is not None and samples.dtype.names:
        samples = samples[samples.dtype.names[0]][:, element]
    if samples.ndim != 1 or samples.dtype.kind not in "biuf":
        raise InvalidInput(f"{name}: holds {samples.dtype}, no numbers; map another channel")
    values = samples.astype(np.float64)
    if read.invalidation_bits is not None:
        values = np.where(np.asarray(read.invalidation_bits, dtype=bool), np.nan, values)
    conversion = mdf.groups[group].channels[channel].conversion
    if getattr(conversion, "conversion_type", None) in (_VALUE_TO_TEXT, _RANGE_TO_TEXT):
        raw = np.asarray(mdf.get(group=group, index=channel, raw=True).samples)
        if raw.shape == values.shape:
            values = without_named(name, values, _texts(conversion, raw), notes)
    master = mdf.get_channel_unit(group=group, index=mdf.masters_db[group]) or ""
    time_s = np.asarray(read.timestamps, dtype=np.float64) * (factor_to("s", master) or 1.0)
    return Signal(time_s, values)


def _texts(conversion: Any, raw: np.ndarray) -> dict[str, np.ndarray]:
    """Where each text stands in place of a number, by that text."""
    found: dict[str, np.ndarray] = {}
    for k in range(len(conversion.referenced_blocks)):
        text = conversion.referenced_blocks.get(f"text_{k}")
        if isinstance(text, bytes):
            if conversion.conversion_type == _VALUE_TO_TEXT:
                here = raw == conversion[f"val_{k}"]
            else:
                here = (raw >= conversion[f"lower_{k}"]) & (raw <= conversion[f"upper_{k}"])
            word = text.decode("utf-8", errors="replace").strip("\0 ")
            found[word] = found.get(word, np.zeros(raw.size, dtype=bool)) | here
    return found
