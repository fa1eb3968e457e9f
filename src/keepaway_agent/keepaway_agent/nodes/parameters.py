"""Settings as the parameters of a node, each with its own descriptor.

A parameter is read as its declaration wants it: a whole number where a floating-point one is
declared, a number where a text is (`profile:=2005`), a value under a name that the setting had
before. What lies outside the range is refused in one line with what may be given.

The packages of the world and of the agents share no code, so each has this same file; a contract
test holds the two together.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection
from numbers import Real
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    ParameterType,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from keepaway_agent.errors import SettingError
from keepaway_agent.settings import Setting, build, changed, flat, settings_of

Group = TypeVar("Group")

TYPES = {
    bool: ParameterType.PARAMETER_BOOL,
    int: ParameterType.PARAMETER_INTEGER,
    float: ParameterType.PARAMETER_DOUBLE,
    str: ParameterType.PARAMETER_STRING,
}
LARGEST = 2**63 - 1
"""The largest whole number of a parameter."""


def declare_settings(
    node: Node,
    settings: type[Group],
    changeable: Collection[str] = (),
    on_change: Callable[[Group], None] | None = None,
    default: Group | None = None,
) -> Group:
    """Declare every setting of a class as a parameter of a node, and read them.

    Args:
        node: whose parameters.
        settings: an attrs class whose fields are made by `setting`.
        changeable: those that may be set while the node runs; the others are read-only.
        on_change: called with the settings after some have been changed.
        default: what holds where nothing is given, instead of the declared defaults.

    Raises:
        SettingError: a value that is refused.
    """
    before = {} if default is None else flat(default)
    values = {
        name: _declare(node, declared, before.get(name, declared.default), name not in changeable)
        for name, declared in settings_of(settings).items()
    }
    made = build(settings, values)
    if changeable:
        _Follower(node, made, on_change or (lambda _: None))
    return made


def warn_of_unknown(node: Node, settings: Collection[type]) -> None:
    """Warn of parameters that were given and that no node reads: ROS itself says nothing.

    Args:
        node: with all its parameters declared.
        settings: the classes of those.
    """
    declared = [each for group in settings for each in settings_of(group).values()]
    known = {name for each in declared for name in (each.name, *each.was)}
    for name in node._parameter_overrides:  # rclpy shows them in no other way
        if name in known or node.has_parameter(name):
            continue
        near = difflib.get_close_matches(name, known, 1)
        hint = f"did you mean {near[0]}?" if near else "--help lists those that there are"
        node.get_logger().warning(f"nothing reads the parameter {name}: {hint}")


def descriptor(declared: Setting, read_only: bool = True) -> ParameterDescriptor:
    """A setting as ROS describes it: type, description, unit, range."""
    unit = f" [{declared.unit}]" if declared.unit else ""
    made = ParameterDescriptor(
        name=declared.name,
        type=TYPES[declared.kind],
        description=f"{declared.text}{unit}",
        additional_constraints=f"give {declared.wanted}",
        read_only=read_only,
    )
    low, high = declared.range.low, declared.range.high
    if declared.kind is float:
        made.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif declared.kind is int:
        least, most = (round(max(-LARGEST, min(LARGEST, end))) for end in (low, high))
        made.integer_range = [IntegerRange(from_value=least, to_value=most)]
    return made


def _declare(node: Node, declared: Setting, default: Any, read_only: bool) -> Any:
    """Declare one, and give its value."""
    for name in (*declared.was, declared.name):
        given = _given(node, name)
        default = default if given is None else _as_declared(declared, given)
    declared.check(default)
    made = descriptor(declared, read_only)
    return node.declare_parameter(declared.name, default, made, ignore_override=True).value


def _given(node: Node, name: str) -> Any:
    """What was given for a parameter when the node was started, of whatever type; else None.

    rclpy shows it only to a node that declares the parameter.
    """
    value = node.declare_parameter(name, None, ParameterDescriptor(dynamic_typing=True)).value
    node.undeclare_parameter(name)
    return value


def _as_declared(declared: Setting, value: Any) -> Any:
    """A value in the declared type, if it can be one."""
    if declared.kind is str and isinstance(value, Real) and not isinstance(value, bool):
        return str(value)
    return declared.converted(value)


class _Follower:
    """Checks and takes over what is set while a node runs."""

    def __init__(self, node: Node, settings: Any, on_change: Callable[[Any], None]) -> None:
        self._node, self._settings, self._on_change = node, settings, on_change
        self._declared = settings_of(type(settings))
        node.add_pre_set_parameters_callback(self._before)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._after)

    def _own(self, parameters: list[Parameter]) -> dict[str, Any]:
        return {each.name: each.value for each in parameters if each.name in self._declared}

    def _before(self, parameters: list[Parameter]) -> list[Parameter]:
        """The same in their declared types."""
        return [
            Parameter(each.name, value=_as_declared(self._declared[each.name], each.value))
            if each.name in self._declared
            else each
            for each in parameters
        ]

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            changed(self._settings, self._own(parameters))
        except SettingError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _after(self, parameters: list[Parameter]) -> None:
        if own := self._own(parameters):  # it is called for what is declared later, too
            self._settings = changed(self._settings, own)
            self._on_change(self._settings)
