"""How settings are declared: each once, with its default, a sentence, its unit and its range.

A group of settings is a frozen attrs class whose fields are made by `setting`. From the declaration
come the check of every value when an instance is made, the options of command lines
(`keepaway_sim.cli.options`), the parameters of ROS nodes (`parameters.py` of each package) and the
tables of the documentation (`table`). A group may hold other groups (`group`); a
command line or a file, which knows a setting by its name alone, sees one flat list.

>>> @attrs.frozen
... class Pace:
...     speed: float = setting(0.0, "simulated over wall time; 0: lock-step", "1", "[0, 1000]")
>>> Pace(2)
Pace(speed=2.0)
>>> Pace(-1)
Traceback (most recent call last):
keepaway_sim.errors.SettingError: speed=-1.0: give a number from 0 to 1000 [1]

The packages of the world and of the agents share no code, so each has this same file; a contract
test holds the two together.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any, NamedTuple, TypeVar

import attrs

from keepaway_sim.errors import SettingError

Group = TypeVar("Group")

_INTERVAL = re.compile(r"([\[(])\s*([^,\s]+)\s*,\s*([^,\s]+)\s*([\])])")


class Range(NamedTuple):
    """An interval of numbers; its ends may be infinite, and belong to it or not."""

    low: float
    high: float
    has_low: bool
    has_high: bool

    @classmethod
    def parse(cls, text: str) -> Range:
        """The range written as in mathematics: "[0, 1]", "(0, 360]", "[1, inf)".

        Raises:
            ValueError: no such interval.
        """
        found = _INTERVAL.fullmatch(text)
        if not found:
            raise ValueError(f"range {text!r}: write an interval like [0, 1] or (0, inf)")
        return cls(float(found[2]), float(found[3]), found[1] == "[", found[4] == "]")

    def holds(self, value: float) -> bool:
        """Whether a number lies in it."""
        above = value >= self.low if self.has_low else value > self.low
        below = value <= self.high if self.has_high else value < self.high
        return bool(above and below)

    def __str__(self) -> str:
        """In words, after "a number": "from 0 to 1", "above 0 and up to 360"."""
        low, high = _written(self.low), _written(self.high)
        if self.has_low and self.has_high:
            return f"from {low} to {high}"
        if math.isinf(self.high):
            return "" if math.isinf(self.low) else f"{'from' if self.has_low else 'above'} {low}"
        below = f"{'up to' if self.has_high else 'below'} {high}"
        return f"{'from' if self.has_low else 'above'} {low} and {below}"


EVERY_NUMBER = Range(-math.inf, math.inf, False, False)


@attrs.frozen
class Setting:
    """What is declared of one setting.

    Attributes:
        name: in the class, in files and as a ROS parameter.
        kind: bool, int, float or str.
        default: that it has; `attrs.NOTHING` if it must be given.
        text: what it is, without a full stop.
        unit: "m", "1" for a ratio or a share, "" where it has none.
        range: of a number.
        choices: of a text; any if there are none.
        was: names that it had before, which command lines and files may still use.
    """

    name: str
    kind: type
    default: Any
    text: str
    unit: str
    range: Range
    choices: tuple[str, ...]
    was: tuple[str, ...]

    @property
    def wanted(self) -> str:
        """What may be given, in words."""
        if self.kind is bool:
            return "true or false"
        if self.kind is str:
            return " or ".join(each or '""' for each in self.choices) or "a text"
        words = "a whole number" if self.kind is int else "a number"
        unit = f"[{self.unit}]" if self.unit else ""
        return " ".join(filter(None, (words, str(self.range), unit)))

    def converted(self, value: Any) -> Any:
        """A value in the setting's type, if it can be one without loss; else as it is."""
        if not _is_number(value):
            return value
        try:
            if self.kind is bool:
                return bool(value) if value in (0, 1) else value
            if isinstance(value, bool) or not math.isfinite(value):
                return value
            if self.kind is int and not isinstance(value, Integral):
                return int(value) if value == int(value) else value
            return self.kind(value) if self.kind in (int, float) else value
        except OverflowError:  # a whole number beyond all floating-point ones
            return value

    def check(self, value: Any) -> None:
        """Refuse a value.

        Raises:
            SettingError: of another type or outside the range, with what may be given.
        """
        fits = type(value) is self.kind
        if fits and self.kind in (int, float):
            fits = math.isfinite(value) and self.range.holds(value)
        if fits and self.choices:
            fits = value in self.choices
        if not fits:
            raise SettingError(f"{self.name}={value!r}: give {self.wanted}")


def setting(
    default: Any,
    text: str,
    unit: str = "",
    range: str = "",  # noqa: A002 - that is what it is
    choices: tuple[str, ...] = (),
    was: tuple[str, ...] = (),
) -> Any:
    """A field of a settings class; the arguments are those of `Setting`, `range` as `Range.parse`.

    A value is converted where nothing is lost by it (1 to 1.0), then checked.
    """
    limits = Range.parse(range) if range else EVERY_NUMBER
    return _field(
        Setting("", type(default), default, text, unit, limits, tuple(choices), tuple(was))
    )


def required(
    kind: type,
    text: str,
    unit: str = "",
    range: str = "",  # noqa: A002 - as `setting`
) -> Any:
    """A field of a settings class that has no default, for settings that come from a file."""
    limits = Range.parse(range) if range else EVERY_NUMBER
    return _field(Setting("", kind, attrs.NOTHING, text, unit, limits, (), ()))


def group(settings: type) -> Any:
    """A field that is a group of settings of its own, by default as it is declared."""
    return attrs.field(factory=settings, metadata={"group": settings})


def same(settings: type, name: str) -> Any:
    """A field that is declared as another class's setting of this name."""
    return _field(settings_of(settings)[name])


def settings_of(settings: type) -> dict[str, Setting]:
    """Every setting of a class by its name, those of its groups among them, as declared."""
    found: dict[str, Setting] = {}
    for field in attrs.fields(settings):
        if "setting" in field.metadata:
            found[field.name] = attrs.evolve(field.metadata["setting"], name=field.name)
        elif "group" in field.metadata:
            found |= settings_of(field.metadata["group"])
    return found


def build(settings: type[Group], values: Mapping[str, Any]) -> Group:
    """An instance from values by name, whatever group they are in; the others are as by default.

    Raises:
        SettingError: a name that is none, or a value that is refused.
    """
    return _built(settings, _renamed(settings, values))


def changed(instance: Group, changes: Mapping[str, Any]) -> Group:
    """An instance with some settings changed by name, whatever group they are in.

    Raises:
        SettingError: a name that is none, or a value that is refused.
    """
    kind = type(instance)
    return _built(kind, {**flat(instance), **_renamed(kind, changes)})


def flat(instance: Any) -> dict[str, Any]:
    """The values of all settings by name, those of groups among them: what `build` takes."""
    values: dict[str, Any] = {}
    for field in attrs.fields(type(instance)):
        if "setting" in field.metadata:
            values[field.name] = getattr(instance, field.name)
        elif "group" in field.metadata:
            values |= flat(getattr(instance, field.name))
    return values


def table(settings: type, heading: str = "setting") -> str:
    """The settings of a class as a table in Markdown."""
    rows = [f"| {heading} | default | unit | range | what it is |", "|---|---|---|---|---|"]
    for declared in settings_of(settings).values():
        default = "required" if declared.default is attrs.NOTHING else as_text(declared.default)
        cells = (f"`{declared.name}`", default, declared.unit, limits(declared))
        rows.append(f"| {' | '.join((*cells, declared.text))} |")
    return "\n".join(rows) + "\n"


def as_text(value: object) -> str:
    """A value as ROS and command lines write it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def limits(declared: Setting) -> str:
    """What may be given, for a table: "0 to 1", "> 0 to 360", "hand, learn"."""
    if declared.choices:
        return ", ".join(declared.choices)
    low, high = declared.range.low, declared.range.high
    if declared.kind not in (int, float) or declared.range == EVERY_NUMBER:
        return ""
    lowest = f"{'' if declared.range.has_low else '> '}{_written(low)}"
    if math.isinf(high):
        return lowest if not declared.range.has_low else f"{lowest} or more"
    return f"{lowest} to {'' if declared.range.has_high else '< '}{_written(high)}"


def _written(number: float) -> str:
    """An end of a range as people write it."""
    return "2^63" if number == 2.0**63 else f"{number:.12g}"


def _is_number(value: Any) -> bool:
    """Whether it is one of Python or numpy; truths are numbers, too."""
    return isinstance(value, Real)


def _field(declared: Setting) -> Any:
    def check(_: object, field: Any, value: Any) -> None:
        attrs.evolve(declared, name=field.name).check(value)

    return attrs.field(
        default=declared.default,
        converter=declared.converted,
        validator=check,
        metadata={"setting": declared},
    )


def _renamed(settings: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by today's names."""
    known = settings_of(settings)
    names = {name: name for name in known} | {
        old: name for name, declared in known.items() for old in declared.was
    }
    for name in values:
        if name not in names:
            raise SettingError(f"{name}: no such setting{_nearest(name, names)}")
    return {names[name]: value for name, value in values.items()}


def _built(settings: type[Group], values: Mapping[str, Any]) -> Group:
    given: dict[str, Any] = {}
    for field in attrs.fields(settings):  # type: ignore[arg-type]
        if "group" in field.metadata:
            given[field.name] = _built(field.metadata["group"], values)
        elif field.name in values:
            given[field.name] = values[field.name]
    return settings(**{name.lstrip("_"): value for name, value in given.items()})


def _nearest(name: str, known: Mapping[str, str]) -> str:
    near = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean {known[near[0]]}?" if near else ""
