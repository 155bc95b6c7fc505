"""Bags of ROS 1 and ROS 2, by rosbags: no ROS is needed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ...errors import InvalidInput
from ..recording import Recording
from .messages import Taken, recording_of


def read(path: Path, dbc: Path | None) -> Recording:
    """List the numbers in the first message of each topic whose type is known."""
    if path.suffix == ".db3" and not (path.parent / "metadata.yaml").exists():
        raise InvalidInput(
            f"{path}: has no metadata.yaml beside it, which tells its topics; make it with "
            f"ros2 bag reindex {path.parent}"
        )
    firsts: list[tuple[str, Any]] = []
    with _opened(path) as reader:
        for connection in reader.connections:
            if connection.msgtype in reader.typestore.types:
                first = next(_messages(reader, [connection]), None)
                firsts += [] if first is None else [first[:2]]

    def messages(topics: list[str]) -> Iterator[Taken]:
        with _opened(path) as reader:
            yield from _messages(reader, [c for c in reader.connections if c.topic in topics])

    recording = recording_of(firsts, messages)
    if not recording.entries:
        raise InvalidInput(
            f"{path}: holds no message of a known type; record it with the definitions of its "
            f"messages (MCAP does)"
        )
    return recording


def _messages(reader: Any, connections: list[Any]) -> Iterator[Taken]:
    for connection, recorded_ns, raw in reader.messages(connections=connections):
        message = reader.deserialize(raw, connection.msgtype)
        yield connection.topic, message, recorded_ns, connection.id


def _opened(path: Path) -> Any:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    # A data file of a ROS 2 bag is read through the folder that describes it.
    folder = path.parent if path.suffix == ".db3" else path
    return AnyReader([folder], default_typestore=get_typestore(Stores.LATEST))
