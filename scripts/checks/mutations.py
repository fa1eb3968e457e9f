"""Broken input: valid bytes cut, flipped, repeated or replaced, as hypothesis draws them."""

import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import strategies as st

INTERESTING = [
    *(bytes([value]) * size for value in (0, 1, 127, 128, 255) for size in (1, 4, 8)),
    *(np.float64(value).tobytes() for value in (math.nan, math.inf, -math.inf, 1e308, -1.0)),
    *(int(value).to_bytes(8, "little") for value in (2**31, 2**40, 2**63)),
    *(
        b"nan",
        b"inf",
        b"-1",
        b"1e999",
        b"99999999999999999999",
        b"[]",
        b"{}",
        b"null",
        b'""',
        b"\n",
    ),
    b"../../etc/passwd",
    pickle.dumps(object),
]


def broken(valid: list[bytes]) -> st.SearchStrategy[bytes]:
    """Valid inputs with up to four edits, or any bytes at all."""
    place = st.integers(0, 2**16)
    piece = st.sampled_from(INTERESTING) | st.binary(max_size=12)
    edit = (
        st.tuples(st.just(flip), place, st.integers(0, 7))
        | st.tuples(st.just(cut), place, place)
        | st.tuples(st.just(shorten), place, st.none())
        | st.tuples(st.just(overwrite), place, piece)
        | st.tuples(st.just(insert), place, piece)
        | st.tuples(st.just(repeat), place, place)
    )
    edited = st.tuples(st.sampled_from(valid), st.lists(edit, min_size=1, max_size=4)).map(apply)
    return edited | st.binary(max_size=200)


def apply(case: tuple[bytes, list[tuple[Callable[..., bytes], int, Any]]]) -> bytes:
    """The edited input; places count round and round."""
    data, edits = case
    for edit, place, value in edits:
        data = edit(data, place % (len(data) + 1), value)
    return data


def flip(data: bytes, place: int, bit: int) -> bytes:
    """One bit the other way."""
    return (
        data[:place]
        + bytes(byte ^ 1 << bit for byte in data[place : place + 1])
        + data[place + 1 :]
    )


def cut(data: bytes, place: int, size: int) -> bytes:
    """Some bytes left out."""
    return data[:place] + data[place + size % 64 :]


def shorten(data: bytes, place: int, _: None) -> bytes:
    """The end left out."""
    return data[:place]


def overwrite(data: bytes, place: int, piece: bytes) -> bytes:
    """Some bytes replaced."""
    return data[:place] + piece + data[place + len(piece) :]


def insert(data: bytes, place: int, piece: bytes) -> bytes:
    """Some bytes more."""
    return data[:place] + piece + data[place:]


def repeat(data: bytes, place: int, size: int) -> bytes:
    """Some bytes twice."""
    return data[: place + size % 64] + data[place:]
