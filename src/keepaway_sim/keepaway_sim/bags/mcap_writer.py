"""One MCAP file being written, and the metadata.yaml of its bag."""

from __future__ import annotations

import contextlib
from collections.abc import Collection
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from mcap.writer import CompressionType, Writer

from keepaway_sim.bags.topics import Topic
from keepaway_sim.version import __version__

CHUNK_SIZE = 768 * 1024  # [bytes] as rosbag2's
FILE_CHUNKS = 1024  # of which a file's index takes some 4 MB of memory
MESSAGE_OVERHEAD = 31  # [bytes] of a message's record in a chunk, besides its data
COMPRESSIONS = {
    "zstd": CompressionType.ZSTD,
    "lz4": CompressionType.LZ4,
    "none": CompressionType.NONE,
}


class Part(NamedTuple):
    """What is in one file of a bag."""

    name: str
    start: int  # [ns] the first time of its messages; 0 without messages
    end: int
    message_count: int


class McapFileWriter:
    """One MCAP file of a bag, while it is written.

    Attributes:
        room: bytes that still fit; a chunk that a flush ends counts in full.
    """

    def __init__(
        self,
        path: Path,
        chunk_size: int,
        compression: CompressionType,
        num_chunks: int,
        topics: Collection[Topic],
    ) -> None:
        self.room = num_chunks * chunk_size
        self._chunk_size = chunk_size
        self._name = path.name
        self._start = self._end = self._message_count = self._flushed_messages = 0
        self._schemas: dict[tuple[str, str, str], int] = {}
        self._channels: dict[str, int] = {}
        self._stream = path.open("xb")
        self._mcap = Writer(self._stream, chunk_size=chunk_size, compression=compression)
        self._mcap.start(profile="ros2", library=f"keepaway {__version__}")
        for topic in topics:
            self.add_topic(topic)

    def add_topic(self, topic: Topic) -> None:
        """Register a topic with its type."""
        self._channels[topic.name] = self._mcap.register_channel(
            topic.name,
            topic.encoding,
            self._schema(topic),
            {
                "offered_qos_profiles": to_yaml([topic.qos.to_dict()]),
                "topic_type_hash": topic.type_hash,
            },
        )

    def _schema(self, topic: Topic) -> int:
        """The number of a topic's schema; 0 where it has none."""
        key = topic.message_type, topic.definition, topic.schema_encoding
        if not topic.message_type:
            return 0
        if key not in self._schemas:
            name, definition, encoding = key
            data = definition.encode(errors="surrogateescape")
            self._schemas[key] = self._mcap.register_schema(name, encoding, data)
        return self._schemas[key]

    @property
    def part(self) -> Part:
        """What is in it so far."""
        return Part(self._name, self._start, self._end, self._message_count)

    def write(self, topic: str, log_time: int, data: bytes, sequence: int) -> None:
        """Append a message."""
        self._mcap.add_message(self._channels[topic], log_time, data, log_time, sequence)
        self._start = min(self._start, log_time) if self._message_count else log_time
        self._end = max(self._end, log_time)
        self._message_count += 1
        self.room -= MESSAGE_OVERHEAD + len(data)

    def add_metadata(self, name: str, entries: dict[str, str]) -> None:
        """Add texts by name."""
        self._mcap.add_metadata(name, entries)

    def attach(self, name: str, data: bytes, media_type: str) -> None:
        """Add a file by name."""
        self._mcap.add_attachment(0, 0, name, media_type, data)

    def flush(self) -> None:
        """End the chunk and give everything to the operating system."""
        if self._message_count > self._flushed_messages:
            self.room -= self._chunk_size
            self._flushed_messages = self._message_count
        self._mcap.flush()

    def finish(self) -> None:
        """Write the index and let go of it."""
        self._mcap.finish()
        self._stream.close()

    def abandon(self) -> None:
        """Leave the file as it is on the disk."""
        with contextlib.suppress(OSError):
            self._stream.close()


def span(start: int, end: int, message_count: int) -> dict[str, Any]:
    """When a file or a bag begins, and how much is in it, as rosbag2 writes it."""
    return {
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": message_count,
    }


def to_yaml(data: Any) -> str:
    """YAML as rosbag2 writes it."""
    return str(yaml.dump(data, Dumper=_PlainDumper, sort_keys=False, allow_unicode=True))


class _PlainDumper(yaml.SafeDumper):  # type: ignore[misc]
    """Writes equal parts in full each time, not as references to each other."""

    def ignore_aliases(self, data: Any) -> bool:
        return True
