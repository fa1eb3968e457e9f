"""Command-line options and ROS arguments of a dataclass: one declaration for both. No ROS."""

from __future__ import annotations

import argparse
import dataclasses
import inspect
import json
import re
from collections.abc import Collection, Mapping, Sequence

from keepaway_sim.errors import KeepawayError

_COMMENTED_FIELD = re.compile(r"^ {4}(\w+): .*?#\s*(.+)$", re.MULTILINE)


def add_options(
    parser: argparse.ArgumentParser, settings: type, without: Collection[str] = ()
) -> None:
    """Give a parser an option for every field of a dataclass; its comment is the option's help.

    Options that are not given are not in the parsed namespace.

    Args:
        parser: that gets them.
        settings: the dataclass.
        without: fields that the command line says otherwise.
    """
    comments = dict(_COMMENTED_FIELD.findall(inspect.getsource(settings)))
    group = parser.add_argument_group(settings.__name__)
    for field in dataclasses.fields(settings):
        if field.name in without:
            continue
        comment = comments.get(field.name, "").replace("%", "%%")
        group.add_argument(
            "--" + field.name.strip("_").replace("_", "-"),
            dest=field.name,
            type=_truth if isinstance(field.default, bool) else type(field.default),
            default=argparse.SUPPRESS,
            metavar=type(field.default).__name__.upper(),
            help=f"{comment} (default {field.default!r})",
        )


def parse_node_arguments(parser: argparse.ArgumentParser, arguments: Sequence[str]) -> list[str]:
    """The arguments of a node: its parser's options as parameters, then what is ROS's already.

    Args:
        parser: of the options before `--ros-args`; `--name` is the node's name.
        arguments: the command line.
    """
    at = arguments.index("--ros-args") if "--ros-args" in arguments else len(arguments)
    options = vars(parser.parse_args(arguments[:at]))
    return [*ros_arguments(options, options.pop("name", "")), *arguments[at:]]


def ros_arguments(
    parameters: Mapping[str, object],
    name: str = "",
    namespace: str = "",
    remaps: Mapping[str, str] | None = None,
) -> list[str]:
    """Command-line arguments that set a node's name, namespace, parameters and remapped topics.

    >>> ros_arguments({"speed": 0.0, "profile": "2005"}, name="simulator")
    ['--ros-args', '-r', '__node:=simulator', '-p', 'speed:=0.0', '-p', 'profile:="2005"']
    """
    renamed = {"__node": name, "__ns": namespace, **(remaps or {})}
    arguments = ["--ros-args"]
    for old, new in renamed.items():
        if new:
            arguments += ["-r", f"{old}:={new}"]
    for parameter, value in parameters.items():
        arguments += ["-p", f"{parameter}:={json.dumps(value)}"]
    return arguments


def numbers_in(text: str) -> set[int]:
    """The numbers in "7", "3-9" or "0,5,10-12".

    Raises:
        KeepawayError: anything else.

    >>> sorted(numbers_in("0,5,10-12"))
    [0, 5, 10, 11, 12]
    """
    numbers: set[int] = set()
    for part in text.split(","):
        found = re.fullmatch(r"\s*(\d{1,9})(?:-(\d{1,9}))?\s*", part)
        if not found:
            raise KeepawayError(f"{text!r}: write numbers like 7 or 3-9 or 0,5,10-12")
        first, last = int(found[1]), int(found[2] or found[1])
        if last < first:
            raise KeepawayError(f"{text!r}: {first}-{last} goes backwards; write {last}-{first}")
        numbers |= set(range(first, last + 1))
    return numbers


def _truth(word: str) -> bool:
    """True or false, as ROS writes them."""
    if word not in ("true", "false"):
        raise argparse.ArgumentTypeError(f"{word!r}: write true or false")
    return word == "true"
