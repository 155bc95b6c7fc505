"""MCAP with messages of ROS 2 or JSON, by mcap and mcap-ros2-support.

A file that was not finished, as the recorder was switched off, has no index: what is whole of it is
read from its beginning on.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...errors import InvalidInput
from ..recording import Recording, Signal
from .messages import Taken, recording_of

Held = tuple[Any, Any, Any]  # schema, channel, message


def read(path: Path, dbc: Path | None) -> Recording:
    """List the numbers in the first message of each topic."""
    import mcap_ros2.decoder

    ros2 = mcap_ros2.decoder.DecoderFactory()
    decoders: dict[int, Callable[[bytes], Any] | None] = {}
    unread: set[str] = set()

    def decoder(schema: Any, channel: Any) -> Callable[[bytes], Any] | None:
        if channel.id not in decoders:
            encoding = channel.message_encoding
            found = json.loads if encoding == "json" else ros2.decoder_for(encoding, schema)
            decoders[channel.id] = found
            if found is None:
                unread.add(encoding if schema is None else f"{encoding} by {schema.encoding}")
        return decoders[channel.id]

    indexed = _topics(path)
    firsts: dict[str, Any] = {}
    if indexed is None:
        for schema, channel, message in _from_beginning(path, None)[0]:
            if channel.topic not in firsts and (decode := decoder(schema, channel)) is not None:
                firsts[channel.topic] = decode(message.data)
    else:
        for topic in indexed:
            for schema, channel, message in _by_index(path, [topic]):
                if (decode := decoder(schema, channel)) is not None:
                    firsts[topic] = decode(message.data)
                break

    def messages(topics: list[str]) -> Iterator[Taken]:
        held = _by_index(path, topics) if indexed is not None else _from_beginning(path, topics)[0]
        for schema, channel, message in held:
            if (decode := decoder(schema, channel)) is not None:
                yield channel.topic, decode(message.data), message.log_time, channel.id

    recording = recording_of(firsts.items(), messages)
    if not recording.entries and unread:
        raise InvalidInput(
            f"{path}: holds no message that can be read, only of encoding "
            f"{', '.join(sorted(unread))}; record ROS 2 or JSON messages, or decode them with "
            f"their library and give read_log a dict of pairs of times and values"
        )
    if not recording.entries:
        raise InvalidInput(
            f"{path}: is an MCAP file, but holds no whole message with numbers; mend it with mcap "
            f"recover, or record it again"
        )
    if indexed is not None or not _from_beginning(path, [])[1]:
        return recording

    def fetch(names: list[str], notes: list[str]) -> dict[str, Signal]:
        notes.append(
            f"{path.name}: was not finished; the messages that are whole were read: mend it with "
            f"mcap recover to keep the end"
        )
        return dict(recording.fetch(names, notes))

    return replace(recording, fetch=fetch)


def _topics(path: Path) -> list[str] | None:
    """The topics of a file, from its index; None where it has none."""
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    try:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
    except (McapError, ValueError):
        return None
    if summary is None or not summary.channels:
        return None
    return list(dict.fromkeys(channel.topic for channel in summary.channels.values()))


def _by_index(path: Path, topics: list[str]) -> Iterator[Held]:
    from mcap.reader import make_reader

    with path.open("rb") as file:
        yield from make_reader(file).iter_messages(topics=topics)


def _from_beginning(path: Path, topics: list[str] | None) -> tuple[list[Held], bool]:
    """Messages of some topics, or of all, by their times, and whether the file breaks off."""
    from mcap.records import Channel, Message, Schema
    from mcap.stream_reader import StreamReader

    schemas: dict[int, Any] = {}
    channels: dict[int, Any] = {}
    held: list[Held] = []
    broken = False
    with path.open("rb") as file:
        records = iter(StreamReader(file).records)
        while True:
            try:
                record = next(records)
            except StopIteration:
                break
            except Exception:  # whatever the rest of a record makes of the library
                broken = True
                break
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message) and record.channel_id in channels:
                channel = channels[record.channel_id]
                if topics is None or channel.topic in topics:
                    held.append((schemas.get(channel.schema_id), channel, record))
    return sorted(held, key=lambda h: int(h[2].log_time)), broken
