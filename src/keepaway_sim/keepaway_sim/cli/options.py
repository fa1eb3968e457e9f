"""Command-line options and ROS arguments of declared settings. No ROS."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any, TypeVar

from keepaway_sim.errors import KeepawayError
from keepaway_sim.settings import Setting, as_text, build, settings_of

Group = TypeVar("Group")


def add_options(
    parser: argparse.ArgumentParser,
    settings: type,
    only: Collection[str] = (),
    without: Collection[str] = (),
    with_defaults: bool = False,
) -> None:
    """Give a parser an option for every setting of a class, groups of settings included.

    `chosen` makes the settings of what was parsed.

    Args:
        parser: that gets them.
        settings: an attrs class whose fields are made by `setting`.
        only: names of those wanted; all if there are none.
        without: names of those that the command line asks for in another way.
        with_defaults: whether options that are not given are in the parsed namespace.
    """
    group = parser.add_argument_group(settings.__name__)
    for name, declared in settings_of(settings).items():
        if name not in without and (not only or name in only):
            _add_option(group, declared, declared.default if with_defaults else argparse.SUPPRESS)


def chosen(settings: type[Group], options: argparse.Namespace) -> Group:
    """The settings that a command line gave, with the defaults of those that it did not.

    Raises:
        SettingError: a value that is refused.
    """
    known = settings_of(settings)
    return build(settings, {n: value for n, value in vars(options).items() if n in known})


def option(name: str) -> str:
    """The option of a setting.

    >>> option("lambda_")
    '--lambda'
    """
    return "--" + name.strip("_").replace("_", "-")


def _add_option(group: Any, declared: Setting, otherwise: Any) -> None:
    """An option; a truth may be given without a value, too."""
    unit = f" [{declared.unit}]" if declared.unit else ""
    default = as_text(declared.default) if declared.default != "" else '""'
    help_text = f"{declared.text}{unit} (default {default})".replace("%", "%%")
    kind, spread = declared.kind, {"nargs": "?", "const": True} if declared.kind is bool else {}
    group.add_argument(
        *(option(name) for name in (declared.name, *declared.was)),
        dest=declared.name,
        type=_truth if kind is bool else kind,
        default=otherwise,
        metavar="|".join(declared.choices) or kind.__name__.upper(),
        help=help_text,
        **spread,
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
        arguments += ["-p", f"{parameter}:={json.dumps(value, allow_nan=False)}"]
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
