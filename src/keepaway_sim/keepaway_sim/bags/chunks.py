"""Chunks of an MCAP file: where they are, their bytes, and the records in them.

All messages of a chunk are indexed at once by compiled code: the `mcap` library makes a Python
object of each message.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import IO, NamedTuple

import lz4.frame
import zstandard

from keepaway_sim.errors import KeepawayError

MAX_CHUNK_SIZE = 2**26  # [bytes] unpacked; writers make chunks of about 1 MB
LOOSE_SIZE = 2**20  # [bytes] of messages outside chunks that are read together
_ZSTD = zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_SIZE)


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


class Run(NamedTuple):
    """Chunks that are read together: one, or several small ones that follow each other."""

    chunks: tuple[Chunk, ...]

    @property
    def size(self) -> int:
        """Unpacked [bytes]."""
        return sum(chunk.size for chunk in self.chunks)

    @property
    def start_time(self) -> int:
        """Of its messages [ns]; that of chunks without messages is 0."""
        return min(chunk.start_time for chunk in self.chunks)

    @property
    def end_time(self) -> int:
        """Of its messages [ns]."""
        return max(chunk.end_time for chunk in self.chunks)


def read_chunk(stream: IO[bytes], limit: int) -> Chunk:
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


def together(chunks: list[Chunk], alone: bool) -> Iterator[tuple[Chunk, ...]]:
    """Successive chunks together while they are small; each alone, if that is wanted."""
    gathered: list[Chunk] = []
    size = 0
    for chunk in chunks:
        if gathered and (alone or chunk.is_loose or size + chunk.size > LOOSE_SIZE):
            yield tuple(gathered)
            gathered, size = [], 0
        gathered.append(chunk)
        size += LOOSE_SIZE if chunk.is_loose else chunk.size
    if gathered:
        yield tuple(gathered)


def read_packed(stream: IO[bytes], chunk: Chunk) -> bytes:
    """A chunk's bytes, unpacked.

    Raises:
        KeepawayError: they are not what was written.
    """
    stream.seek(chunk.offset)
    data = _decompress(chunk, stream.read(chunk.length))
    if chunk.crc and zlib.crc32(data) != chunk.crc:
        raise KeepawayError(f"the chunk at {chunk.offset} is damaged")
    return data


def _decompress(chunk: Chunk, packed: bytes) -> bytes:
    data = packed
    if chunk.compression == "zstd":
        data = unzstd(packed, chunk.size)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(packed, chunk.size)
    elif chunk.compression:
        raise KeepawayError(f"compression {chunk.compression!r} is not known")
    if len(data) != chunk.size:
        raise KeepawayError(f"a chunk of {len(data):,} bytes that should have {chunk.size:,}")
    return data


def unzstd(packed: bytes, most: int) -> bytes:
    """Unpacked, if it has `most` bytes or fewer."""
    if zstandard.frame_content_size(packed) > most:
        raise KeepawayError("a chunk larger than it claims")
    return bytes(_ZSTD.decompress(packed, most))
