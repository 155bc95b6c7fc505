"""MCAP with messages of ROS 2, JSON or Protocol Buffers, by mcap and its decoders.

A file that was not finished, as the recorder was switched off, has no index: what is whole of it is
read from its beginning on.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

from ...errors import InvalidInput
from ..recording import LeftOut, Recording, Signal
from .messages import Taken, recording_of

_PROTOBUF = "protobuf"
_LONGEST = 80  # characters that are told of a message that a decoder refuses

Held = tuple[Any, Any, Any]  # schema, channel, message


def read(path: Path, dbc: Path | None) -> Recording:
    """List the numbers in the first message of each topic."""
    factories = _decoders()
    decoders: dict[int, Callable[[bytes], Any] | None] = {}
    unread: dict[str, str] = {}

    def decoder(schema: Any, channel: Any) -> Callable[[bytes], Any] | None:
        if channel.id not in decoders:
            encoding = channel.message_encoding
            found = json.loads if encoding == "json" else None
            for factory in () if found else factories:
                found = found or factory.decoder_for(encoding, schema)
            decoders[channel.id] = found
            if found is None:
                unread[channel.topic] = _kind(encoding, schema)
        return decoders[channel.id]

    indexed = _topics(path)
    firsts: dict[str, Any] = {}

    def take(schema: Any, channel: Any, message: Any) -> None:
        try:
            if (decode := decoder(schema, channel)) is not None:
                firsts[channel.topic] = decode(message.data)
        except Exception as error:  # of whatever library: the other topics are read
            unread[channel.topic] = f"{type(error).__name__}: {error}"[:_LONGEST]

    if indexed is None:
        for held in _from_beginning(path, None)[0]:
            if held[1].topic not in firsts and held[1].topic not in unread:
                take(*held)
    else:
        for topic in indexed:
            for held in islice(_by_index(path, [topic]), 1):
                take(*held)

    refused: dict[str, list[str]] = {}

    def messages(topics: list[str]) -> Iterator[Taken]:
        refused.clear()
        held = _by_index(path, topics) if indexed is not None else _from_beginning(path, topics)[0]
        for schema, channel, message in held:
            if (decode := decoder(schema, channel)) is None:
                continue
            try:
                decoded = decode(message.data)
            except Exception as error:  # of whatever library: the other messages are read
                told = f"{type(error).__name__}: {error}"[:_LONGEST]
                refused.setdefault(channel.topic, []).append(told)
                continue
            yield channel.topic, decoded, message.log_time, channel.id

    left = _left_out(unread)
    recording = recording_of(firsts.items(), messages, left)
    if not recording.entries and left:
        raise InvalidInput(f"{path}: holds no message that can be read; {left[0]}")
    if not recording.entries:
        raise InvalidInput(
            f"{path}: is an MCAP file, but holds no whole message with numbers; mend it with mcap "
            f"recover, or record it again"
        )
    unfinished = indexed is None and _from_beginning(path, [])[1]

    def fetch(names: list[str], notes: list[str]) -> dict[str, Signal]:
        if unfinished:
            notes.append(
                f"{path.name}: was not finished; the messages that are whole were read: mend it "
                f"with mcap recover to keep the end"
            )
        signals = dict(recording.fetch(names, notes))
        notes += [
            f"{topic}: {len(told)} message(s) that cannot be decoded were left out ({told[0]}); "
            f"check what sends them"
            for topic, told in refused.items()
        ]
        return signals

    return replace(recording, fetch=fetch)


def _decoders() -> list[Any]:
    """Decoders of the libraries that are there; an older set-up lacks that of Protocol Buffers."""
    import mcap_ros2.decoder

    found: list[Any] = [mcap_ros2.decoder.DecoderFactory()]
    with suppress(ImportError):
        import mcap_protobuf.decoder

        found.append(mcap_protobuf.decoder.DecoderFactory())
    return found


def _kind(encoding: str, schema: Any) -> str:
    """What is told of the messages of a topic that nothing decodes."""
    if schema is None or not schema.encoding or schema.encoding == encoding:
        return encoding
    return f"{encoding} by {schema.encoding}"


def _left_out(unread: dict[str, str]) -> tuple[LeftOut, ...]:
    if not unread:
        return ()
    remedy = (
        "record ROS 2, JSON or protobuf messages, or decode them with their library and give "
        "read_log a dict of pairs of times and values"
    )
    if set(unread.values()) == {_PROTOBUF}:
        remedy = "pip install mcap-protobuf-support"
    elif _PROTOBUF in unread.values():
        remedy = f"for {_PROTOBUF} pip install mcap-protobuf-support, else {remedy}"
    return (LeftOut("topic", unread, "as nothing here decodes the messages", remedy),)


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
