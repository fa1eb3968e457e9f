"""Messages in much disorder: sorted runs of them in a temporary file, to be merged from there.

Each source is read once. As many messages as fit a window are sorted and written as a run, in
blocks so small that one of every run fits a window.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import IO, Any, NamedTuple

import numpy as np

from keepaway_sim.bags.blocks import Block, Piece, in_order
from keepaway_sim.errors import KeepawayError

BLOCKS_OF_A_RUN = 4  # that fit a window together with as many of every other


class _Stored(NamedTuple):
    """Where a block is in the file."""

    run: int
    start: int  # [bytes]
    size: int  # [bytes] of the messages
    num: int  # messages


@contextmanager
def spilled(
    pieces: Iterable[Piece], load: Callable[[Any], Block], window: int
) -> Iterator[tuple[list[Piece], Callable[[Any], Block]]]:
    """The same messages as pieces that overlap only with those of other runs, and their loader.

    The temporary file, as large as the messages and 40 bytes for each, lies where TMPDIR says. It
    is gone when the context ends, and with the process.

    Args:
        pieces: in the order in which messages of one key are wanted.
        load: what reads a piece's source.
        window: [bytes] of messages that may be in memory together.

    Raises:
        KeepawayError: no room for the file.
    """
    pieces = list(pieces)
    num_runs = 1 + sum(piece.size for piece in pieces) // window
    block_size = max(1, window // (BLOCKS_OF_A_RUN * num_runs))
    file = tempfile.TemporaryFile(prefix="keepaway-sorted-")  # noqa: SIM115  # closed below
    try:
        stored = [
            piece
            for number, run in enumerate(_runs(pieces, load, window))
            for piece in _store(file, run, number, block_size)
        ]
        file.flush()
    except OSError as error:
        with suppress(OSError):  # it would write what is left
            file.close()
        raise KeepawayError(
            f"{tempfile.gettempdir()}: no room to sort a bag's messages ({error.strerror}):"
            " set TMPDIR to a larger disk"
        ) from error
    with file:
        yield stored, lambda source: _load(file, source)


def _runs(pieces: Iterable[Piece], load: Callable[[Any], Block], window: int) -> Iterator[Block]:
    """All messages, a window's worth at a time, each sorted."""
    kept: list[Block] = []
    size = 0
    for piece in pieces:
        kept.append(load(piece.source).packed())
        size += len(kept[-1].data)
        if size >= window:
            yield in_order(kept)
            kept, size = [], 0
    if kept:
        yield in_order(kept)


def _store(file: IO[bytes], run: Block, number: int, block_size: int) -> Iterator[Piece]:
    """Write a run's messages in order, in blocks."""
    sizes = run.rows[:, 3] - run.rows[:, 2]
    starts = np.cumsum(sizes) - sizes
    cuts = np.flatnonzero(np.diff(starts // block_size, prepend=-1))
    for first, last in zip(cuts.tolist(), [*cuts[1:].tolist(), len(sizes)], strict=True):
        block = Block(run.data, run.rows[first:last], run.keys[first:last]).repacked()
        start = file.tell()
        file.write(block.data)
        file.write(block.rows.tobytes())
        file.write(block.keys.tobytes())
        place = _Stored(number, start, len(block.data), last - first)
        yield Piece(int(block.keys[0]), int(block.keys[-1]), len(block.data), place, number)


def _load(file: IO[bytes], place: _Stored) -> Block:
    file.seek(place.start)
    data = file.read(place.size)
    numbers = np.frombuffer(file.read(5 * 8 * place.num), np.int64).copy()
    rows, keys = numbers[: 4 * place.num], numbers[4 * place.num :]
    return Block(data, rows.reshape(-1, 4), keys)
