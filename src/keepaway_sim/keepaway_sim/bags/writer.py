"""Bags: what was said in a match, as MCAP files that any ROS 2 tool opens. Needs no ROS.

A bag is a folder like rosbag2's: `NAME/NAME_0.mcap`, in long recordings `NAME/NAME_1.mcap` and so
on (profile `ros2`, CDR messages, full `ros2msg` definitions, chunked and compressed), and
`NAME/metadata.yaml` (version 9). Times are simulated time [ns]. What made the bag (task, seed,
configuration, code version, policies) is in it too, as MCAP metadata "keepaway" and as rosbag2's
`custom_data`; weights may be attached.

Sources: https://mcap.dev/spec, https://mcap.dev/spec/registry, rosbag2's `metadata_io.cpp` and
`rosbag2_storage_mcap`.
"""

from __future__ import annotations

import contextlib
import io
import re
import struct
import time
import zlib
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import IO, Any, NamedTuple, Self

import lz4.frame
import numpy as np
import yaml
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema
from mcap.writer import CompressionType, Writer
from numba import njit

from keepaway_sim.errors import KeepawayError
from keepaway_sim.version import __version__
from keepaway_sim.wire import cdr
from keepaway_sim.wire.messages import AGENT_STATUS, MATCH

INFO = "keepaway"
"""Name of the MCAP metadata records that say what made a bag."""
CHUNK_SIZE = 768 * 1024  # [bytes] as rosbag2's
FILE_CHUNKS = 1024  # of which a file's index takes some 4 MB of memory
MESSAGE_OVERHEAD = 31  # [bytes] of a message's record in a chunk, besides its data
MAX_CHUNK_SIZE = 2**28  # [bytes] unpacked; no writer makes larger ones by default
COMPRESSIONS = {
    "zstd": CompressionType.ZSTD,
    "lz4": CompressionType.LZ4,
    "none": CompressionType.NONE,
}
_MAGIC = b"\x89MCAP0\r\n"
_FOREVER = {"sec": 9223372036, "nsec": 854775807}  # how rosbag2 writes an infinite duration
_LATCHED = (MATCH, AGENT_STATUS)


class Qos(NamedTuple):
    """How a topic is offered; the rest is ROS 2's default."""

    depth: int = 10
    transient_local: bool = False
    reliable: bool = True

    def to_dict(self) -> dict[str, Any]:
        """As rosbag2 writes it."""
        return {
            "history": "keep_last",
            "depth": self.depth,
            "reliability": "reliable" if self.reliable else "best_effort",
            "durability": "transient_local" if self.transient_local else "volatile",
            "deadline": _FOREVER,
            "lifespan": _FOREVER,
            "liveliness": "automatic",
            "liveliness_lease_duration": _FOREVER,
            "avoid_ros_namespace_conventions": False,
        }


def default_qos(message_type: str) -> Qos:
    """How topics of a type are offered in a match: what is said once is latched."""
    return Qos(1, transient_local=True) if message_type in _LATCHED else Qos()


class Topic(NamedTuple):
    """A topic of a bag."""

    name: str
    message_type: str
    definition: str  # ros2msg
    type_hash: str  # empty where it is not known
    qos: Qos


class Recorded(NamedTuple):
    """One message of a bag."""

    topic: str
    message_type: str
    log_time: int  # [ns] simulated
    data: bytes  # CDR


class Batch(NamedTuple):
    """Messages of one topic of equal lengths, in order, as one structured array."""

    topic: str
    log_time: np.ndarray  # (n,) int64 [ns]
    data: np.ndarray  # (n,) of the codec's dtype


class BagWriter:
    """Writes one bag. Use it in a `with`: the bag is whole when it is left, however that happens.

    A file keeps an index of its chunks in memory until it is finished, so after `file_chunks` of
    them the bag goes on in a next file, as rosbag2's do: memory does not grow with the bag, and
    files that are finished stay whole whatever happens later.

    Attributes:
        path: the bag's folder.
        topics: by name, those registered so far.
        message_count: messages written so far.
    """

    def __init__(
        self,
        path: Path | str,
        info: Mapping[str, str] | None = None,
        compression: str = "zstd",
        chunk_size: int = CHUNK_SIZE,
        flush_interval: float = 1.0,
        file_chunks: int = FILE_CHUNKS,
    ) -> None:
        """Make the bag's folder and begin its first file.

        Args:
            path: a folder that does not exist yet.
            info: what made the bag.
            compression: of the chunks: "zstd", "lz4" or "none".
            chunk_size: a chunk ends when it has so many bytes,
            flush_interval: or after so long [s, wall time]: what is lost if the writer is killed.
                With `math.inf` equal messages make equal files.
            file_chunks: a file ends after about so many chunks.

        Raises:
            KeepawayError: the folder exists, or there is no such compression.
        """
        self.path = Path(path)
        if compression not in COMPRESSIONS:
            raise KeepawayError(
                f"compression={compression!r}: choose from {', '.join(COMPRESSIONS)}"
            )
        try:
            self.path.mkdir(parents=True)
        except FileExistsError:
            raise KeepawayError(
                f"{self.path} exists already: choose another name, or remove it"
            ) from None
        except OSError as error:
            raise KeepawayError(f"{self.path} cannot be made: {error}") from error
        self.message_count = 0
        self._info: dict[str, str] = {}
        self.topics: dict[str, Topic] = {}
        self._counts: dict[str, int] = {}
        self._packing = chunk_size, COMPRESSIONS[compression], file_chunks
        self._finished: list[_Part] = []
        self._is_open = True
        self._flush_interval, self._flushed = flush_interval, time.monotonic()
        self._file = self._next_file()
        self.add_info(**(info or {}))
        self.flush()

    def add_info(self, **entries: str) -> None:
        """Say more about what made the bag; written at once, later entries win.

        Errors as in `write`.
        """
        if entries:
            self._info.update(entries)
            with self._giving_up():
                self._file.add_metadata(INFO, entries)

    def add_topic(
        self,
        name: str,
        message_type: str,
        qos: Qos | None = None,
        definition: str | None = None,
        type_hash: str | None = None,
    ) -> None:
        """Register a topic, unless it is.

        Args:
            name: in full, "/keeper_1/perception".
            message_type: "keepaway_msgs/msg/Perception".
            qos: how its publisher offers it; latched for matches and agents' status by default.
            definition: its ros2msg text; by default that of the installed message.
            type_hash: its REP-2011 hash; by default that of the installed message.

        Raises:
            KeepawayError: registered with another type, or the message is not installed.
        """
        known = self.topics.get(name)
        if known is not None:
            if known.message_type != message_type:
                raise KeepawayError(f"{name} carries {known.message_type}, not {message_type}")
            return
        qos = qos or default_qos(message_type)
        if definition is None:
            definition, type_hash = cdr.definition(message_type), cdr.type_hash(message_type)
        topic = Topic(name, message_type, definition, type_hash or "", qos)
        self.topics[name], self._counts[name] = topic, 0
        self._file.add_topic(topic)

    def write(self, topic: str, message_type: str, data: bytes, log_time: int) -> None:
        """Write one message.

        Args:
            topic: its name in full; registered by its first message.
            message_type: for example "keepaway_msgs/msg/Perception".
            data: CDR bytes.
            log_time: simulated time [ns].

        Raises:
            KeepawayError: the disk is full, or the like; this writer then writes no more, what it
                has written can be read, and `repair` makes a whole bag of it.
        """
        if topic not in self._counts:
            self.add_topic(topic, message_type)
        try:
            if self._file.room <= 0:
                self._finish_file()
                self._file = self._next_file()
            self._file.write(topic, log_time, data, self._counts[topic])
        except OSError as error:
            raise self._given_up(error) from error
        self._counts[topic] += 1
        self.message_count += 1
        if time.monotonic() - self._flushed > self._flush_interval:
            self.flush()

    def attach(self, name: str, data: bytes, media_type: str = "application/octet-stream") -> None:
        """Put a file into the bag, for example the weights that a player started from.

        Errors as in `write`.
        """
        with self._giving_up():
            self._file.attach(name, data, media_type)

    def flush(self) -> None:
        """End the chunk and give everything to the operating system; errors as in `write`."""
        with self._giving_up():
            self._file.flush()
        self._flushed = time.monotonic()

    def close(self) -> None:
        """Finish the file and write `metadata.yaml`; errors as in `write`.

        Nothing happens the second time, or after an error.
        """
        if not self._is_open:
            return
        text = _to_yaml({"rosbag2_bagfile_information": self._metadata()})
        with self._giving_up():
            self._finish_file()
            (self.path / "metadata.yaml").write_text(text)
        self._is_open = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _next_file(self) -> _FileWriter:
        path = self.path / f"{self.path.name}_{len(self._finished)}.mcap"
        return _FileWriter(path, *self._packing, self.topics.values())

    def _finish_file(self) -> None:
        self._file.add_metadata("rosbag2", {"serialized_metadata": _to_yaml(self._metadata())})
        self._file.finish()
        self._finished.append(self._file.part)

    @contextlib.contextmanager
    def _giving_up(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self._given_up(error) from error

    def _given_up(self, error: OSError) -> KeepawayError:
        """Let go of a file that cannot be written; what is still in memory is lost."""
        self._file.abandon()
        self._is_open = False
        return KeepawayError(
            f"{self.path} cannot be written any more: {error}; scripts/repair_bag.py makes a whole"
            " bag of what is there"
        )

    def _metadata(self) -> dict[str, Any]:
        """What rosbag2 says of a bag: here, of what was written so far."""
        parts = [*self._finished, self._file.part]
        written = [part for part in parts if part.message_count]
        start = min((part.start for part in written), default=0)
        end = max((part.end for part in written), default=0)
        return {
            "version": 9,
            "storage_identifier": "mcap",
            **_span(start, end, self.message_count),
            "topics_with_message_count": [
                {
                    "topic_metadata": {
                        "name": topic.name,
                        "type": topic.message_type,
                        "serialization_format": "cdr",
                        "offered_qos_profiles": [topic.qos.to_dict()],
                        "type_description_hash": topic.type_hash,
                    },
                    "message_count": self._counts[topic.name],
                }
                for topic in self.topics.values()
            ],
            "compression_format": "",  # of whole files or messages; chunks are MCAP's own matter
            "compression_mode": "",
            "relative_file_paths": [part.name for part in parts],
            "files": [{"path": part.name, **_span(*part[1:])} for part in parts],
            "custom_data": self._info or None,
            "ros_distro": "jazzy",
        }


class _Part(NamedTuple):
    """What is in one file of a bag."""

    name: str
    start: int  # [ns] the first time of its messages; 0 without messages
    end: int
    message_count: int


class _FileWriter:
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
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._stream = path.open("xb")
        self._mcap = Writer(self._stream, chunk_size=chunk_size, compression=compression)
        self._mcap.start(profile="ros2", library=f"keepaway {__version__}")
        for topic in topics:
            self.add_topic(topic)

    def add_topic(self, topic: Topic) -> None:
        """Register a topic with its type."""
        if topic.message_type not in self._schemas:
            self._schemas[topic.message_type] = self._mcap.register_schema(
                topic.message_type, "ros2msg", topic.definition.encode()
            )
        self._channels[topic.name] = self._mcap.register_channel(
            topic.name,
            "cdr",
            self._schemas[topic.message_type],
            {
                "offered_qos_profiles": _to_yaml([topic.qos.to_dict()]),
                "topic_type_hash": topic.type_hash,
            },
        )

    @property
    def part(self) -> _Part:
        """What is in it so far."""
        return _Part(self._name, self._start, self._end, self._message_count)

    def write(self, topic: str, log_time: int, data: bytes, sequence: int) -> None:
        self._mcap.add_message(self._channels[topic], log_time, data, log_time, sequence)
        self._start = min(self._start, log_time) if self._message_count else log_time
        self._end = max(self._end, log_time)
        self._message_count += 1
        self.room -= MESSAGE_OVERHEAD + len(data)

    def add_metadata(self, name: str, entries: dict[str, str]) -> None:
        self._mcap.add_metadata(name, entries)

    def attach(self, name: str, data: bytes, media_type: str) -> None:
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


def _span(start: int, end: int, message_count: int) -> dict[str, Any]:
    """When a file or a bag begins, and how much is in it, as rosbag2 writes it."""
    return {
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": message_count,
    }


class BagReader:
    """Reads a bag, also one whose writer was killed: up to its last whole chunk.

    Messages come in the order in which they were written. Memory does not grow with the bag: one
    chunk is unpacked at a time.

    Attributes:
        path: what was opened.
        info: what made the bag.
        topics: by name.
        counts: messages by topic name.
        complete: whether the writer finished it.
        start_time, end_time: of its messages [ns]; both 0 without messages.
    """

    def __init__(self, path: Path | str) -> None:
        """Open a bag's folder, or an MCAP file by itself.

        Raises:
            KeepawayError: there is no bag.
        """
        self.path = Path(path)
        self.info: dict[str, str] = {}
        self.topics: dict[str, Topic] = {}
        self.counts: dict[str, int] = {}
        self._layouts: dict[tuple[str, int], tuple[dict[str, int], np.dtype[np.void]]] = {}
        self._files = [_File(file) for file in _mcap_files(self.path)]
        for file in self._files:
            self.info.update(file.info)
            for topic, count in file.contents():
                self.topics.setdefault(topic.name, topic)
                self.counts[topic.name] = self.counts.get(topic.name, 0) + count
        self.complete = all(file.complete for file in self._files)
        chunks = [chunk for file in self._files for chunk in file.chunks]
        self.start_time = min((chunk.start_time for chunk in chunks), default=0)
        self.end_time = max((chunk.end_time for chunk in chunks), default=0)

    @property
    def message_count(self) -> int:
        """Messages in the bag."""
        return sum(self.counts.values())

    def of_type(self, message_type: str) -> list[str]:
        """The names of the topics that carry this type, in the order of their registration."""
        return [t.name for t in self.topics.values() if t.message_type == message_type]

    def codec(self, topic: str) -> cdr.Codec:
        """How to read a topic's messages, by the definition that the bag itself carries."""
        entry = self.topics[topic]
        return cdr.codec(entry.message_type, entry.definition)

    def messages(
        self,
        topics: Collection[str] | None = None,
        start: int | None = None,
        end: int | None = None,
    ) -> Iterator[Recorded]:
        """The messages of these topics (or of all) with start <= log_time < end [ns]."""
        for file, chunk in self._chunks(start, end):
            data, index = file.unpack(chunk)
            for channel, log_time, first, last in index.tolist():
                topic = file.topic(channel)
                if topics is not None and topic.name not in topics:
                    continue
                if (start is None or log_time >= start) and (end is None or log_time < end):
                    yield Recorded(topic.name, topic.message_type, log_time, data[first:last])

    def batches(
        self,
        topics: Collection[str],
        start: int | None = None,
        end: int | None = None,
    ) -> Iterator[Batch]:
        """The same messages, many at once: topic by topic, in order within each topic.

        Raises:
            KeepawayError: a message with strings or messages in sequences, which has no dtype.
        """
        for file, chunk in self._chunks(start, end):
            data, index = file.unpack(chunk)
            low = chunk.start_time if start is None else start
            high = chunk.end_time + 1 if end is None else end
            index = index[(index[:, 1] >= low) & (index[:, 1] < high)]
            raw = np.frombuffer(data, np.uint8)
            for channel in np.unique(index[:, 0]):
                topic = file.topic(int(channel))
                if topic.name in topics:
                    of_topic = index[index[:, 0] == channel]
                    for same in _runs_of_equal_size(of_topic):
                        yield from self._batches_of_run(topic.name, raw, same)

    def attachments(self) -> Iterator[tuple[str, bytes]]:
        """Name and contents of every attached file."""
        for file in self._files:
            yield from file.attachments()

    def _chunks(self, start: int | None, end: int | None) -> Iterator[tuple[_File, _Chunk]]:
        for file in self._files:
            for chunk in file.chunks:
                if start is not None and chunk.end_time < start:
                    continue
                if end is not None and chunk.start_time >= end:
                    continue
                yield file, chunk

    def _batches_of_run(self, topic: str, raw: np.ndarray, index: np.ndarray) -> Iterator[Batch]:
        """Messages of one size may still differ in where they have it: split until they do not."""
        size = int(index[0, 3] - index[0, 2])
        rows = raw[index[:, 2, None] + np.arange(size)]
        while len(index):
            lengths, dtype = self._layout(topic, rows[0])
            data = rows.view(dtype)[:, 0]
            alike = np.ones(len(index), dtype=bool)
            for name, length in lengths.items():
                alike &= data[f"{name}.length"] == length
            count = len(index) if alike.all() else int(np.argmin(alike))
            yield Batch(topic, index[:count, 1], data[:count])
            index, rows = index[count:], rows[count:]

    def _layout(self, topic: str, message: np.ndarray) -> tuple[dict[str, int], np.dtype[np.void]]:
        """The lengths of a message's sequences and so its type; mostly as the last of its size."""
        key = self.topics[topic].message_type, len(message)
        if key in self._layouts:
            lengths, dtype = self._layouts[key]
            first = message.view(dtype)[0]
            if all(first[f"{name}.length"] == length for name, length in lengths.items()):
                return lengths, dtype
        codec = self.codec(topic)
        lengths = codec.lengths(codec.decode(message.tobytes()))
        self._layouts[key] = lengths, codec.dtype(lengths, len(message))
        return self._layouts[key]


class _Chunk(NamedTuple):
    """Where a chunk is in its file, and of when."""

    start_time: int
    end_time: int
    size: int  # [bytes] unpacked
    crc: int
    compression: str
    offset: int  # of its packed data
    length: int


class _File:
    """One MCAP file: where everything is, found by going from record to record once."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.info: dict[str, str] = {}
        self.chunks: list[_Chunk] = []
        self.channels: dict[int, Topic] = {}
        self.complete = False
        self._counts: dict[int, int] = {}
        self._schemas: dict[int, Schema] = {}
        self._attachments: list[tuple[int, int]] = []
        with _understanding(path), path.open("rb") as stream:
            self._scan(stream, path.stat().st_size)

    def contents(self) -> Iterator[tuple[Topic, int]]:
        """Every topic with the number of its messages."""
        if not self.complete:
            for chunk in self.chunks:
                _, index = self.unpack(chunk)
                for channel, count in zip(*np.unique(index[:, 0], return_counts=True), strict=True):
                    self._counts[channel] = self._counts.get(channel, 0) + int(count)
        for number, topic in self.channels.items():
            yield topic, self._counts.get(number, 0)

    def topic(self, channel: int) -> Topic:
        """The topic of a channel.

        Raises:
            KeepawayError: there is no such channel.
        """
        if channel not in self.channels:
            raise KeepawayError(f"{self.path}: a message of channel {channel}, which is not there")
        return self.channels[channel]

    def unpack(self, chunk: _Chunk) -> tuple[bytes, np.ndarray]:
        """A chunk's bytes, and (n, 4) where its messages are: channel, time, first, last byte.

        Raises:
            KeepawayError: a chunk that is not what was written.
        """
        with _understanding(self.path), self.path.open("rb") as stream:
            stream.seek(chunk.offset)
            data = _decompress(chunk, stream.read(chunk.length))
            records, is_whole = _index_records(np.frombuffer(data, np.uint8))
            if not is_whole or (chunk.crc and zlib.crc32(data) != chunk.crc):
                raise KeepawayError(f"{self.path}: the chunk at {chunk.offset} is damaged")
            messages = records[records[:, 0] == Opcode.MESSAGE, 1:]
            if not self.complete:
                for opcode, _, _, first, last in records[records[:, 0] != Opcode.MESSAGE].tolist():
                    self._read_definition(opcode, data[first:last])
        return data, messages

    def attachments(self) -> Iterator[tuple[str, bytes]]:
        """Name and contents of every attached file."""
        with self.path.open("rb") as stream:
            for offset, length in self._attachments:
                with _understanding(self.path):
                    stream.seek(offset)
                    found = Attachment.read(ReadDataStream(io.BytesIO(stream.read(length))))
                yield found.name, found.data

    def _scan(self, stream: IO[bytes], size: int) -> None:
        if stream.read(len(_MAGIC)) != _MAGIC:
            raise KeepawayError(f"{self.path} is no MCAP file")
        position = len(_MAGIC)
        while position + 9 <= size:
            stream.seek(position)
            opcode, length = struct.unpack("<BQ", stream.read(9))
            position += 9 + length
            if opcode == 0 or position > size:
                return  # here the writer was killed
            if opcode == Opcode.CHUNK:
                self.chunks.append(_read_chunk(stream, position))
            elif opcode == Opcode.ATTACHMENT:
                self._attachments.append((stream.tell(), length))
            elif opcode in (Opcode.METADATA, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS):
                self._read_definition(opcode, stream.read(length))
            elif opcode == Opcode.FOOTER:
                self.complete = stream.read(length + 8)[length:] == _MAGIC
                return

    def _read_definition(self, opcode: int, data: bytes) -> None:
        stream = ReadDataStream(io.BytesIO(data))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self._schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self.channels[channel.id] = _topic(channel, self._schemas[channel.schema_id])
        elif opcode == Opcode.METADATA:
            record = Metadata.read(stream)
            self.info.update(record.metadata if record.name == INFO else {})
        elif opcode == Opcode.STATISTICS:
            counts = np.frombuffer(data[46:], np.dtype([("channel", "<u2"), ("count", "<u8")]))
            self._counts = dict(counts.tolist())


def is_bag(path: Path | str) -> bool:
    """Is it a bag's folder, or an MCAP file by itself?"""
    path = Path(path)
    return path.suffix == ".mcap" if path.is_file() else any(path.glob("*.mcap"))


def repair(path: Path | str, output: Path | str) -> BagReader:
    """Write a whole bag of everything that can be read of an unfinished one.

    Returns:
        The new bag, opened.

    Raises:
        KeepawayError: nothing can be read, or the output exists.
    """
    broken = BagReader(path)
    with BagWriter(output, broken.info) as whole:
        for topic in broken.topics.values():
            whole.add_topic(*topic[:2], topic.qos, topic.definition, topic.type_hash)
        for name, data in broken.attachments():
            whole.attach(name, data)
        for message in broken.messages():
            whole.write(message.topic, message.message_type, message.data, message.log_time)
    return BagReader(output)


def _to_yaml(data: Any) -> str:
    return str(yaml.dump(data, Dumper=_PlainDumper, sort_keys=False, allow_unicode=True))


class _PlainDumper(yaml.SafeDumper):  # type: ignore[misc]
    """Writes equal parts in full each time, not as references to each other."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _mcap_files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    listed = sorted(path.glob("*.mcap"), key=_file_number)
    if not listed:
        raise KeepawayError(f"{path}: no bag there (a folder with an .mcap file, or such a file)")
    # A writer that was killed, or found the disk full, may only just have begun its last file.
    return [file for file in listed if file.stat().st_size >= len(_MAGIC)] or listed[:1]


def _file_number(path: Path) -> int:
    number = re.search(r"_(\d+)$", path.stem)
    return int(number[1]) if number else 0


def _topic(channel: Channel, schema: Schema) -> Topic:
    offered = yaml.safe_load(channel.metadata.get("offered_qos_profiles", "")) or [{}]
    qos = Qos(
        depth=int(offered[0].get("depth", Qos().depth)),
        transient_local=offered[0].get("durability") in ("transient_local", 1),
        reliable=offered[0].get("reliability", "reliable") in ("reliable", 1),
    )
    hash_ = channel.metadata.get("topic_type_hash", "")
    return Topic(channel.topic, schema.name, schema.data.decode(), hash_, qos)


@contextlib.contextmanager
def _understanding(path: Path) -> Iterator[None]:
    """Whatever a stranger's bytes break is said to be the file's fault."""
    try:
        yield
    except (KeepawayError, OSError):
        raise
    except Exception as error:
        raise KeepawayError(f"{path} is damaged: {error!r}") from error


def _read_chunk(stream: IO[bytes], limit: int) -> _Chunk:
    """Where a chunk is whose record ends at `limit`."""
    start, end, size, crc, length = struct.unpack("<QQQII", stream.read(32))
    compression = stream.read(min(length, limit)).decode()
    (packed,) = struct.unpack("<Q", stream.read(8))
    if size > MAX_CHUNK_SIZE or stream.tell() + packed > limit:
        raise KeepawayError(f"a chunk of {size} bytes, {packed} of them packed")
    return _Chunk(start, end, size, crc, compression, stream.tell(), packed)


def _decompress(chunk: _Chunk, packed: bytes) -> bytes:
    data = packed
    if chunk.compression == "zstd":
        if zstandard.frame_content_size(packed) > chunk.size:
            raise KeepawayError("a chunk larger than it says")
        data = zstandard.decompress(packed, chunk.size)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(packed, chunk.size)
    elif chunk.compression:
        raise KeepawayError(f"compression {chunk.compression!r} is not known")
    if len(data) != chunk.size:
        raise KeepawayError(f"a chunk of {len(data)} bytes that should have {chunk.size}")
    return data


@njit(cache=True)
def _index_records(data):
    """(n, 5) int64 of every record in a chunk: opcode, channel, log time, first and last byte.

    Channel and time are of messages; their first byte is the payload's. With it: are the records
    whole, up to the last byte?
    """
    found = np.empty((len(data) // 9 + 1, 5), np.int64)
    count, position = 0, 0
    while position + 9 <= len(data):
        length = _unsigned(data, position + 1, 8)
        body = position + 9
        if length < 0 or length > len(data) - body or (data[position] == 5 and length < 22):
            return found[:count].copy(), False
        found[count, 0] = data[position]
        is_message = data[position] == 5
        found[count, 1] = _unsigned(data, body, 2) if is_message else 0
        found[count, 2] = _unsigned(data, body + 6, 8) if is_message else 0
        found[count, 3] = body + 22 if is_message else body
        found[count, 4] = body + length
        position = body + length
        count += 1
    return found[:count].copy(), position == len(data)


@njit(cache=True, inline="always")
def _unsigned(data, start, size):
    value = np.int64(0)
    for k in range(size):
        value |= np.int64(data[start + k]) << (8 * k)
    return value


def _runs_of_equal_size(index: np.ndarray) -> list[np.ndarray]:
    """Split rows (channel, time, first, last) where the number of bytes changes."""
    sizes = index[:, 3] - index[:, 2]
    return np.split(index, np.flatnonzero(np.diff(sizes)) + 1)
