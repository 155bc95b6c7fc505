"""ASAM MDF 3 and 4, by asammdf: every group has its own times, every channel its unit.

Where the file holds raw CAN frames a database decodes them; they come beside its other channels.
Elements of an array are channels, called ``Name[0]``; text and structures are none. A reading to
which the file gives a name in place of a number, such as "signal not available", is no measurement.
"""

from __future__ import annotations

import gc
import sys
import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ..recording import Entry, LeftOut, Recording, Signal
from ..units import factor_to
from .can_log import hexadecimal, left_out_frames
from .named import without_named

_TIME = 1  # kind of a group's master channel, beside angle, distance and index
# Types of data that are integers and floats, of any byte order, by the version of the format.
_OF_NUMBERS = {3: (*range(4), *range(9, 17)), 4: tuple(range(6))}
_RAW_FRAMES = ("CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame", "CAN_OverloadFrame")
_VALUE_TO_TEXT, _RANGE_TO_TEXT = 7, 8  # types of conversions, of which some values may be numbers
_MOST_ELEMENTS = 64  # of an array that are channels

_BYTES = {3: (8,), 4: (10, 11, 12)}  # of no meaning to anyone else; what is left is text or dates

Place = tuple[int, int, int, int | None]  # which of the files, group, channel, element of an array


def read(path: Path, dbc: Path | None) -> Recording:
    """List the channels of a file; with a database, those of its frames too."""
    _check_header(path)
    with _opened(path, dbc) as files:
        entries, places, no_numbers, frames = _listed(files)
        unknown = _unknown(files[0]) if dbc is not None else []
    if not entries and frames and dbc is None:
        raise InvalidInput(
            f"{path}: holds no channel over time; if it holds CAN frames, give the car's database: "
            f"read_log(path, dbc='car.dbc'), or --dbc car.dbc on the command line"
        )
    if not entries:
        raise InvalidInput(
            f"{path}: holds no channel over time; "
            + ("record it again" if dbc is None else f"check the database {dbc}")
        )
    left: tuple[LeftOut, ...] = ()
    if no_numbers:
        remedy = "record as numbers what is wanted of them"
        left = (LeftOut("channel", no_numbers, "without numbers over time", remedy),)
    if dbc is not None:
        left += left_out_frames(unknown, dbc)
    elif frames:
        remedy = "--dbc car.dbc, or read_log(path, dbc='car.dbc'), reads their channels"
        left += (LeftOut("group", frames, "as only a database tells what CAN frames hold", remedy),)

    def fetch(names: list[str], notes: list[str]) -> dict[str, Signal]:
        found = {}
        with _opened(path, dbc) as files:
            for k, mdf in enumerate(files):
                own = [name for name in names if places[name][0] == k]
                asked = [(None, *places[name][1:3]) for name in own]
                read = mdf.select(asked, ignore_value2text_conversions=True) if own else []
                for name, signal in zip(own, read, strict=True):
                    found[name] = _signal(mdf, name, places[name], signal, notes)
        return found

    return Recording(entries, fetch, left_out=left)


def _check_header(path: Path) -> None:
    """Refuse a file without its second block: asammdf would leave a half-made object behind."""
    with path.open("rb") as file:
        begin = file.read(68)
    if begin[64:66] != b"HD" and begin[64:68] != b"##HD":
        raise InvalidInput(
            f"{path}: begins as an ASAM MDF file, but its header block is missing; record it again"
        )


@contextmanager
def _opened(path: Path, dbc: Path | None) -> Iterator[list[Any]]:
    """The file, and with a database what that decodes of its frames."""
    from asammdf import MDF

    try:
        mdf = MDF(path)
    except Exception as error:
        _forget(error)
        raise
    with mdf:
        if dbc is None:
            yield [mdf]
        else:
            with mdf.extract_bus_logging({"CAN": [(dbc, 0)]}) as decoded:
                yield [mdf, decoded]


def _unknown(mdf: Any) -> list[str]:
    """Identifiers of frames that the database lacks."""
    told = mdf.last_call_info["CAN"]["unknown_ids"]
    return [hexadecimal(key[0] if isinstance(key, tuple) else key) for key in sorted(told)]


def _forget(error: Exception) -> None:
    """Delete the half-made object of a broken file here, where what it writes then is not heard."""
    told, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        traceback.clear_frames(error.__traceback__)
        gc.collect()
    finally:
        sys.unraisablehook = told


def _listed(
    files: list[Any],
) -> tuple[dict[str, Entry], dict[str, Place], dict[str, str], dict[str, str]]:
    """Channels with their places; then, by name, channels of no numbers and groups of frames."""
    found: list[tuple[str, str, Entry, Place]] = []
    no_numbers: dict[str, str] = {}
    frames: dict[str, str] = {}
    for k, mdf in enumerate(files):
        version = 4 if mdf.version >= "4" else 3
        for g, group in enumerate(mdf.groups):
            told = getattr(group.channel_group, "acq_name", None) or f"group {g}"
            if any(channel.name in _RAW_FRAMES for channel in group.channels):
                frames[told] = ""
                continue
            master = mdf.masters_db.get(g)
            over_time = master is not None and _is_time(group.channels[master])
            there = {channel.name for channel in group.channels}
            for c, channel in enumerate(group.channels):
                kind = int(channel.data_type)
                if c == master:
                    continue
                if not over_time or kind not in _OF_NUMBERS[version]:
                    what = "bytes" if kind in _BYTES[version] else "text"
                    if not group.channel_dependencies[c]:
                        no_numbers[channel.name] = what if over_time else "without a time"
                    continue
                unit = mdf.get_channel_unit(group=g, index=c) or ""
                entry = Entry(unit, f"{k}.{g}", told)
                for name, element in _parts(channel, group.channel_dependencies[c], there):
                    found.append((name, told, entry, (k, g, c, element)))
    entries: dict[str, Entry] = {}
    places: dict[str, Place] = {}
    often = Counter(name for name, *_ in found)
    for name, told, entry, place in found:
        # The same channel may be in several groups; then both have the group's name before theirs.
        full = name if often[name] == 1 else f"{told}.{name}"
        full = full if full not in entries else f"group {place[1]}.{name}"
        entries[full], places[full] = entry, place
    return entries, places, no_numbers, frames


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
    _, group, channel, element = place
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
