"""Messages of overlapping pieces come in the order of keys, within bounds of memory and work."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keepaway_sim.bags import merging
from keepaway_sim.bags.blocks import Block, Piece
from keepaway_sim.bags.merging import merged
from keepaway_sim.errors import KeepawayError

SIZE = 8  # [bytes] of a message: the number of its place among all


def block_of(keys, first):
    data = b"".join(int(first + n).to_bytes(SIZE, "little") for n in range(len(keys)))
    ends = SIZE * np.arange(1, len(keys) + 1)
    rows = np.stack([0 * ends, keys, ends - SIZE, ends], axis=1)
    return Block(data, rows, np.array(keys, dtype=np.int64))


def pieces_of(lists):
    firsts = np.cumsum([0, *map(len, lists)])
    blocks = [block_of(keys, first) for keys, first in zip(lists, firsts, strict=False)]
    return [
        Piece(min(keys), max(keys), SIZE * len(keys), block)
        for keys, block in zip(lists, blocks, strict=True)
    ]


def numbers(blocks):
    return [
        int.from_bytes(block.data[first:last], "little")
        for block in blocks
        for first, last in block.rows[:, 2:].tolist()
    ]


@pytest.fixture(autouse=True)
def small_windows(monkeypatch):
    monkeypatch.setattr(merging, "WINDOW_SIZE", 10 * SIZE)


@given(st.lists(st.lists(st.integers(0, 300), min_size=1, max_size=40), max_size=40))
def test_messages_come_in_the_order_of_keys_and_then_as_given(lists):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(merging, "WINDOW_SIZE", 30 * SIZE)
        found = numbers(merged(pieces_of(lists), lambda block: block))
    keys = np.array([key for each in lists for key in each], dtype=np.int64)
    counts = Counter(keys.tolist())
    assert sorted(found) == list(range(len(keys)))
    assert (np.diff(keys[found]) >= 0).all()
    if max(counts.values(), default=0) <= 30:  # the messages of one key fit a window
        assert found == np.argsort(keys, kind="stable").tolist()


def test_each_piece_is_read_once_where_all_reach_over_all():
    keys = np.random.default_rng(1).permutation(3000)
    loaded = Counter[int]()

    def load(block):
        loaded[id(block)] += 1
        return block

    pieces = pieces_of(keys.reshape(300, 10).tolist())
    found = numbers(merged(pieces, load))
    assert keys[found].tolist() == list(range(3000))
    assert set(loaded.values()) == {1}


def test_a_full_disk_is_one_line_that_names_the_way_out(full_disk):
    pieces = pieces_of(np.random.default_rng(1).permutation(30_000).reshape(300, 100).tolist())
    full_disk(4096)
    with pytest.raises(KeepawayError, match=r"no room to sort a bag's messages .*: set TMPDIR"):
        numbers(merged(pieces, lambda block: block))
