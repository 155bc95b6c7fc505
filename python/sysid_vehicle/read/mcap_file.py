"""MCAP with messages of ROS 2 or JSON, by mcap and mcap-ros2-support."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..errors import InvalidInput
from ._messages import Getter, Topic, numbers, signals_of
from ._recording import Entry, Recording, Signal


def read(path: Path, dbc: Path | None) -> Recording:
    """List the numbers in the first message of each topic."""
    entries: dict[str, Entry] = {}
    places: dict[str, tuple[str, str, Getter]] = {}
    unread = {}
    with path.open("rb") as file:
        reader = _reader(file)
        summary = reader.get_summary()
        channels = summary.channels.values() if summary is not None else ()
        for channel in channels:
            if channel.message_encoding not in ("cdr", "json"):
                unread[channel.topic] = channel.message_encoding
                continue
            for topic, message, _ in _messages(reader, [channel.topic]):
                for field, get in numbers(message):
                    entries[f"{topic}/{field}"] = Entry("", topic)
                    places[f"{topic}/{field}"] = topic, field, get
                break
    if not entries:
        held = f" of encoding {', '.join(sorted(set(unread.values())))}" if unread else ""
        raise InvalidInput(
            f"{path}: holds no readable message{held or ', or no index'}; record ROS 2 or JSON "
            f"messages, or mend the file with mcap recover"
        )

    def fetch(names: list[str], notes: list[str]) -> dict[str, Signal]:
        topics: dict[str, Topic] = {}
        for name in names:
            topic, field, get = places[name]
            topics.setdefault(topic, Topic({})).getters[field] = get
        with path.open("rb") as file:
            for topic, message, recorded_ns in _messages(_reader(file), list(topics)):
                topics[topic].take(message, recorded_ns)
        return signals_of(topics, notes)

    return Recording(entries, fetch)


def _reader(file: Any) -> Any:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    return make_reader(file, decoder_factories=[_Json(), DecoderFactory()])


def _messages(reader: Any, topics: list[str]) -> Iterator[tuple[str, Any, int]]:
    for _, channel, record, message in reader.iter_decoded_messages(topics=topics):
        yield channel.topic, message, record.log_time


class _Json:
    """Decodes messages that are JSON."""

    def decoder_for(self, message_encoding: str, schema: Any) -> Any:
        return json.loads if message_encoding == "json" else None
