"""One MCAP file being written, and the metadata.yaml of its bag."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Collection
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import yaml
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import MessageIndex
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


_MESSAGE: Final = struct.Struct("<BQHIQQ")  # opcode, length of the rest, channel, sequence, times
_AFTER_LENGTH: Final = _MESSAGE.size - struct.calcsize("<BQ")


class _PackedIndex(MessageIndex):
    """Where a channel's messages lie in a chunk, written in one go."""

    def write(self, stream: RecordBuilder) -> None:
        places = np.array(self.records, dtype="<u8").tobytes()
        stream.start_record(Opcode.MESSAGE_INDEX)
        stream.write2(self.channel_id)
        stream.write4(len(places))
        stream.write(places)
        stream.finish_record()


class FastWriter(Writer):
    """The library's writer, whose messages are packed in one go: the same file, sooner.

    The library makes an object of every message and writes its numbers one by one.
    """

    def add_message(
        self, channel_id: int, log_time: int, data: bytes, publish_time: int, sequence: int = 0
    ) -> None:
        """Append a message to the chunk."""
        library: Any = self  # what it keeps to itself; a test holds the files equal
        chunk, counts = library._Writer__chunk_builder, library._Writer__statistics
        first = log_time if chunk.num_messages == 0 else chunk.message_start_time
        chunk.message_start_time = min(first, log_time)
        chunk.message_end_time = max(chunk.message_end_time, log_time)
        chunk.num_messages += 1
        first = log_time if counts.message_count == 0 else counts.message_start_time
        counts.message_start_time = min(first, log_time)
        counts.message_end_time = max(counts.message_end_time, log_time)
        counts.channel_message_counts[channel_id] += 1
        counts.message_count += 1
        index = chunk.message_indices.get(channel_id)
        if index is None:
            index = chunk.message_indices[channel_id] = _PackedIndex(channel_id, [])
        records = chunk.record_writer
        index.records.append((log_time, records.count))
        length = _AFTER_LENGTH + len(data)
        head = _MESSAGE.pack(Opcode.MESSAGE, length, channel_id, sequence, log_time, publish_time)
        records.write(head + data)
        library._Writer__maybe_finalize_chunk()


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
        self._mcap = FastWriter(self._stream, chunk_size=chunk_size, compression=compression)
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
