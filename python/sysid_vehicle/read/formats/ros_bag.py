"""Bags of ROS 1 and ROS 2, by rosbags: no ROS is needed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..._common.files import read_bytes
from ...errors import InvalidInput
from ..recording import LeftOut, Recording
from .messages import Taken, recording_of


def read(path: Path, dbc: Path | None) -> Recording:
    """List the numbers in the first message of each topic whose type is known."""
    if path.is_file() and path.suffix != ".db3" and read_bytes(path, 6) == b"SQLite":
        raise InvalidInput(
            f"{path}: is an SQLite data base, but no ROS bag, whose files are called .db3; give "
            f"read_log the table that pandas reads from it: pandas.read_sql('SELECT * FROM ...', "
            f"sqlite3.connect(path))"
        )
    if path.suffix == ".db3" and not (path.parent / "metadata.yaml").exists():
        raise InvalidInput(
            f"{path}: has no metadata.yaml beside it, which tells its topics; make it with "
            f"ros2 bag reindex {path.parent}"
        )
    firsts: list[tuple[str, Any]] = []
    unread: dict[str, str] = {}
    with _opened(path) as reader:
        for connection in reader.connections:
            if connection.msgtype in reader.typestore.types:
                first = next(_messages(reader, [connection]), None)
                firsts += [] if first is None else [first[:2]]
            elif connection.msgcount:
                unread[connection.topic] = connection.msgtype

    def messages(topics: list[str]) -> Iterator[Taken]:
        with _opened(path) as reader:
            yield from _messages(reader, [c for c in reader.connections if c.topic in topics])

    remedy = (
        "record with the definitions of the messages (ros2 bag record -s mcap), or turn the bag "
        "into MCAP where these are installed (ros2 bag convert)"
    )
    why = "as the bag does not define the messages and they are not of ROS itself"
    left = (LeftOut("topic", unread, why, remedy),) if unread else ()
    recording = recording_of(firsts, messages, left)
    if not recording.entries:
        told = f"; {left[0]}" if left else f"; {remedy}"
        raise InvalidInput(f"{path}: holds no message of a known type{told}")
    return recording


def _messages(reader: Any, connections: list[Any]) -> Iterator[Taken]:
    for connection, recorded_ns, raw in reader.messages(connections=connections):
        message = reader.deserialize(raw, connection.msgtype)
        yield connection.topic, message, recorded_ns, connection.id


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    # A data file of a ROS 2 bag is read through the folder that describes it.
    folder = path.parent if path.suffix == ".db3" else path
    reader = AnyReader([folder], default_typestore=get_typestore(Stores.LATEST))
    try:
        reader.open()
    except AnyReaderError as error:
        parts = sorted(folder.glob("*.mcap"))
        if not parts:
            raise
        raise InvalidInput(
            f"{path}: is a ROS bag, but rosbags cannot read it ({error}); give read_log its file "
            f"{parts[-1]}, which is read as far as it is whole, or mend that with mcap recover"
        ) from error
    try:
        yield reader
    finally:
        reader.close()
