"""Messages of chunks that overlap, or stand in any order, brought into one order.

As much is read at once as fits a window: a range of keys (times, or moments of a match). A chunk is
read once for each window that it reaches into. Where that would be many chunks for every window,
they are sorted on the disk first (`spilling`): memory is bounded, whatever the order, and so is the
work.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import accumulate
from typing import Any

import numpy as np

from keepaway_sim.bags.blocks import Block, Piece, in_order
from keepaway_sim.bags.spilling import spilled

WINDOW_SIZE = 2**23  # [bytes] of messages that are brought into order together
DEEPEST = 8  # windows of messages that may reach over one key without sorting them first


def merged(pieces: Iterable[Piece], load: Callable[[Any], Block]) -> Iterator[Block]:
    """The messages of all pieces in the order of their keys; those of one key in given order.

    No key is in two blocks, unless its messages do not fit a window.

    Raises:
        KeepawayError: no room on the disk to sort them.
    """
    ranked = [piece._replace(rank=rank) for rank, piece in enumerate(pieces)]
    if _depth(ranked) <= DEEPEST * WINDOW_SIZE:
        yield from _merged(ranked, load)
    else:
        with spilled(ranked, load, WINDOW_SIZE) as (runs, load_run):
            yield from _merged(runs, load_run)


def _depth(pieces: Sequence[Piece]) -> int:
    """The most bytes of pieces that reach over one key and beyond."""
    wide = [piece for piece in pieces if piece.low < piece.high]
    edges = [(piece.low, piece.size) for piece in wide] + [(p.high, -p.size) for p in wide]
    return max(accumulate(size for _, size in sorted(edges)), default=0)


def _merged(pieces: Iterable[Piece], load: Callable[[Any], Block]) -> Iterator[Block]:
    waiting = sorted(pieces, key=lambda piece: piece.low)
    floor = -(2**63)
    while waiting:
        top = _first_top(waiting, floor)
        kept, top, only = _gather(waiting, load, floor, top)
        if only is not None:
            yield from kept
            yield from _rest_of(waiting[len(kept) :], load, only)
            floor = only + 1
        else:
            if sum(len(block.rows) for block in kept):
                ranks = [piece.rank for piece in waiting[: len(kept)]]
                order = sorted(range(len(kept)), key=ranks.__getitem__)
                yield in_order([kept[place] for place in order])
            if top is None:
                return
            floor = top
        waiting = [piece for piece in waiting if piece.high >= floor]


def _first_top(waiting: Sequence[Piece], floor: int) -> int | None:
    """Where the window ends that the first pieces fill; None: all of them fit."""
    size, lowest = 0, max(floor, waiting[0].low)
    for piece in waiting:
        if size >= WINDOW_SIZE and piece.low > lowest:
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
    """The messages of floor <= key < top."""
    wanted = block.keys >= floor
    if top is not None:
        wanted &= block.keys < top
    return Block(block.data, block.rows[wanted], block.keys[wanted]).packed()
