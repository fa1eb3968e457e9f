"""Messages that are read together, and where they come from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np


class Piece(NamedTuple):
    """Messages that stand together in a file, and the range of their keys."""

    low: int
    high: int  # the largest key, itself included
    size: int  # [bytes]
    source: Any  # what a loader is called with
    rank: int = 0  # of messages of one key, those of the lowest rank come first


class Block(NamedTuple):
    """Messages in the order of their keys."""

    data: bytes
    rows: np.ndarray  # (n, 4) int64: topic's number, log time, first and last byte in data
    keys: np.ndarray  # (n,) int64

    def packed(self) -> Block:
        """The same, the messages' bytes by themselves where they are few among others."""
        used = int((self.rows[:, 3] - self.rows[:, 2]).sum())
        return self if used >= len(self.data) // 2 else self.repacked()

    def repacked(self) -> Block:
        """The same, the messages' bytes one after the other and nothing else."""
        data = b"".join([self.data[first:last] for first, last in self.rows[:, 2:].tolist()])
        ends = np.cumsum(self.rows[:, 3] - self.rows[:, 2])
        rows = self.rows.copy()
        rows[:, 2], rows[:, 3] = ends - (rows[:, 3] - rows[:, 2]), ends
        return Block(data, rows, self.keys)


def in_order(blocks: Sequence[Block]) -> Block:
    """All blocks as one, in the order of keys; messages of one key in the blocks' order."""
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
