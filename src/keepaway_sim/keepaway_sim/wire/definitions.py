"""Definitions of messages: the .msg texts that are installed, or that a recording carries.

Source: https://mcap.dev/spec/registry for `ros2msg`, a type's text followed by those of all
messages inside it.
"""

from __future__ import annotations

import functools
import json
import os
import re
import struct
import sys
from pathlib import Path
from typing import NamedTuple

from keepaway_sim.errors import KeepawayError

_SIZES = {
    "bool": "?", "byte": "B", "char": "B",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I",
    "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
PRIMITIVES = {name: struct.Struct("<" + code) for name, code in _SIZES.items()}
_SEPARATOR = "=" * 80
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
        if short(type_) in texts:
            continue
        texts[short(type_)] = _installed(type_, "msg").read_text().rstrip() + "\n"
        fields = _fields(type_, texts[short(type_)])
        waiting += [f.type for f in fields if f.type not in PRIMITIVES and f.type != "string"]
    root, *inside = texts.items()
    return root[1] + "".join(f"{_SEPARATOR}\nMSG: {name}\n{text}" for name, text in inside)


@functools.cache
def type_hash(message_type: str) -> str:
    """The hash by which ROS 2 distinguishes two versions of a type (REP-2011): "RIHS01_..." .

    Raises:
        KeepawayError: a type whose package is not installed.
    """
    described = json.loads(_installed(message_type, "json").read_text())
    for entry in described["type_hashes"]:
        if entry["type_name"] == message_type:
            return str(entry["hash_string"])
    raise KeepawayError(f"{message_type}: its description has no hash of it")


def _installed(message_type: str, suffix: str) -> Path:
    package, _, name = short(message_type).partition("/")
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


def parsed(message_type: str, text: str) -> dict[str, list[Field]]:
    """The fields of a type and of all messages inside it, by their short names.

    Raises:
        KeepawayError: a text that cannot be read, or lacks a type.
    """
    root, *inside = text.split(_SEPARATOR + "\n")
    messages = {short(message_type): _fields(message_type, root)}
    for part in inside:
        head, _, body = part.partition("\n")
        if not head.startswith("MSG: "):
            raise KeepawayError(f"{message_type}: expected 'MSG: package/Name', found {head!r}")
        name = head.removeprefix("MSG: ").strip()
        messages[short(name)] = _fields(name, body)
    for fields in messages.values():
        for field in fields:
            if field.type not in {*PRIMITIVES, "string", *messages}:
                raise KeepawayError(f"{message_type}: its definition lacks {field.type}")
    return messages


def _fields(message_type: str, text: str) -> list[Field]:
    package = short(message_type).split("/")[0]
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
    if type_ in PRIMITIVES or type_ == "string":
        return type_
    return short(type_) if "/" in type_ else f"{package}/{type_}"


def short(message_type: str) -> str:
    """For example "keepaway_msgs/Match" of "keepaway_msgs/msg/Match"."""
    return message_type.replace("/msg/", "/")
