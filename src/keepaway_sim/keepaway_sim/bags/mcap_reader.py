"""One MCAP file: its index, chunks and messages.

The `mcap` library reads the records that are few (schemas, channels, metadata, attachments).
Chunks are unpacked and indexed here, all messages of one at once: the library makes a Python
object of each message, which takes 6 times as long (docs/recordings.md has the figures).

Messages outside chunks are read as if some of them together were a chunk that is not packed.
"""

from __future__ import annotations

import contextlib
import io
import struct
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import IO, NamedTuple

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema
from numba import njit

from keepaway_sim.bags.topics import INFO, Topic, read_qos
from keepaway_sim.errors import KeepawayError

MAX_CHUNK_SIZE = 2**26  # [bytes] unpacked; writers make chunks of about 1 MB
MAX_ATTACHMENT = 2**26  # [bytes]
MAX_RATIO = 100
"""Unpacked over packed size of a whole file; matches have 3 to 5."""
FREE_SIZE = 2**26  # [bytes] that a file may unpack to, however small it is
LOOSE_SIZE = 2**20  # [bytes] of messages outside chunks that are read together
MAGIC = b"\x89MCAP0\r\n"
_ZSTD_MAGIC = int.from_bytes(b"\x28\xb5\x2f\xfd", "little")
_FREE_MESSAGE = 4096  # [bytes] that messages packed by themselves may unpack to


class Chunk(NamedTuple):
    """Where a chunk is in its file, and of when; of messages outside chunks, where they are."""

    start_time: int
    end_time: int
    size: int  # [bytes] unpacked
    crc: int
    compression: str
    offset: int  # of its packed data
    length: int
    is_loose: bool = False  # no chunk, but messages outside chunks


class McapFile:
    """One MCAP file: where everything is, found by going from record to record once.

    Attributes:
        topics: of its channels, by their ids.
        chunks: in the order of the file.
        complete: whether its writer finished it.
        counts: messages by channel; exact.
    """

    def __init__(self, path: Path, tolerant: bool = False) -> None:
        """Find everything.

        Args:
            path: of the file.
            tolerant: pass over damaged chunks, and name them in `damaged`.

        Raises:
            KeepawayError: no MCAP file, or not one that can be read.
        """
        self.path = path
        self.info: dict[str, str] = {}
        self.chunks: list[Chunk] = []
        self.topics: dict[int, Topic] = {}
        self.complete = False
        self.counts: dict[int, int] = {}
        self.damaged: list[str] = []
        self._tolerant = tolerant
        self._statistics: tuple[int, ...] = ()
        self._indexed: dict[int, set[int]] = {}  # channels by their chunk's offset
        self._schemas: dict[int, Schema] = {}
        self._attachments: list[tuple[int, int]] = []
        with understanding(path), path.open("rb") as stream:
            size = path.stat().st_size
            self._scan(stream, size)
        if not self.complete:  # a killed writer leaves the index of its last chunk in part
            self._indexed.clear()
        self._check_size(size)
        if not self._is_described():
            self._look_into_chunks()

    def may_have(self, chunk: Chunk, topics: Collection[str]) -> bool:
        """Whether a chunk may have messages of some topics, by the index that follows it."""
        indexed = self._indexed.get(chunk.offset)
        if indexed is None:
            return True
        return any(self.topics[n].name in topics for n in indexed if n in self.topics)

    def unpack(self, chunk: Chunk) -> tuple[bytes, np.ndarray]:
        """A chunk's bytes, and (n, 4) where its messages are: channel, time, first, last byte.

        Raises:
            KeepawayError: a chunk that is not what was written.
        """
        with understanding(self.path), self.path.open("rb") as stream:
            stream.seek(chunk.offset)
            data = _decompress(chunk, stream.read(chunk.length))
            messages, definitions, end, is_whole = index_records(np.frombuffer(data, np.uint8))
            if not is_whole or end != len(data) or (chunk.crc and zlib.crc32(data) != chunk.crc):
                raise KeepawayError(f"{self.path}: the chunk at {chunk.offset} is damaged")
            for opcode, first, last in definitions.tolist():
                self._read_definition(opcode, data[first:last])
            self._check_messages(chunk, messages)
            return self._unpacked_messages(data, messages)

    def attachments(self) -> Iterator[tuple[str, bytes]]:
        """Name and contents of every attached file.

        Raises:
            KeepawayError: one that cannot be read.
        """
        with self.path.open("rb") as stream:
            for offset, length in self._attachments:
                if length > MAX_ATTACHMENT:
                    raise KeepawayError(f"{self.path}: an attachment of {length:,} bytes")
                with understanding(self.path):
                    stream.seek(offset)
                    found = Attachment.read(ReadDataStream(io.BytesIO(stream.read(length))))
                yield found.name, found.data

    def _scan(self, stream: IO[bytes], size: int) -> None:
        if stream.read(len(MAGIC)) != MAGIC:
            raise KeepawayError(f"{self.path} is no MCAP file")
        position = len(MAGIC)
        while position + 9 <= size:
            stream.seek(position)
            opcode, length = struct.unpack("<BQ", stream.read(9))
            if opcode == 0 or position + 9 + length > size:
                return  # here the writer was killed
            if opcode == Opcode.MESSAGE:
                position = self._scan_loose(stream, position, 9 + length)
                continue
            position += 9 + length
            if opcode == Opcode.CHUNK:
                self._add_chunk(stream, position)
            elif opcode == Opcode.MESSAGE_INDEX and self.chunks and length >= 2:
                channels = self._indexed.setdefault(self.chunks[-1].offset, set())
                channels.add(int.from_bytes(stream.read(2), "little"))
            elif opcode == Opcode.ATTACHMENT:
                self._attachments.append((stream.tell(), length))
            elif opcode in (Opcode.METADATA, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS):
                self._read_definition(opcode, stream.read(length))
            elif opcode == Opcode.FOOTER:
                self.complete = stream.read(length + 8)[length:] == MAGIC
                return

    def _scan_loose(self, stream: IO[bytes], position: int, first: int) -> int:
        """Find the messages outside chunks from a position on; where the next record begins."""
        if first > MAX_CHUNK_SIZE:
            raise KeepawayError(f"a message of {first:,} bytes")
        stream.seek(position)
        data = stream.read(max(LOOSE_SIZE, first))
        messages, definitions, end, _ = index_records(np.frombuffer(data, np.uint8), True)
        if not len(messages):
            raise KeepawayError(f"the message at {position} is damaged")
        for opcode, start, stop in definitions.tolist():
            self._read_definition(opcode, data[start:stop])
        times = messages[:, 1]
        chunk = Chunk(int(times.min()), int(times.max()), end, 0, "", position, end, True)
        self.chunks.append(chunk)
        self._check_messages(chunk, messages)
        self._count(messages)
        return position + int(end)

    def _add_chunk(self, stream: IO[bytes], limit: int) -> None:
        try:
            self.chunks.append(_read_chunk(stream, limit))
        except KeepawayError as error:
            if not self._tolerant:
                raise
            self.damaged.append(str(error))

    def _is_described(self) -> bool:
        """Whether all channels and counts are known without a look into the chunks.

        Statistics that do not fit what was found are not believed.
        """
        packed = [chunk for chunk in self.chunks if not chunk.is_loose]
        if not packed:
            return True
        if not (self.complete and self._statistics):
            return False
        messages, channels, chunks, *counts = self._statistics
        found = dict(zip(counts[::2], counts[1::2], strict=True))
        if len(packed) < len(self.chunks) or chunks != len(packed) or channels != len(self.topics):
            return False
        if sum(found.values()) != messages or found.keys() - self.topics.keys():
            return False
        self.counts = found
        return True

    def _look_into_chunks(self) -> None:
        for chunk in list(self.chunks):
            if chunk.is_loose:
                continue
            try:
                self._count(self.unpack(chunk)[1])
            except KeepawayError as error:
                if not self._tolerant:
                    raise
                self.damaged.append(str(error))
                self.chunks.remove(chunk)

    def _count(self, messages: np.ndarray) -> None:
        for channel, count in zip(*np.unique(messages[:, 0], return_counts=True), strict=True):
            self.counts[int(channel)] = self.counts.get(int(channel), 0) + int(count)

    def _check_size(self, size: int) -> None:
        unpacked = sum(chunk.size for chunk in self.chunks)
        if unpacked > FREE_SIZE + MAX_RATIO * size:
            raise KeepawayError(
                f"{self.path}: {unpacked:,} bytes are packed into {size:,}; if you trust it, unpack"
                " it first: mcap decompress"
            )

    def _check_messages(self, chunk: Chunk, messages: np.ndarray) -> None:
        """Whether all have a channel, and a time within their chunk's."""
        times = messages[:, 1]
        if len(times) and times.min() < 0:
            late = int(np.uint64(times.view(np.uint64).max()))
            raise KeepawayError(f"a message's time is {late} ns, beyond 64 bits with a sign")
        if len(times) and not chunk.start_time <= times.min() <= times.max() <= chunk.end_time:
            raise KeepawayError(
                f"the chunk at {chunk.offset} has messages of other times than it claims;"
                " mcap recover writes it anew"
            )
        indexed = self._indexed.get(chunk.offset)
        for channel in np.unique(messages[:, 0]).tolist():
            if channel not in self.topics:
                raise KeepawayError(f"a message of channel {channel}, which is not there")
            if indexed is not None and channel not in indexed:
                raise KeepawayError(f"the index of the chunk at {chunk.offset} is not its own")

    def _unpacked_messages(self, data: bytes, messages: np.ndarray) -> tuple[bytes, np.ndarray]:
        """The same, where rosbag2 packed each message by itself: all of them unpacked.

        CDR begins with two bytes that no packed message begins with.
        """
        long = np.flatnonzero(messages[:, 3] - messages[:, 2] >= 4)
        raw = np.frombuffer(data, np.uint8)
        front = raw[messages[long, 2, None] + np.arange(4)].copy().view("<u4")[:, 0]
        packed = set(long[front == _ZSTD_MAGIC].tolist())
        if not packed:
            return data, messages
        parts, moved, position = [], messages.copy(), 0
        most = min(MAX_CHUNK_SIZE, _FREE_MESSAGE + MAX_RATIO * len(data))
        for row, (channel, _, first, last) in enumerate(messages.tolist()):
            part = data[first:last]
            if row in packed and self.topics[channel].encoding == "cdr":
                part = _unzstd(part, max(0, most - position))
            parts.append(part)
            moved[row, 2:] = position, position + len(part)
            position += len(part)
        return b"".join(parts), moved

    def _read_definition(self, opcode: int, data: bytes) -> None:
        stream = ReadDataStream(io.BytesIO(data))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self._schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            if channel.schema_id and channel.schema_id not in self._schemas:
                raise KeepawayError(f"{channel.topic} has schema {channel.schema_id}: not there")
            self.topics.setdefault(channel.id, _topic(channel, self._schemas))
        elif opcode == Opcode.METADATA:
            record = Metadata.read(stream)
            self.info.update(record.metadata if record.name == INFO else {})
        elif opcode == Opcode.STATISTICS:
            messages, _, channels, _, _, chunks = struct.unpack_from("<QHIIII", data)
            counts = np.frombuffer(data[46:], np.dtype([("channel", "<u2"), ("count", "<u8")]))
            pairs = [int(value) for pair in counts.tolist() for value in pair]
            self._statistics = messages, channels, chunks, *pairs


def _topic(channel: Channel, schemas: dict[int, Schema]) -> Topic:
    schema = schemas[channel.schema_id] if channel.schema_id else Schema(0, b"", "", "")
    return Topic(
        channel.topic,
        schema.name,
        schema.data.decode(errors="surrogateescape"),
        channel.metadata.get("topic_type_hash", ""),
        read_qos(channel.metadata.get("offered_qos_profiles", ""), schema.name),
        schema.encoding,
        channel.message_encoding,
    )


@contextlib.contextmanager
def understanding(path: Path) -> Iterator[None]:
    """Whatever untrusted bytes break is reported as the file's fault."""
    try:
        yield
    except OSError:
        raise
    except KeepawayError as error:
        if str(path) in str(error):
            raise
        raise KeepawayError(f"{path}: {error}") from error
    except Exception as error:
        raise KeepawayError(f"{path} is damaged: {error!r}") from error


def _read_chunk(stream: IO[bytes], limit: int) -> Chunk:
    """Where a chunk is whose record ends at `limit`."""
    start, end, size, crc, length = struct.unpack("<QQQII", stream.read(32))
    if length > limit - stream.tell():
        raise KeepawayError(f"a chunk whose compression's name has {length:,} bytes")
    compression = stream.read(length).decode()
    (packed,) = struct.unpack("<Q", stream.read(8))
    if size > MAX_CHUNK_SIZE or stream.tell() + packed > limit:
        raise KeepawayError(f"a chunk of {size:,} bytes, {packed:,} of them packed")
    if max(start, end) >= 2**63:
        raise KeepawayError(f"a chunk's time is {max(start, end)} ns, beyond 64 bits with a sign")
    return Chunk(start, end, size, crc, compression, stream.tell(), packed)


def _decompress(chunk: Chunk, packed: bytes) -> bytes:
    data = packed
    if chunk.compression == "zstd":
        data = _unzstd(packed, chunk.size)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(packed, chunk.size)
    elif chunk.compression:
        raise KeepawayError(f"compression {chunk.compression!r} is not known")
    if len(data) != chunk.size:
        raise KeepawayError(f"a chunk of {len(data):,} bytes that should have {chunk.size:,}")
    return data


def _unzstd(packed: bytes, most: int) -> bytes:
    """Unpacked, if it has `most` bytes or fewer."""
    if zstandard.frame_content_size(packed) > most:
        raise KeepawayError("a chunk larger than it claims")
    return zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_SIZE).decompress(packed, most)


@njit(cache=True)
def index_records(data, is_loose=False):
    """Where the records in a chunk are, or those that stand outside chunks.

    Returns:
        (n, 4) int64 of messages: channel, log time, first and last byte of the payload;
        (m, 3) int64 of schemas and channels: opcode, first and last byte;
        where the first record begins that was not read;
        whether the records up to there are whole. Outside chunks, reading ends with a record of
        another kind, or with one that is not all in the data.
    """
    num_messages, num_definitions, end, is_whole = 0, 0, 0, True
    while end + 9 <= len(data):
        opcode, length = data[end], _unsigned(data, end + 1, 8)
        if is_loose and (opcode < 3 or opcode > 5):
            break
        if length < 0 or length > len(data) - end - 9 or (opcode == 5 and length < 22):
            is_whole = is_loose
            break
        num_messages += opcode == 5
        num_definitions += opcode == 3 or opcode == 4
        end += 9 + length
    messages = np.empty((num_messages, 4), np.int64)
    definitions = np.empty((num_definitions, 3), np.int64)
    position, m, d = 0, 0, 0
    while position < end and position + 9 <= len(data):
        opcode, body = data[position], position + 9
        position = body + _unsigned(data, position + 1, 8)
        if opcode == 5:
            messages[m, 0] = _unsigned(data, body, 2)
            messages[m, 1] = _unsigned(data, body + 6, 8)
            messages[m, 2], messages[m, 3] = body + 22, position
            m += 1
        elif opcode == 3 or opcode == 4:
            definitions[d, 0], definitions[d, 1], definitions[d, 2] = opcode, body, position
            d += 1
    return messages, definitions, end, is_whole


@njit(cache=True, inline="always")
def _unsigned(data, start, size):
    value = np.int64(0)
    for k in range(size):
        value |= np.int64(data[start + k]) << (8 * k)
    return value
