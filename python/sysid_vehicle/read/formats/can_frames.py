"""Frames of a CAN log, whatever program wrote it; which one is told by how the file begins."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InvalidInput
from .text import read_text_table

_BLF = b"LOGG"
# Of candump -l and -L; then what it prints by itself, with times of -t a, z, A or d, or with none.
_LOGGED = re.compile(r"\((\d+\.\d+)\) +(\S+) +([0-9A-F]+)#(#[0-9A-F])?([0-9A-F.]*)( +[RT])?", re.I)
_PRINTED = re.compile(
    r"(?:\((?P<time>[^()]+)\) +)?(?P<bus>[a-z]\w*) +(?:[RT]X [-BE ]+ )?"
    r"(?P<id>[0-9A-F]{3}|[0-9A-F]{8}) +\[\d+\] *(?P<data>(?: ?[0-9A-F]{2})*)(?: +'.*')?",
    re.I,
)
_EVENT = re.compile(r"(\s*)(\d+\.\d+)(\s.*)", re.S)
_RELATIVE = re.compile(r"^base\s+(hex|dec)\s+timestamps\s+relative", re.M | re.I)
_HEADER = 2000  # characters that hold the header of a file
_FIRST = 1000  # frames that tell whether times are differences
_EXTENDED_DIGITS = 8


@dataclass(frozen=True)
class Frame:
    """One frame of data, `time_s` on the clock of the log [s], `bus` as the log numbers it."""

    time_s: float
    bus: str
    identifier: int
    extended: bool
    data: bytes


def frames_of(path: Path, notes: list[str]) -> Iterator[Frame]:
    """Yield the frames of data of a log, in its order.

    Raises
    ------
    InvalidInput
        If the frames have no times of their own.
    """
    with path.open("rb") as file:
        begin = file.read(len(_BLF))
    if begin == _BLF:
        import can

        with can.BLFReader(path) as reader:
            yield from _of_library(reader, first_bus=1)
            if reader.file_size > path.stat().st_size:
                notes.append(
                    f"{path.name} breaks off: it holds {path.stat().st_size} of the "
                    f"{reader.file_size} bytes that it states; what is there was read"
                )
        return
    text = _whole_lines(path, read_text_table(path), notes)
    first = next((line.strip() for line in text.splitlines() if line.strip()), "")
    if _LOGGED.fullmatch(first) or _PRINTED.fullmatch(first):
        yield from _of_candump(path, text, notes)
    else:
        yield from _of_text(text)


def _whole_lines(path: Path, text: str, notes: list[str]) -> str:
    """Leave out a last line without an end: half a frame may read as a whole one."""
    last = text[text.rfind("\n") + 1 :]
    if not any(character.isdigit() for character in last):  # nothing, or the end of a block
        return text
    notes.append(
        f"{path.name} breaks off in line {text.count(chr(10)) + 1}, which was left out: check that "
        f"the recording was not cut off"
    )
    return text[: len(text) - len(last)]


def _of_text(text: str) -> Iterator[Frame]:
    import can

    if text.startswith("timestamp,"):
        yield from _of_library(can.CSVReader(io.StringIO(text)), first_bus=1)
    elif text.lstrip().startswith(";"):
        yield from _of_library(can.TRCReader(io.StringIO(text)), first_bus=0)
    else:
        text = _absolute(text) if _RELATIVE.search(text[:_HEADER]) else text
        yield from _of_library(can.ASCReader(io.StringIO(text)), first_bus=1)


def _of_library(reader: Any, first_bus: int) -> Iterator[Frame]:
    """Yield what a reader of python-can does; `first_bus` is how the log numbers its channel 0."""
    for frame in reader:
        if not frame.is_error_frame and not frame.is_remote_frame:
            bus = frame.channel
            yield Frame(
                float(frame.timestamp),
                f"bus {bus + first_bus}" if isinstance(bus, int) else str(bus or "bus"),
                int(frame.arbitration_id),
                bool(frame.is_extended_id),
                bytes(frame.data),
            )


def _absolute(text: str) -> str:
    """Count the times of an ASC log on; each is that since the event in the line before."""
    now = 0.0
    lines = []
    for line in text.splitlines(keepends=True):
        event = _EVENT.fullmatch(line)
        if event is not None:
            now += float(event[2])
            line = f"{event[1]}{now:.9f}{event[3]}"
        lines.append(line)
    return "".join(lines)


def _of_candump(path: Path, text: str, notes: list[str]) -> Iterator[Frame]:
    lines = text.splitlines()
    found = _parsed(path, lines, notes)
    first = list(islice(found, _FIRST))
    steps = np.diff([frame.time_s for frame in first])
    # Rising times span at least half of their number times the usual step; differences do not.
    if steps.size > 1 and steps.sum() <= 0.5 * steps.size * float(np.median(np.abs(steps))):
        raise InvalidInput(
            f"{path}: the times of its frames are differences (candump -t d); record it with "
            f"candump -L"
        )
    yield from first
    yield from found


def _parsed(path: Path, lines: list[str], notes: list[str]) -> Iterator[Frame]:
    broken: list[int] = []
    for number, line in enumerate(lines, 1):
        line = line.strip()
        if logged := _LOGGED.fullmatch(line):
            time, bus, identifier, _, data = logged.groups()[:5]
        elif printed := _PRINTED.fullmatch(line):
            time, bus, identifier, data = printed.group("time", "bus", "id", "data")
            if time is None:
                raise InvalidInput(f"{path}: its frames have no times; record with candump -L")
        else:
            if line and not line.upper().rstrip(" RT").endswith(("#R", "REMOTE REQUEST")):
                broken.append(number)
            continue
        digits = re.sub(r"[ .]", "", data)
        if len(digits) % 2:
            broken.append(number)
            continue
        extended = len(identifier) == _EXTENDED_DIGITS
        yield Frame(_seconds(time), bus, int(identifier, 16), extended, bytes.fromhex(digits))
    if broken:
        notes.append(
            f"{path.name}: {len(broken)} lines hold no whole frame, first line {broken[0]}; they "
            f"were left out: check that the recording was not cut off"
        )


def _seconds(time: str) -> float:
    """Seconds of what candump prints: a number, or a date with the time of day."""
    if "-" not in time:
        return float(time)
    day, clock = time.split()
    stamp = np.datetime64(f"{day}T{clock}", "ns") - np.datetime64(0, "ns")
    return float(stamp / np.timedelta64(1, "s"))
