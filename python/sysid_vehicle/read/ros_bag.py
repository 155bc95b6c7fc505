"""Bags of ROS 1 and ROS 2, by rosbags: no ROS is needed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..errors import InvalidInput
from ._messages import Getter, Topic, numbers, signals_of
from ._recording import Entry, Recording, Signal


def read(path: Path, dbc: Path | None) -> Recording:
    """List the numbers in the first message of each topic whose type is known."""
    entries: dict[str, Entry] = {}
    places: dict[str, tuple[str, str, Getter]] = {}
    with _opened(path) as reader:
        for connection in reader.connections:
            if connection.msgtype not in reader.typestore.types:
                continue
            for _, _, raw in reader.messages(connections=[connection]):
                topic, message = connection.topic, reader.deserialize(raw, connection.msgtype)
                for field, get in numbers(message):
                    entries[f"{topic}/{field}"] = Entry("", topic)
                    places[f"{topic}/{field}"] = topic, field, get
                break
    if not entries:
        raise InvalidInput(
            f"{path}: holds no message of a known type; record it with the definitions of its "
            f"messages (MCAP does)"
        )

    def fetch(names: list[str], notes: list[str]) -> dict[str, Signal]:
        topics: dict[str, Topic] = {}
        for name in names:
            topic, field, get = places[name]
            topics.setdefault(topic, Topic({})).getters[field] = get
        with _opened(path) as reader:
            wanted = [c for c in reader.connections if c.topic in topics]
            for connection, recorded_ns, raw in reader.messages(connections=wanted):
                message = reader.deserialize(raw, connection.msgtype)
                topics[connection.topic].take(message, recorded_ns)
        return signals_of(topics, notes)

    return Recording(entries, fetch)


def _opened(path: Path) -> Any:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    # A data file of a ROS 2 bag is read through the folder that describes it.
    folder = path.parent if path.suffix == ".db3" else path
    return AnyReader([folder], default_typestore=get_typestore(Stores.LATEST))
