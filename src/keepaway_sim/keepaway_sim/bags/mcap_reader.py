"""One MCAP file: its index, chunks and messages."""

from __future__ import annotations

import contextlib
import io
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

import lz4.frame
import numpy as np
import yaml
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema
from numba import njit

from keepaway_sim.bags.topics import INFO, Qos, Topic
from keepaway_sim.errors import KeepawayError

MAX_CHUNK_SIZE = 2**28  # [bytes] unpacked; no writer makes larger ones by default
MAGIC = b"\x89MCAP0\r\n"


class Chunk(NamedTuple):
    """Where a chunk is in its file, and of when."""

    start_time: int
    end_time: int
    size: int  # [bytes] unpacked
    crc: int
    compression: str
    offset: int  # of its packed data
    length: int


class McapFile:
    """One MCAP file: where everything is, found by going from record to record once."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.info: dict[str, str] = {}
        self.chunks: list[Chunk] = []
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

    def unpack(self, chunk: Chunk) -> tuple[bytes, np.ndarray]:
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
        if stream.read(len(MAGIC)) != MAGIC:
            raise KeepawayError(f"{self.path} is no MCAP file")
        position = len(MAGIC)
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
                self.complete = stream.read(length + 8)[length:] == MAGIC
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


def _read_chunk(stream: IO[bytes], limit: int) -> Chunk:
    """Where a chunk is whose record ends at `limit`."""
    start, end, size, crc, length = struct.unpack("<QQQII", stream.read(32))
    compression = stream.read(min(length, limit)).decode()
    (packed,) = struct.unpack("<Q", stream.read(8))
    if size > MAX_CHUNK_SIZE or stream.tell() + packed > limit:
        raise KeepawayError(f"a chunk of {size} bytes, {packed} of them packed")
    return Chunk(start, end, size, crc, compression, stream.tell(), packed)


def _decompress(chunk: Chunk, packed: bytes) -> bytes:
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
