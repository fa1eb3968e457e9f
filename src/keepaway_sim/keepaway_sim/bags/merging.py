"""Messages of chunks that overlap, or stand in any order, brought into one order.

As much is read at once as fits a window: a range of keys (times, or moments of a match) that few
chunks have messages of. Where many chunks have, the window is made smaller, and chunks are read
once for each window that they reach into: memory is bounded, whatever the order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

WINDOW_SIZE = 2**24  # [bytes] of messages that are brought into order together


class Piece(NamedTuple):
    """Messages that stand together in a file, and the range of their keys."""

    low: int
    high: int  # the largest key, itself included
    size: int  # [bytes]
    source: Any  # what `load` is called with


class Block(NamedTuple):
    """Messages in the order of their keys."""

    data: bytes
    rows: np.ndarray  # (n, 4) int64: topic's number, log time, first and last byte in data
    keys: np.ndarray  # (n,) int64


def merged(pieces: Iterable[Piece], load: Callable[[Any], Block]) -> Iterator[Block]:
    """The messages of all pieces in the order of their keys; those of one key in given order.

    No key is in two blocks, unless its messages do not fit a window.
    """
    waiting = sorted(pieces, key=lambda piece: piece.low)
    floor = -(2**63)
    while waiting:
        top = _first_top(waiting)
        kept, top, only = _gather(waiting, load, floor, top)
        if only is not None:
            yield from kept
            yield from _rest_of(waiting[len(kept) :], load, only)
            floor = only + 1
        else:
            if sum(len(block.rows) for block in kept):
                yield _sorted(kept)
            if top is None:
                return
            floor = top
        waiting = [piece for piece in waiting if piece.high >= floor]


def _first_top(waiting: Sequence[Piece]) -> int | None:
    """Where the window ends that the first pieces fill; None: all of them fit."""
    size = 0
    for piece in waiting:
        if size >= WINDOW_SIZE and piece.low > waiting[0].low:
            return piece.low
        size += piece.size
    return None


def _gather(
    waiting: Sequence[Piece], load: Callable[[Any], Block], floor: int, top: int | None
) -> tuple[list[Block], int | None, int | None]:
    """The messages of floor <= key < top, with a lower top where they do not fit.

    Returns:
        them; the top; and where even those of one key do not fit, that key: then there may be
        more of it in the pieces that come after the gathered.
    """
    kept: list[Block] = []
    size = 0
    for piece in waiting:
        if top is not None and piece.low >= top:
            break
        block = _cut(load(piece.source), floor, top)
        kept.append(block)
        size += len(block.data)
        if size > 2 * WINDOW_SIZE:
            keys = np.concatenate([block.keys for block in kept])
            low, middle = int(keys.min()), int(np.median(keys))
            top = middle if middle > low else low + 1
            kept = [_cut(block, floor, top) for block in kept]
            size = sum(len(block.data) for block in kept)
            if size > 2 * WINDOW_SIZE and top == low + 1:
                return kept, top, low
    return kept, top, None


def _rest_of(pieces: Sequence[Piece], load: Callable[[Any], Block], key: int) -> Iterator[Block]:
    """The messages of one key in some pieces."""
    for piece in pieces:
        if piece.low <= key <= piece.high:
            block = _cut(load(piece.source), key, key + 1)
            if len(block.rows):
                yield block


def _cut(block: Block, floor: int, top: int | None) -> Block:
    """The messages of floor <= key < top; their bytes by themselves, where they are few."""
    data, rows, keys = block
    wanted = keys >= floor
    if top is not None:
        wanted &= keys < top
    rows, keys = rows[wanted], keys[wanted]
    used = int((rows[:, 3] - rows[:, 2]).sum())
    if used >= len(data) // 2:
        return Block(data, rows, keys)
    packed = b"".join([data[first:last] for first, last in rows[:, 2:].tolist()])
    ends = np.cumsum(rows[:, 3] - rows[:, 2])
    rows = rows.copy()
    rows[:, 2], rows[:, 3] = ends - (rows[:, 3] - rows[:, 2]), ends
    return Block(packed, rows, keys)


def _sorted(blocks: Sequence[Block]) -> Block:
    """All blocks as one, in the order of keys."""
    if len(blocks) == 1:
        data, rows, keys = blocks[0]
    else:
        starts = np.cumsum([0, *(len(block.data) for block in blocks)])
        data = b"".join(block.data for block in blocks)
        rows = np.concatenate([block.rows for block in blocks])
        keys = np.concatenate([block.keys for block in blocks])
        shift = np.repeat(starts[:-1], [len(block.rows) for block in blocks])
        rows[:, 2:] += shift[:, None]
    if (np.diff(keys) < 0).any():
        order = np.argsort(keys, kind="stable")
        rows, keys = rows[order], keys[order]
    return Block(data, rows, keys)
