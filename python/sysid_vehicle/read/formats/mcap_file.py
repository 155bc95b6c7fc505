"""MCAP with messages of ROS 2 or JSON, by mcap and mcap-ros2-support."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ...errors import InvalidInput
from ..recording import Recording
from .messages import Taken, recording_of


def read(path: Path, dbc: Path | None) -> Recording:
    """List the numbers in the first message of each topic."""
    firsts: list[tuple[str, Any]] = []
    unread = {}
    with path.open("rb") as file:
        reader = _reader(file)
        summary = reader.get_summary()
        for channel in summary.channels.values() if summary is not None else ():
            if channel.message_encoding not in ("cdr", "json"):
                unread[channel.topic] = channel.message_encoding
                continue
            first = next(_messages(reader, [channel.topic]), None)
            firsts += [] if first is None else [first[:2]]

    def messages(topics: list[str]) -> Iterator[Taken]:
        with path.open("rb") as file:
            yield from _messages(_reader(file), topics)

    recording = recording_of(firsts, messages)
    if not recording.entries:
        held = f" of encoding {', '.join(sorted(set(unread.values())))}" if unread else ""
        raise InvalidInput(
            f"{path}: holds no readable message{held or ', or no index'}; record ROS 2 or JSON "
            f"messages, or mend the file with mcap recover"
        )
    return recording


def _reader(file: Any) -> Any:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    return make_reader(file, decoder_factories=[_Json(), DecoderFactory()])


def _messages(reader: Any, topics: list[str]) -> Iterator[Taken]:
    for _, channel, record, message in reader.iter_decoded_messages(topics=topics):
        yield channel.topic, message, record.log_time


class _Json:
    """Decodes messages that are JSON."""

    def decoder_for(self, message_encoding: str, schema: Any) -> Any:
        return json.loads if message_encoding == "json" else None
