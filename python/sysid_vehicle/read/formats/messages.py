"""Messages of ROS and their like: numbers by the path of their fields, times by their stamps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from operator import attrgetter, itemgetter
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ..recording import Entry, LeftOut, Recording, Signal

_MOST_ELEMENTS = 64  # of an array that are listed one by one: more are an image or a scan
_DEPTH = 8
YAW = "quaternion_yaw"
"""What the yaw angle of a quaternion is called below it."""
_HEADERS = ("header", "stamp")  # hold the time, no measurement
_STAMPS = ("timestamp",)  # of Foxglove's schemas; a number that is called so is a channel
_SECONDS = ("sec", "secs", "seconds")
_NANOSECONDS = ("nanosec", "nsec", "nsecs", "nanos")
_SAME_CLOCK_S = 1.0  # stamps that are farther from the recorder's time are of another clock

Getter = Callable[[Any], Any]
Taken = tuple[str, Any, int, int]  # topic, message, time of the recorder [ns], publisher


def numbers(message: Any, depth: int = _DEPTH) -> Iterator[tuple[str, Getter]]:
    """Yield path and getter of each number in a message, such as ``angular_velocity/z``."""
    for name, value, get in _fields(message):
        if name in _STAMPS and _first_part(value, _SECONDS) is not None:
            continue
        if isinstance(value, (bool, int, float, np.number, np.bool_)):
            yield name, get
        elif not isinstance(value, (str, bytes, type(None))) and depth > 0:
            if (yaw := _yaw_of(value)) is not None:
                yield f"{name}/{YAW}", _then(get, yaw)
            for path, inner in numbers(value, depth - 1):
                joint = "" if path.startswith("[") else "/"
                yield f"{name}{joint}{path}", _then(get, inner)


def _yaw_of(message: Any) -> Getter | None:
    """The angle by which a quaternion turns about z, anticlockwise [rad]; None of anything else."""
    parts = {name: get for name, _, get in _fields(message)}
    if {*parts} != {"x", "y", "z", "w"}:
        return None

    def yaw(turned: Any) -> float:
        x, y, z, w = (float(parts[part](turned)) for part in "xyzw")
        # Drivers that know no orientation send zeros.
        length = x * x + y * y + z * z + w * w
        return (
            math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z) if length else math.nan
        )

    return yaw


def _then(first: Getter, second: Getter) -> Getter:
    return lambda message: second(first(message))


def _fields(message: Any) -> Iterator[tuple[str, Any, Getter]]:
    """Name, present value and getter of each field of a message or element of an array."""
    found: list[tuple[str, Getter]]
    if isinstance(message, dict):
        found = [(str(key), itemgetter(key)) for key in message if key not in _HEADERS]
    elif hasattr(message, "DESCRIPTOR"):
        yield from _fields_of_protobuf(message)
        return
    elif isinstance(message, (list, tuple, np.ndarray)) or _is_repeated(message):
        n = len(message)
        found = [(f"[{k}]", itemgetter(k)) for k in range(n if n <= _MOST_ELEMENTS else 0)]
    else:
        fields = getattr(message, "__dataclass_fields__", None)
        names = fields if fields is not None else getattr(message, "__slots__", ())
        found = [
            (name, attrgetter(name))
            for name in names
            if not name.startswith("_") and name not in _HEADERS
        ]
    for name, get in found:
        yield name, get(message), get


def _is_repeated(message: Any) -> bool:
    """Tell whether this is a repeated field of Protocol Buffers; a map is none."""
    return hasattr(message, "MergeFrom") and not hasattr(message, "keys")


def _fields_of_protobuf(message: Any) -> Iterator[tuple[str, Any, Getter]]:
    """Fields by the schema: what the first message leaves unset may come in another.

    What is unset reads as zero in the library of Protocol Buffers; here it is missing.
    """
    for told in message.DESCRIPTOR.fields:
        name = told.name
        if name in _HEADERS:
            continue
        value = getattr(message, name)
        if not told.has_presence:
            yield name, value, attrgetter(name)
        elif message.HasField(name) or told.message_type is not message.DESCRIPTOR:
            yield name, value, _if_set(name)


def _if_set(name: str) -> Getter:
    return lambda message: getattr(message, name) if message.HasField(name) else None


def stamp_ns(message: Any) -> int:
    """Return the time at which a message was measured [ns]; 0 if it has none.

    It is the stamp of the header, or that of the message itself, or what Foxglove's schemas call
    ``timestamp``: seconds and nanoseconds each, as ROS or Protocol Buffers call them.
    """
    for stamp in (
        _part(_part(message, "header"), "stamp"),
        _part(message, "stamp"),
        *(_part(message, name) for name in _STAMPS),
    ):
        seconds = _first_part(stamp, _SECONDS)
        if seconds is not None:
            return int(seconds) * 10**9 + int(_first_part(stamp, _NANOSECONDS) or 0)
    return 0


def _first_part(stamp: Any, names: tuple[str, ...]) -> Any:
    return next((part for name in names if (part := _part(stamp, name)) is not None), None)


def _part(message: Any, name: str) -> Any:
    return message.get(name) if isinstance(message, dict) else getattr(message, name, None)


@dataclass
class Topic:
    """What is collected of one topic: times [ns] and the values of some paths."""

    getters: dict[str, Getter]
    stamps: list[int] = field(default_factory=list)
    recorded: list[int] = field(default_factory=list)
    values: dict[str, list[float]] = field(default_factory=dict)
    publishers: dict[int, tuple[int, int]] = field(default_factory=dict)  # first and last times
    texts: dict[str, list[str]] = field(default_factory=dict)  # that stand in place of numbers

    def take(self, message: Any, recorded_ns: int, publisher: int) -> None:
        """Take one message."""
        first, last = self.publishers.get(publisher, (recorded_ns, recorded_ns))
        self.publishers[publisher] = min(first, recorded_ns), max(last, recorded_ns)
        self.stamps.append(stamp_ns(message))
        self.recorded.append(recorded_ns)
        for path, get in self.getters.items():
            try:
                value = float(get(message))
            except (AttributeError, IndexError, KeyError, TypeError):
                # An array may be shorter now, or a field unset.
                value = np.nan
            except ValueError:
                self.texts.setdefault(path, []).append(str(get(message)))
                value = np.nan
            self.values.setdefault(path, []).append(value)


def recording_of(
    firsts: Iterable[tuple[str, Any]],
    messages: Callable[[list[str]], Iterator[Taken]],
    left_out: tuple[LeftOut, ...] = (),
) -> Recording:
    """Return the numbers in the first message of each topic as channels.

    Parameters
    ----------
    firsts : iterable of tuple
        Topic and first message.
    messages : callable
        Yields all messages of some topics, with the times at which they were recorded.
    left_out : tuple of LeftOut
        Topics that nothing decodes.
    """
    places = {
        f"{topic}/{path}": (topic, path, get)
        for topic, message in firsts
        for path, get in numbers(message)
    }

    def fetch(names: list[str], notes: list[str]) -> dict[str, Signal]:
        topics: dict[str, Topic] = {}
        for name in names:
            topic, path, get = places[name]
            topics.setdefault(topic, Topic({})).getters[path] = get
        for topic, message, recorded_ns, publisher in messages(list(topics)):
            topics[topic].take(message, recorded_ns, publisher)
        return _signals_of(topics, notes)

    entries = {
        name: Entry("rad" if path.endswith(f"/{YAW}") else "", topic)
        for name, (topic, path, _) in places.items()
    }
    return Recording(entries, fetch, left_out=left_out)


def _signals_of(topics: dict[str, Topic], notes: list[str]) -> dict[str, Signal]:
    """Return the collected signals by ``topic/path``, times from the first stamp of all on.

    Raises
    ------
    InvalidInput
        If topics have stamps of different clocks.
    """
    times, offsets = {}, {}
    for name, topic in topics.items():
        spans = sorted(topic.publishers.values())
        if any(begin < end for (_, end), (begin, _) in pairwise(spans)):
            notes.append(
                f"{name}: {len(spans)} publishers send it at the same time, and their messages are "
                f"mixed; record them under topics of their own"
            )
        notes += [
            f"{name}/{path}: text in place of a number in {len(texts)} message(s), first "
            f"'{texts[0]}'; they count as missing: check the sensor"
            for path, texts in topic.texts.items()
        ]
        recorded, stamps = np.array(topic.recorded), np.array(topic.stamps)
        stamped = stamps > 0
        if stamped.any() and not stamped.all():
            notes.append(
                f"{name}: {np.count_nonzero(~stamped)} of {stamps.size} messages without stamp, "
                f"first message {int(np.argmin(stamped))}, and were left out; stamp the messages "
                f"where they are measured"
            )
            recorded, stamps = recorded[stamped], stamps[stamped]
            topic.values = {p: list(np.array(v)[stamped]) for p, v in topic.values.items()}
        elif stamps.size and not stamped.any():
            notes.append(
                f"{name}: its messages have no stamps, so the times are those of the recorder, "
                f"which come late; stamp the messages where they are measured"
            )
        times[name] = stamps if stamped.any() else recorded
        offsets[name] = float(np.median(times[name] - recorded)) * 1e-9 if stamps.size else 0.0
    apart = sorted(offsets, key=lambda name: offsets[name])
    if apart and offsets[apart[-1]] - offsets[apart[0]] > _SAME_CLOCK_S:
        raise InvalidInput(
            f"{apart[0]} and {apart[-1]}: their stamps are of different clocks "
            f"({offsets[apart[0]]:.4g} and {offsets[apart[-1]]:.4g} s from the recorder's); stamp "
            f"both with one clock"
        )
    begin = min((int(t[0]) for t in times.values() if t.size), default=0)
    return {
        f"{name}/{path}": Signal((times[name] - begin) * 1e-9, np.array(values))
        for name, topic in topics.items()
        for path, values in topic.values.items()
    }
