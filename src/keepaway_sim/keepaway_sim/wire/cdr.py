"""Messages as bytes without ROS: the CDR encoding of ROS 2, compiled from the .msg texts.

A recording contains with each topic the layout of its messages (`ros2msg`: the .msg text and those
of all messages inside it), so a `Codec` made of that text reads recordings of any age. Messages
of fixed lengths are also numpy structured types (`Codec.dtype`): thousands of them are read or
written at once.

Source: DDS-XTypes 1.3, 7.4.3.5 "PLAIN_CDR" (XCDR version 1), little-endian, as Fast DDS and
rmw_fastrtps use it; https://mcap.dev/spec/registry for `ros2msg`.
"""

from __future__ import annotations

import functools
import json
import os
import re
import struct
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from keepaway_sim.errors import KeepawayError

HEADER = b"\x00\x01\x00\x00"
"""CDR, little-endian, no options; alignment counts from its end."""
PAYLOAD = 4  # [bytes] RTPS sends whole words: so padded, messages arrive as they were sent
_SEPARATOR = "=" * 80
_SIZES = {
    "bool": "?", "byte": "B", "char": "B",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I",
    "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
_PRIMITIVES = {name: struct.Struct("<" + code) for name, code in _SIZES.items()}
_COUNT = _PRIMITIVES["uint32"]
_MOST_FIELDS = 10_000
"""Of one message, those of the messages inside it counted in: definitions can nest without end."""
_FIELD = re.compile(
    r"(?P<type>[A-Za-z][\w/]*)(?:<=\d+)?(?P<array>\[(?:<=)?(?P<size>\d*)\])?\s+"
    r"(?P<name>[a-z]\w*)(?:\s+(?P<default>\S.*))?$"
)


class Field(NamedTuple):
    """One field of a message."""

    name: str
    type: str  # a primitive, "string", or "package/Name"
    is_array: bool
    size: int | None  # of an array of fixed size


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
        self._messages = _parse(message_type, definition)
        self._root = self._messages[_short(message_type)]

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
        if field.type in _PRIMITIVES:
            return not field.is_array or field.size is not None
        if field.type == "string" or field.is_array:
            return False
        return all(map(self._is_fixed, self._messages[field.type]))

    def _front(self, lengths: Mapping[str, int]) -> Iterator[tuple[str, Any, int]]:
        for field in self._root:
            if field.is_array and field.size is None and field.name not in lengths:
                yield f"{field.name}.length", "<u4", 4
                return
            is_known = field.type in _PRIMITIVES and field.name in lengths
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
            elif field.type not in _PRIMITIVES and not field.is_array:
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
        if type_ in _PRIMITIVES:
            _pack(out, _PRIMITIVES[type_], value or 0)
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
            if field.type in _PRIMITIVES:
                values[field.name] = cursor.unpack_many(_PRIMITIVES[field.type], count)
            else:
                values[field.name] = [self._read_one(cursor, field.type) for _ in range(count)]
                cursor.spend(count)
        return values

    def _read_one(self, cursor: _Cursor, type_: str) -> Any:
        if type_ in _PRIMITIVES:
            return cursor.unpack(_PRIMITIVES[type_])
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
            if field.type in _PRIMITIVES:
                number = np.dtype("<" + _SIZES[field.type])
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


@functools.cache
def definition(message_type: str) -> str:
    """The .msg text of a type followed by those of all messages inside it, as MCAP wants them.

    Raises:
        KeepawayError: a type whose package is not installed.
    """
    texts: dict[str, str] = {}
    waiting = [message_type]
    while waiting:
        type_ = waiting.pop(0)
        if _short(type_) in texts:
            continue
        texts[_short(type_)] = _installed(type_, "msg").read_text().rstrip() + "\n"
        fields = _fields(type_, texts[_short(type_)])
        waiting += [f.type for f in fields if f.type not in _PRIMITIVES and f.type != "string"]
    root, *inside = texts.items()
    return root[1] + "".join(f"{_SEPARATOR}\nMSG: {name}\n{text}" for name, text in inside)


@functools.cache
def type_hash(message_type: str) -> str:
    """The hash by which ROS 2 tells two versions of a type apart (REP-2011): "RIHS01_..." .

    Raises:
        KeepawayError: a type whose package is not installed.
    """
    described = json.loads(_installed(message_type, "json").read_text())
    for entry in described["type_hashes"]:
        if entry["type_name"] == message_type:
            return str(entry["hash_string"])
    raise KeepawayError(f"{message_type}: its description has no hash of it")


def _installed(message_type: str, suffix: str) -> Path:
    package, _, name = _short(message_type).partition("/")
    if not re.fullmatch(r"[a-z]\w*/[A-Z]\w*", f"{package}/{name}"):
        raise KeepawayError(f"{message_type[:100]!r} is no message's type")
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    for prefix in filter(None, prefixes):
        path = Path(prefix) / "share" / package / "msg" / f"{name}.{suffix}"
        if path.is_file():
            return path
    raise KeepawayError(
        f"{message_type}: share/{package}/msg/{name}.{suffix} is in none of {', '.join(prefixes)};"
        " run scripts/setup"
    )


def _parse(message_type: str, text: str) -> dict[str, list[Field]]:
    root, *inside = text.split(_SEPARATOR + "\n")
    messages = {_short(message_type): _fields(message_type, root)}
    for part in inside:
        head, _, body = part.partition("\n")
        if not head.startswith("MSG: "):
            raise KeepawayError(f"{message_type}: expected 'MSG: package/Name', found {head!r}")
        name = head.removeprefix("MSG: ").strip()
        messages[_short(name)] = _fields(name, body)
    for fields in messages.values():
        for field in fields:
            if field.type not in {*_PRIMITIVES, "string", *messages}:
                raise KeepawayError(f"{message_type}: its definition lacks {field.type}")
    return messages


def _fields(message_type: str, text: str) -> list[Field]:
    package = _short(message_type).split("/")[0]
    fields = []
    for line in text.splitlines():
        entry = line.partition("#")[0].strip()
        if not entry or re.match(r"\S+\s+[A-Z][A-Z0-9_]*\s*=", entry):
            continue  # nothing, or a constant
        found = _FIELD.match(entry)
        if not found:
            raise KeepawayError(f"{message_type}: cannot read {line.strip()!r}")
        size = _array_size(message_type, found)
        type_ = _resolved(found["type"], package)
        fields.append(Field(found["name"], type_, found["array"] is not None, size))
    return fields


def _array_size(message_type: str, found: re.Match[str]) -> int | None:
    """How many entries an array of fixed size has; None for a sequence, and for no array."""
    if not found["size"] or "<=" in found["array"]:
        return None
    if len(found["size"]) > 9:
        raise KeepawayError(f"{message_type}: {found['name']} has {found['size'][:9]}.. entries")
    return int(found["size"])


def _resolved(type_: str, package: str) -> str:
    if type_ in _PRIMITIVES or type_ == "string":
        return type_
    return _short(type_) if "/" in type_ else f"{package}/{type_}"


def _short(message_type: str) -> str:
    """For example "keepaway_msgs/Match" of "keepaway_msgs/msg/Match"."""
    return message_type.replace("/msg/", "/")


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
