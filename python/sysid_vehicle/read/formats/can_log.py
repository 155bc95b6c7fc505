"""Logs of CAN frames with the car's database, by python-can and cantools.

Every message has its own times; a signal is called ``Message.Signal``, or by its own name where
only one message has it. A message that several buses carry, or several controllers of SAE J1939
send, has the bus or the sender before its name. A reading that the database names, such as "signal
not available", is no measurement.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..._common.files import read_bytes
from ...errors import InvalidInput
from ..recording import Entry, LeftOut, Recording, Signal
from .can_frames import Frame, frames_of
from .named import without_named

_BITS_OF_EXTENDED = 1 << 31
_BROADCAST = (
    240  # J1939: below, the second byte of an identifier is an address, no part of the group
)

Source = tuple[str, int]  # bus and identifier, with a bit for an extended one


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
    frames = Counter(_source(frame) for frame in frames_of(path, []))
    known = _known(messages, frames)
    if not frames:
        raise InvalidInput(
            f"{path}: holds no frame of data; check that it was recorded on the bus of the car, or "
            f"record it again"
        )
    if not known:
        first = ", ".join(hexadecimal(key) for (_, key), _ in frames.most_common(5))
        raise InvalidInput(
            f"{path}: none of its {len(frames)} kinds of frames ({first}, ...) is in {dbc.name}; "
            f"give the database of this bus"
        )
    entries, places = {}, {}
    for source, name in _names(known).items():
        for signal in known[source].signals:
            full = f"{name}.{signal.name}"
            entries[full] = Entry(signal.unit or "", name, signal.comment or "")
            places[full] = source, signal.name

    def fetch(names: list[str], notes: list[str]) -> dict[str, Signal]:
        wanted: dict[Source, dict[str, _Readings]] = {}
        for name in names:
            source, signal = places[name]
            wanted.setdefault(source, {})[signal] = _Readings()
        short, unknown = 0, 0
        for frame in frames_of(path, notes):
            asked = wanted.get(_source(frame))
            if asked is None:
                continue
            message = known[_source(frame)]
            decoded = _decoded(message, frame)
            if decoded is None:
                short += len(frame.data) < message.length
                unknown += len(frame.data) >= message.length
                continue
            for signal, readings in asked.items():
                if (value := decoded.get(signal)) is not None:  # multiplexed: not in every frame
                    readings.take(frame.time_s, value)
        if short:
            notes.append(
                f"{path.name}: {short} frames are shorter than {dbc.name} says and were left out; "
                f"check that it is the database of this car"
            )
        if unknown:
            notes.append(
                f"{path.name}: {unknown} frames have a multiplexer value that {dbc.name} does not "
                f"know and were left out; check that it is the database of this car"
            )
        return {
            name: wanted[places[name][0]][places[name][1]].signal(name, notes) for name in names
        }

    buses = len({bus for bus, _ in frames})
    unknown = [source for source, _ in frames.most_common() if source not in known]
    left = left_out_frames(
        [hexadecimal(key) for _, key in unknown], dbc, [bus for bus, _ in unknown] * (buses > 1)
    )
    return Recording(entries, fetch, left_out=left)


def left_out_frames(
    identifiers: Sequence[str], dbc: Path, buses: Sequence[str] = ()
) -> tuple[LeftOut, ...]:
    """Return what is told of frames that a database lacks, by their identifiers.

    Parameters
    ----------
    identifiers : sequence of str
        In the order in which they are told.
    dbc : Path
    buses : sequence of str, optional
        Of each identifier, where there are several.
    """
    kinds = buses or [""] * len(identifiers)
    names: dict[str, str] = {}
    for identifier, bus in zip(identifiers, kinds, strict=True):
        names[identifier] = f"{names[identifier]}, {bus}" if identifier in names else bus
    remedy = "if a channel is wanted of them, give the database that has it"
    return (LeftOut("CAN identifier", names, f"not in {dbc.name}", remedy),) if names else ()


def hexadecimal(key: int) -> str:
    """Return an identifier as databases and buses show it."""
    return f"0x{key & ~_BITS_OF_EXTENDED:X}"


@dataclass
class _Readings:
    """What is collected of one signal."""

    times: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    texts: dict[str, list[int]] = field(default_factory=dict)

    def take(self, time_s: float, value: Any) -> None:
        text = getattr(value, "name", None)  # of a value that the database names
        if text is not None:
            self.texts.setdefault(str(text), []).append(len(self.values))
            value = value.value
        self.times.append(time_s)
        self.values.append(value)

    def signal(self, name: str, notes: list[str]) -> Signal:
        values = np.array(self.values, dtype=np.float64)
        texts = {text: np.isin(np.arange(values.size), at) for text, at in self.texts.items()}
        return Signal(np.array(self.times), without_named(name, values, texts, notes))


def _decoded(message: Any, frame: Frame) -> dict[str, Any] | None:
    """Values by signal; None where the database does not explain the frame."""
    from cantools.database import DecodeError

    try:
        decoded: dict[str, Any] = message.decode(frame.data)
    except (DecodeError, ValueError):
        return None
    return decoded


def _database(dbc: Path) -> list[Any]:
    import cantools

    read_bytes(dbc, 1)  # one that is not there is no broken database
    try:
        return list(cantools.database.load_file(dbc).messages)
    except Exception as error:
        raise InvalidInput(
            f"{dbc}: cantools cannot read it as a CAN database ({type(error).__name__}: {error}); "
            f"give a .dbc, .arxml, .kcd or .sym file"
        ) from error


def _known(messages: list[Any], sources: Iterable[Source]) -> dict[Source, Any]:
    """The message of each source that the database has; of J1939 whoever sends it."""
    exact = {
        message.frame_id | (_BITS_OF_EXTENDED if message.is_extended_frame else 0): message
        for message in messages
    }
    groups = {_group(m.frame_id): m for m in messages if m.is_extended_frame and _is_j1939(m)}
    found = {}
    for source in sources:
        message = exact.get(source[1])
        if message is None and source[1] & _BITS_OF_EXTENDED:
            message = groups.get(_group(source[1]))
        if message is not None:
            found[source] = message
    return found


def _is_j1939(message: Any) -> bool:
    return bool(message.protocol == "j1939")


def _group(identifier: int) -> int:
    """The parameter group number of SAE J1939-21 in an extended identifier."""
    group = (identifier >> 8) & 0x3FFFF
    return group if (group >> 8) & 0xFF >= _BROADCAST else group & 0x3FF00


def _names(known: dict[Source, Any]) -> dict[Source, str]:
    """Names of messages by source, with bus or sender before them where one has several."""
    names = {}
    for source, message in known.items():
        same = [other for other, its in known.items() if its is message]
        parts = [source[0]] if len({bus for bus, _ in same}) > 1 else []
        if len({key for _, key in same}) > 1:
            parts.append(hexadecimal(source[1]))
        names[source] = ".".join([*parts, message.name])
    return names


def _source(frame: Frame) -> Source:
    return frame.bus, frame.identifier | (_BITS_OF_EXTENDED if frame.extended else 0)
