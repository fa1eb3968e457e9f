"""The page "With ordinary ROS tools" has the commands that its script runs, and what they print."""

import re
from pathlib import Path

from ros_tools_page import SECTIONS, START

PAGE = Path(__file__).resolve().parents[2] / "src/keepaway_sim/docs/ros_tools.md"


def test_the_page_shows_every_command_with_its_output() -> None:
    blocks = re.findall(r"^```\n\$ (.*)\n([\s\S]*?)\n```$", PAGE.read_text(encoding="utf-8"), re.M)
    steps = [step for section in (START, *SECTIONS) for step in section.steps]
    assert [command for command, _ in blocks] == [step.command for step in steps]
    for (_, output), step in zip(blocks, steps, strict=True):
        assert output
        assert len(output.splitlines()) <= step.lines + 1


def test_the_page_has_every_paragraph() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for section in (START, *SECTIONS):
        assert f"## {section.title}\n{section.text}\n" in text
