"""Logs of CAN frames with the car's database, by python-can and cantools.

Every message has its own times; a signal is called ``Message.Signal``, or by its own name where
only one message has it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ..recording import Entry, Recording, Signal

_BITS_OF_EXTENDED = 1 << 31


def read(path: Path, dbc: Path | None) -> Recording:
    """List the signals of the database whose messages are in the log.

    Raises
    ------
    InvalidInput
        If no database is given, or if it knows none of the frames.
    """
    if dbc is None:
        raise InvalidInput(
            f"{path}: is a CAN log, whose frames only the car's database explains; give it: "
            f"read_log(path, dbc='car.dbc'), or --dbc car.dbc on the command line"
        )
    messages = _database(dbc)
    frames = Counter(_key(frame) for frame in _frames(path))
    known = {key: message for key, message in messages.items() if key in frames}
    if not known:
        first = ", ".join(f"0x{key & ~_BITS_OF_EXTENDED:X}" for key, _ in frames.most_common(5))
        raise InvalidInput(
            f"{path}: none of its {len(frames)} kinds of frames ({first or 'there are none'}, ...) "
            f"is in {dbc.name}; give the database of this bus"
        )
    entries, places = {}, {}
    for key, message in known.items():
        for signal in message.signals:
            full = f"{message.name}.{signal.name}"
            entries[full] = Entry(signal.unit or "", message.name, signal.comment or "")
            places[full] = key, signal.name

    def fetch(names: list[str], notes: list[str]) -> dict[str, Signal]:
        wanted: dict[int, list[str]] = {}
        for name in names:
            wanted.setdefault(places[name][0], []).append(name)
        times: dict[str, list[float]] = {name: [] for name in names}
        values: dict[str, list[float]] = {name: [] for name in names}
        short = 0
        for frame in _frames(path):
            asked = wanted.get(_key(frame))
            if asked is None:
                continue
            try:
                decoded = known[_key(frame)].decode(bytes(frame.data), decode_choices=False)
            except ValueError:  # cantools' DecodeError: too few bytes
                short += 1
                continue
            for name in asked:
                value = decoded.get(places[name][1])
                if value is not None:  # multiplexed signals are not in every frame
                    times[name].append(frame.timestamp)
                    values[name].append(value)
        if short:
            notes.append(
                f"{path.name}: {short} frames are shorter than {dbc.name} says and were left out; "
                f"check that it is the database of this car"
            )
        return {n: Signal(np.array(times[n]), np.array(values[n], dtype=np.float64)) for n in names}

    return Recording(entries, fetch)


def _database(dbc: Path) -> dict[int, Any]:
    import cantools

    try:
        database = cantools.database.load_file(dbc)
    except Exception as error:
        raise InvalidInput(
            f"{dbc}: cantools cannot read it as a CAN database ({type(error).__name__}: {error}); "
            f"give a .dbc, .arxml, .kcd or .sym file"
        ) from error
    return {
        message.frame_id | (_BITS_OF_EXTENDED if message.is_extended_frame else 0): message
        for message in database.messages
    }


def _key(frame: Any) -> int:
    return int(frame.arbitration_id) | (_BITS_OF_EXTENDED if frame.is_extended_id else 0)


def _frames(path: Path) -> Iterator[Any]:
    import can

    with can.LogReader(path) as reader:
        for frame in reader:
            if not frame.is_error_frame and not frame.is_remote_frame:
                yield frame
