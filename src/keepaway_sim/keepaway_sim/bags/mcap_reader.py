"""One MCAP file: its index, chunks and messages.

The `mcap` library reads the records that are few (schemas, channels, metadata, attachments);
chunks are read by `chunks`. Messages outside chunks are read as if some of them together were a
chunk that is not packed.
"""

from __future__ import annotations

import contextlib
import io
import struct
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import IO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema

from keepaway_sim.bags.chunk_records import index_records
from keepaway_sim.bags.chunks import (
    LOOSE_SIZE,
    MAX_CHUNK_SIZE,
    Chunk,
    Run,
    read_chunk,
    read_packed,
    together,
    unzstd,
)
from keepaway_sim.bags.topics import INFO, Topic, read_qos
from keepaway_sim.errors import KeepawayError

MAX_ATTACHMENT = 2**26  # [bytes]
MAX_RATIO = 100
"""Unpacked over packed size of a whole file; matches have 3 to 5."""
FREE_SIZE = 2**26  # [bytes] that a file may unpack to, however small it is
MAGIC = b"\x89MCAP0\r\n"
_LEAST_MESSAGE = 4  # [bytes] packed; messages of matches have 30 and more
_FREE_MESSAGES = 2000  # that chunks may have, however small they are
_ZSTD_MAGIC = int.from_bytes(b"\x28\xb5\x2f\xfd", "little")
_FREE_MESSAGE = 4096  # [bytes] that messages packed by themselves may unpack to


class McapFile:
    """One MCAP file: where everything is, found by going from record to record once.

    Attributes:
        topics: of its channels, by their ids.
        runs: its chunks, in the order of the file.
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
        self.runs: list[Run] = []
        self._chunks: list[Chunk] = []
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
        self.runs = [Run(chunks) for chunks in together(self._chunks, alone=tolerant)]
        if not self._is_described():
            self._look_into_chunks()

    def may_have(self, run: Run, topics: Collection[str]) -> bool:
        """Whether chunks may have messages of some topics, by the index that follows them."""
        indexed = self._indexed_in(run)
        if indexed is None:
            return True
        return any(self.topics[n].name in topics for n in indexed if n in self.topics)

    def _indexed_in(self, run: Run) -> set[int] | None:
        """The channels that chunks have messages of; None: one has no index."""
        indexed: set[int] = set()
        for chunk in run.chunks:
            if chunk.offset not in self._indexed:
                return None
            indexed |= self._indexed[chunk.offset]
        return indexed

    def unpack(self, run: Run) -> tuple[bytes, np.ndarray]:
        """Chunks' bytes, and (n, 4) where their messages are: channel, time, first, last byte.

        Raises:
            KeepawayError: a chunk that is not what was written.
        """
        with understanding(self.path), self.path.open("rb") as stream:
            data = b"".join([read_packed(stream, chunk) for chunk in run.chunks])
            messages, definitions, end, is_whole = index_records(np.frombuffer(data, np.uint8))
            if not is_whole or end != len(data):
                raise KeepawayError(f"the chunk at {run.chunks[0].offset} is damaged")
            for opcode, first, last in definitions.tolist():
                self._read_definition(opcode, data[first:last])
            packed = sum(chunk.length for chunk in run.chunks)
            if len(messages) > _FREE_MESSAGES + packed // _LEAST_MESSAGE:
                raise KeepawayError(
                    f"{len(messages):,} messages are packed into {packed:,} bytes; if you trust it,"
                    " unpack it first: mcap decompress"
                )
            self._check_messages(run, messages)
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
            elif opcode == Opcode.MESSAGE_INDEX and self._chunks and length >= 2:
                channels = self._indexed.setdefault(self._chunks[-1].offset, set())
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
        self._chunks.append(chunk)
        self._check_messages(Run((chunk,)), messages)
        self._count(messages)
        return position + int(end)

    def _add_chunk(self, stream: IO[bytes], limit: int) -> None:
        try:
            self._chunks.append(read_chunk(stream, limit))
        except KeepawayError as error:
            if not self._tolerant:
                raise
            self.damaged.append(str(error))

    def _is_described(self) -> bool:
        """Whether all channels and counts are known without a look into the chunks.

        Statistics that do not fit what was found are not believed.
        """
        packed = [chunk for chunk in self._chunks if not chunk.is_loose]
        if not packed:
            return True
        if not (self.complete and self._statistics):
            return False
        messages, channels, chunks, *counts = self._statistics
        found = dict(zip(counts[::2], counts[1::2], strict=True))
        if len(packed) < len(self._chunks) or chunks != len(packed) or channels != len(self.topics):
            return False
        if sum(found.values()) != messages or found.keys() - self.topics.keys():
            return False
        self.counts = found
        return True

    def _look_into_chunks(self) -> None:
        whole = []
        for run in self.runs:
            try:
                if not run.chunks[0].is_loose:
                    self._count(self.unpack(run)[1])
                whole.append(run)
            except KeepawayError as error:
                if not self._tolerant:
                    raise
                self.damaged.append(str(error))
        self.runs = whole

    def _count(self, messages: np.ndarray) -> None:
        for channel, count in zip(*np.unique(messages[:, 0], return_counts=True), strict=True):
            self.counts[int(channel)] = self.counts.get(int(channel), 0) + int(count)

    def _check_size(self, size: int) -> None:
        unpacked = sum(chunk.size for chunk in self._chunks)
        if unpacked > FREE_SIZE + MAX_RATIO * size:
            raise KeepawayError(
                f"{self.path}: {unpacked:,} bytes are packed into {size:,}; if you trust it, unpack"
                " it first: mcap decompress"
            )

    def _check_messages(self, run: Run, messages: np.ndarray) -> None:
        """Whether all have a channel, and a time within their chunks'."""
        times, where = messages[:, 1], run.chunks[0].offset
        if len(times) and times.min() < 0:
            late = int(np.uint64(times.view(np.uint64).max()))
            raise KeepawayError(f"a message's time is {late} ns, beyond 64 bits with a sign")
        if len(times) and not run.start_time <= times.min() <= times.max() <= run.end_time:
            raise KeepawayError(
                f"the chunk at {where} has messages of other times than it claims;"
                " mcap recover writes it anew"
            )
        indexed = self._indexed_in(run)
        for channel in np.unique(messages[:, 0]).tolist():
            if channel not in self.topics:
                raise KeepawayError(f"a message of channel {channel}, which is not there")
            if indexed is not None and channel not in indexed:
                raise KeepawayError(f"the index of the chunk at {where} is not its own")

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
                part = unzstd(part, max(0, most - position))
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
