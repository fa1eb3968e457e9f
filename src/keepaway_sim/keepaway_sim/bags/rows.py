"""Messages of a block as structured arrays: their fronts, or all of them by known lengths."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire.cdr import HEADER, Codec, codec


def fronts(layout: Codec, data: bytes, rows: np.ndarray) -> np.ndarray:
    """(n,) the fields that messages begin with, up to the first of their sequences.

    Args:
        layout: of the messages.
        data, rows: of a block, rows of this type only.

    Raises:
        KeepawayError: a message that is shorter.
    """
    return _taken(layout, layout.front({}), data, rows)


def whole(layout: Codec, data: bytes, rows: np.ndarray, lengths: Mapping[str, int]) -> np.ndarray:
    """(n,) messages whose sequences have these lengths, as an array of `Codec.dtype`.

    Sequences that the definition has not are not looked for (`check_fields` knows who needs them).

    Raises:
        KeepawayError: a message whose sequences have not.
    """
    taken = _taken(layout, layout.front(lengths), data, rows)
    known = set(taken.dtype.names or ())
    for name, length in lengths.items():
        if f"{name}.length" not in known:
            continue
        found = taken[f"{name}.length"]
        if (found != length).any():
            other = int(found[found != length][0])
            raise KeepawayError(f"{layout.message_type}: {other} {name}, where {length} should be")
    return taken


def laid_out(layout: np.dtype[np.void], data: bytes, rows: np.ndarray) -> np.ndarray:
    """(n,) bool: which messages are long enough for a layout, and have its sequences' lengths.

    Args:
        layout: of `Codec.front`.
        data, rows: of a block.
    """
    size = _without_padding(layout).itemsize
    alike: np.ndarray = rows[:, 3] - rows[:, 2] >= size
    for name, length in _lengths_in(layout).items():
        at = np.flatnonzero(alike)
        alike[at] = field(layout, f"{name}.length", data, rows[at]) == length
    return alike


def field(layout: np.dtype[np.void], name: str, data: bytes, rows: np.ndarray) -> np.ndarray:
    """(n,) one field of messages that are long enough for the layout."""
    assert layout.fields
    kind, offset = layout.fields[name][:2]
    if not len(rows):
        return np.zeros(0, kind)
    raw = np.frombuffer(data, np.uint8)
    window = np.lib.stride_tricks.sliding_window_view(raw, kind.itemsize)
    taken: np.ndarray = window[rows[:, 2] + offset].view(kind)[:, 0]
    return taken


def check_fields(layout: Codec, names: tuple[str, ...], lengths: Mapping[str, int]) -> None:
    """Whether a definition in a bag has the fields that reading needs, of the types they have.

    Raises:
        KeepawayError: it has not.
    """
    ours, theirs = codec(layout.message_type).front(lengths), layout.front(lengths)
    for name in names:
        if name not in (theirs.names or ()):
            raise KeepawayError(f"its definition of {layout.message_type} lacks {name}")
        if theirs[name] != ours[name]:
            raise KeepawayError(f"{name} of its {layout.message_type} has another type")


def _taken(layout: Codec, dtype: np.dtype[np.void], data: bytes, rows: np.ndarray) -> np.ndarray:
    """(n,) of a dtype, without the bytes that pad a message's end: not all writers write them."""
    unpadded = _without_padding(dtype)
    size = unpadded.itemsize
    if not len(rows):
        return np.zeros(0, unpadded)
    raw = np.frombuffer(data, np.uint8)
    if (rows[:, 3] - rows[:, 2] < size).any() or size > len(raw):
        raise KeepawayError(f"a {layout.message_type} of fewer than its {size} bytes")
    taken = np.lib.stride_tricks.sliding_window_view(raw, size)[rows[:, 2]]
    if (taken[:, :2] != list(HEADER[:2])).any():
        raise KeepawayError(f"a {layout.message_type} that is not little-endian CDR")
    made: np.ndarray = taken.view(unpadded)[:, 0]
    return made


def lengths(layout: Codec, data: bytes, rows: np.ndarray, name: str) -> np.ndarray:
    """(n,) the lengths of a sequence, the first one in the message."""
    found: np.ndarray = _taken(layout, layout.front({}), data, rows)[f"{name}.length"]
    return found


def _lengths_in(layout: np.dtype[np.void]) -> dict[str, int]:
    """The lengths that a layout gives sequences."""
    names = [
        name.removesuffix(".length") for name in layout.names or () if name.endswith(".length")
    ]
    sizes = {name: layout[name].shape[0] for name in layout.names or () if layout[name].shape}
    return {name: sizes.get(name, 0) for name in names}


def _without_padding(dtype: np.dtype[np.void]) -> np.dtype[np.void]:
    fields = {name: (entry[0], entry[1]) for name, entry in (dtype.fields or {}).items()}
    size = max((offset + kind.itemsize for kind, offset in fields.values()), default=len(HEADER))
    layout: Any = {
        "names": list(fields),
        "formats": [kind for kind, _ in fields.values()],
        "offsets": [offset for _, offset in fields.values()],
        "itemsize": size,
    }
    unpadded: np.dtype[np.void] = np.dtype(layout)
    return unpadded
