"""The messages' numbers and units: the same in the code, and said beside every field."""

import re
from enum import IntEnum
from pathlib import Path

import pytest

import keepaway_msgs.msg
from keepaway_agent import actions
from keepaway_sim import task

MSGS = Path(__file__).resolve().parents[2] / "msgs"
INTERFACES = sorted([*MSGS.glob("msg/*.msg"), *MSGS.glob("srv/*.srv")])
CONSTANT = re.compile(r"^u?int\d+ (?P<name>[A-Z_]+) = (?P<value>-?\d+)")
FIELD = re.compile(r"^[a-z_/A-Z0-9]+(\[\])? (?P<name>[a-z_]+)(?P<comment>.*)$")


def constants(message: str) -> dict[str, int]:
    """The constants that a message file declares."""
    lines = (MSGS / f"msg/{message}.msg").read_text().splitlines()
    return {m["name"]: int(m["value"]) for m in map(CONSTANT.match, lines) if m}


@pytest.mark.parametrize("code", [actions, task], ids=["agent", "simulator"])
@pytest.mark.parametrize(
    ("enumeration", "message"),
    [("Action", "ActionRequest"), ("Outcome", "Episode"), ("Role", "Match")],
)
def test_enumerations_of_the_code_are_the_messages_constants(
    code: object, enumeration: str, message: str
) -> None:
    members: type[IntEnum] = getattr(code, enumeration)
    declared = {name: value for name, value in constants(message).items() if name != "NOBODY"}
    assert {member.name: member.value for member in members} == declared


def test_perception_repeats_the_outcomes_and_adds_what_is_unknown() -> None:
    outcomes = {outcome.name: outcome.value for outcome in task.Outcome}
    unknown = {"NEVER": actions.NEVER, "UNREACHABLE": actions.UNREACHABLE}
    assert constants("Perception") == outcomes | unknown


@pytest.mark.parametrize("message", [path.stem for path in MSGS.glob("msg/*.msg")])
def test_built_message_has_the_constants_of_its_file(message: str) -> None:
    built = getattr(keepaway_msgs.msg, message)
    assert {name: getattr(built, name) for name in constants(message)} == constants(message)


@pytest.mark.parametrize("path", INTERFACES, ids=lambda path: path.stem)
def test_every_field_has_a_unit_beside_it(path: Path) -> None:
    fields = [m for m in map(FIELD.match, path.read_text().splitlines()) if m]
    assert fields
    without = [m["name"] for m in fields if not re.search(r"# .+\[[^\]]+\]$", m["comment"])]
    assert not without


def test_every_interface_is_built() -> None:
    listed = (MSGS / "CMakeLists.txt").read_text()
    missing = [p.name for p in INTERFACES if f'"{p.relative_to(MSGS)}"' not in listed]
    assert not missing
