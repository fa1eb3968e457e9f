"""Messages as bytes without ROS: the CDR encoding of ROS 2, compiled from the .msg texts.

A recording contains with each topic the layout of its messages (`ros2msg`: the .msg text and those
of all messages inside it), so a `Codec` made of that text reads recordings of any age. Messages
of fixed lengths are also numpy structured types (`Codec.dtype`): thousands of them are read or
written at once.

rosbags' type system (0.11.9) in place of the half that reads and writes single messages is no
faster (CHANGELOG has the figures), and runs Python code that it makes of a bag's definition.

Source: DDS-XTypes 1.3, 7.4.3.5 "PLAIN_CDR" (XCDR version 1), little-endian, as Fast DDS and
rmw_fastrtps use it; https://mcap.dev/spec/registry for `ros2msg`.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire.definitions import PRIMITIVES, Field, definition, parsed, short

HEADER = b"\x00\x01\x00\x00"
"""CDR, little-endian, no options; alignment counts from its end."""
PAYLOAD = 4  # [bytes] RTPS sends whole words: so padded, messages arrive as they were sent
_COUNT = PRIMITIVES["uint32"]
_MOST_FIELDS = 10_000
"""Of one message, those of the messages inside it counted in: definitions can nest without end."""


class Codec:
    """How the messages of one type become bytes and values.

    Attributes:
        message_type: for example "keepaway_msgs/msg/Episode".
        definition: the text it was made of.
    """

    def __init__(self, message_type: str, definition: str) -> None:
        """Read the definition.

        Raises:
            KeepawayError: a text that is no ros2msg definition, or not a whole one.
        """
        self.message_type, self.definition = message_type, definition
        self._messages = parsed(message_type, definition)
        self._root = self._messages[short(message_type)]

    def encode(self, values: Mapping[str, Any]) -> bytes:
        """The message with these values; what is not named is 0, empty, or the like.

        Raises:
            KeepawayError: a field that the message has not, or a value that does not fit it.
        """
        out = bytearray(HEADER)
        try:
            self._write(out, self._root, values)
        except (struct.error, TypeError, AttributeError) as error:
            raise KeepawayError(f"cannot encode {self.message_type}: {error}") from error
        return bytes(out) + bytes(-len(out) % PAYLOAD)

    def decode(self, data: bytes) -> dict[str, Any]:
        """The values of a message: numbers, strings, lists, and dicts for messages inside it.

        Raises:
            KeepawayError: bytes that are not this message.
        """
        if data[:2] != HEADER[:2]:
            raise KeepawayError(f"{self.message_type}: not little-endian CDR: {data[:4]!r}")
        try:
            return self._read(_Cursor(data), self._root)
        except (struct.error, ValueError, OverflowError, RecursionError) as error:
            raise KeepawayError(f"{len(data)} bytes are no {self.message_type}: {error}") from error

    def dtype(self, lengths: Mapping[str, int], size: int = 0) -> np.dtype[np.void]:
        """All messages whose sequences have these lengths, as one structured type.

        A field `stamp` with parts is named `stamp.sec`, `stamp.nanosec`; a sequence or string
        `ages` comes with `ages.length`. Bytes between the fields are padding.

        Args:
            lengths: of the message's sequences and strings.
            size: bytes of a message, if they may be padded otherwise than `encode` does.

        Raises:
            KeepawayError: the message has sequences of strings or of messages.
        """
        try:
            return self._laid_out(self._leaves(self._root, "", lengths), size)
        except (RecursionError, OverflowError, ValueError, MemoryError) as error:
            raise KeepawayError(f"{self.message_type} has no layout: {error}") from error

    def front(self, lengths: Mapping[str, int]) -> np.dtype[np.void]:
        """The fields that have one place in all messages whose first sequences have these lengths.

        It ends before the first string, with the length of the first sequence that is not named.

        Args:
            lengths: of sequences.

        Raises:
            KeepawayError: the definition nests without end.
        """
        try:
            return self._laid_out(self._front(lengths), 0)
        except (RecursionError, OverflowError, ValueError, MemoryError) as error:
            raise KeepawayError(f"{self.message_type} has no layout: {error}") from error

    def lengths(self, values: Mapping[str, Any]) -> dict[str, int]:
        """The lengths of a decoded message's sequences and strings, for `dtype`.

        A string's is that of its bytes with the one that ends it.
        """
        return dict(self._lengths(self._root, "", values))

    def empty(self, count: int, lengths: Mapping[str, int]) -> np.ndarray:
        """(count,) messages of `dtype(lengths)` with every value 0: to fill, then `rows`."""
        dtype = self.dtype(lengths)
        messages = np.zeros(count, dtype)
        messages.view(np.uint8).reshape(count, dtype.itemsize)[:, : len(HEADER)] = list(HEADER)
        for name, length in lengths.items():
            messages[f"{name}.length"] = length
        return messages

    def is_laid_out_like(self, other: Codec) -> bool:
        """Whether the same bytes mean the same to both, field by field and name by name."""
        return self._messages == other._messages

    def _is_fixed(self, field: Field) -> bool:
        """Whether it has the same length in every message, and is not an array of messages."""
        if field.type in PRIMITIVES:
            return not field.is_array or field.size is not None
        if field.type == "string" or field.is_array:
            return False
        return all(map(self._is_fixed, self._messages[field.type]))

    def _front(self, lengths: Mapping[str, int]) -> Iterator[tuple[str, Any, int]]:
        for field in self._root:
            if field.is_array and field.size is None and field.name not in lengths:
                yield f"{field.name}.length", "<u4", 4
                return
            is_known = field.type in PRIMITIVES and field.name in lengths
            if not is_known and not self._is_fixed(field):
                return
            yield from self._leaves([field], "", lengths)

    @staticmethod
    def _laid_out(leaves: Iterator[tuple[str, Any, int]], size: int) -> np.dtype[np.void]:
        names, formats, offsets = [], [], []
        position = len(HEADER)
        for name, format_, alignment in leaves:
            position = _aligned(position, alignment)
            names.append(name)
            formats.append(format_)
            offsets.append(position)
            position += np.dtype(format_).itemsize
            if len(names) > _MOST_FIELDS:
                raise OverflowError(f"more than {_MOST_FIELDS} fields")
        size = size or _aligned(position, PAYLOAD)
        return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})

    def _lengths(
        self, fields: Sequence[Field], prefix: str, values: Mapping[str, Any]
    ) -> Iterator[tuple[str, int]]:
        for field in fields:
            name, value = prefix + field.name, values[field.name]
            if field.is_array and field.size is None:
                yield name, len(value)
            elif field.type == "string" and not field.is_array:
                yield name, len(value.encode()) + 1
            elif field.type not in PRIMITIVES and not field.is_array:
                yield from self._lengths(self._messages[field.type], f"{name}.", value)

    def _write(self, out: bytearray, fields: Sequence[Field], values: Mapping[str, Any]) -> None:
        unknown = values.keys() - {field.name for field in fields}
        if unknown:
            raise KeepawayError(f"{self.message_type} has no field {', '.join(sorted(unknown))}")
        for field in fields:
            if not field.is_array:
                self._write_one(out, field.type, values.get(field.name))
                continue
            items = values.get(field.name, [0] * field.size if field.size else ())
            if field.size is None:
                _pack(out, _COUNT, len(items))
            elif len(items) != field.size:
                raise TypeError(f"{field.name} takes {field.size} values, not {len(items)}")
            for item in items:
                self._write_one(out, field.type, item)

    def _write_one(self, out: bytearray, type_: str, value: Any) -> None:
        if type_ in PRIMITIVES:
            _pack(out, PRIMITIVES[type_], value or 0)
        elif type_ == "string":
            text = (value or "").encode() + b"\0"
            _pack(out, _COUNT, len(text))
            out += text
        else:
            self._write(out, self._messages[type_], value or {})

    def _read(self, cursor: _Cursor, fields: Sequence[Field]) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for field in fields:
            cursor.spend()
            if not field.is_array:
                values[field.name] = self._read_one(cursor, field.type)
                continue
            count = cursor.unpack(_COUNT) if field.size is None else field.size
            cursor.check_count(count)
            if field.type in PRIMITIVES:
                values[field.name] = cursor.unpack_many(PRIMITIVES[field.type], count)
            else:
                values[field.name] = [self._read_one(cursor, field.type) for _ in range(count)]
                cursor.spend(count)
        return values

    def _read_one(self, cursor: _Cursor, type_: str) -> Any:
        if type_ in PRIMITIVES:
            return cursor.unpack(PRIMITIVES[type_])
        if type_ == "string":
            return cursor.string()
        return self._read(cursor, self._messages[type_])

    def _leaves(
        self, fields: Sequence[Field], prefix: str, lengths: Mapping[str, int]
    ) -> Iterator[tuple[str, Any, int]]:
        """Name, numpy format and alignment of every number in the message, in order."""
        for field in fields:
            name = prefix + field.name
            if field.is_array and field.size is None:
                yield f"{name}.length", "<u4", 4
            if field.type in PRIMITIVES:
                number = np.dtype(PRIMITIVES[field.type].format)
                size = field.size if field.size is not None else lengths.get(name)
                if not field.is_array:
                    yield name, number, number.itemsize
                elif size:
                    yield name, (number, (size,)), number.itemsize
            elif field.type == "string" and not field.is_array:
                yield f"{name}.length", "<u4", 4
                if lengths.get(name):
                    yield name, f"S{lengths[name]}", 1
            elif field.is_array:
                raise KeepawayError(f"{self.message_type}.{name} has no fixed place")
            else:
                yield from self._leaves(self._messages[field.type], f"{name}.", lengths)


@functools.lru_cache(maxsize=256)
def codec(message_type: str, definition_text: str | None = None) -> Codec:
    """The codec of a message type, by an installed definition or by the one that is given.

    Raises:
        KeepawayError: as `definition` and `Codec` do.

    >>> episode = codec("keepaway_msgs/msg/Episode")
    >>> data = episode.encode({"number": 7, "duration": 8.4})
    >>> len(data), episode.decode(data)["duration"]
    (76, 8.4)
    """
    return Codec(message_type, definition_text or definition(message_type))


def _aligned(position: int, size: int) -> int:
    return position + (len(HEADER) - position) % size


def _pack(out: bytearray, number: struct.Struct, value: float) -> None:
    out += bytes(_aligned(len(out), number.size) - len(out))
    out += number.pack(value)


class _Cursor:
    """A place in a message's bytes, moving forward."""

    def __init__(self, data: bytes) -> None:
        self._data, self._position = data, len(HEADER)
        self._left = len(data) + _MOST_FIELDS

    def spend(self, count: int = 1) -> None:
        """Refuse a message of endlessly many fields: empty ones take no bytes."""
        self._left -= count
        if self._left < 0:
            raise struct.error("more fields than bytes")

    def unpack(self, number: struct.Struct) -> Any:
        start = _aligned(self._position, number.size)
        self._position = start + number.size
        return number.unpack_from(self._data, start)[0]

    def unpack_many(self, number: struct.Struct, count: int) -> list[Any]:
        if not count:
            return []
        start = _aligned(self._position, number.size)
        self._position = start + count * number.size
        return list(struct.unpack_from(f"<{count}{number.format[1:]}", self._data, start))

    def check_count(self, count: int) -> None:
        """Refuse a sequence that is longer than the message has bytes."""
        if count > len(self._data):
            raise struct.error(f"a sequence of {count} in a message of {len(self._data)} bytes")

    def string(self) -> str:
        length = self.unpack(_COUNT)
        start, self._position = self._position, self._position + length
        if self._position > len(self._data):
            raise struct.error("a string ends beyond the message")
        return self._data[start : self._position - 1].decode()
