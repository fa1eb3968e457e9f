"""What a bag, a match or a player is called is shown as plain text, wherever it is shown."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import layouts
import pytest
from layouts import Many, Said, write

from keepaway_sim.wire.cdr import codec

ROOT = Path(__file__).resolve().parents[2]
ESCAPES = "\x1b[31mred\x07\u202e<script>alert(1)</script>"
AGENTS = json.dumps(
    {f"{team}_{n}": {ESCAPES: 7} for team in ("keeper", "taker") for n in (1, 2, 3)}
)
TOOLS = {
    "analyze": ("--out", "{out}/analysis"),
    "view": ("--out", "{out}/page.html"),
    "repair_bag": ("{out}/repaired",),
    "replay": ("--check",),
}


@pytest.fixture(scope="module")
def messages(bag_3v2: Path) -> Many:
    return layouts.read(bag_3v2)


def in_odd_namespace(messages: Many) -> Many:
    return [said._replace(topic=f"/{ESCAPES}{said.topic}") for said in messages[:-1]]


def with_odd_topic(messages: Many) -> Many:
    odd = Said(f"/{ESCAPES}\n", f"{ESCAPES}/msg/B", ESCAPES.encode(), {}, messages[0].time, b"x")
    return [messages[0], odd, *messages[1:]]


def of_match(**values: object) -> Callable[[Many], Many]:
    def change(messages: Many) -> Many:
        match = codec(messages[0].message_type)
        told = {**match.decode(messages[0].data), **values}
        return [messages[0]._replace(data=match.encode(told)), *messages[1:]]

    return change


BAGS: dict[str, Callable[[Many], Many]] = {
    "namespace": in_odd_namespace,
    "topic": with_odd_topic,
    "task": of_match(task=ESCAPES),
    "names": of_match(player_names=[f"{ESCAPES}{n}" for n in range(5)]),
    "formula": of_match(code_version="$\\x$"),
}


@pytest.mark.parametrize("kind", BAGS)
def test_no_tool_prints_control_characters_or_markup(
    messages: Many, tmp_path: Path, kind: str
) -> None:
    bag = write(tmp_path / "bag.mcap", BAGS[kind](messages), {"agents": AGENTS})
    for tool, options in TOOLS.items():
        arguments = [option.format(out=tmp_path) for option in options]
        command = [sys.executable, str(ROOT / f"scripts/{tool}.py"), str(bag), *arguments]
        done = subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)
        assert done.returncode in (0, 1), done
        assert "Traceback" not in done.stderr, done.stderr
        said = (done.stdout + done.stderr).splitlines()
        assert said, tool
        assert all(line.isprintable() for line in said), said
    page = tmp_path / "page.html"
    if page.exists():
        assert "<script>alert" not in page.read_text()
        assert "\x1b" not in page.read_text()
    assert page.exists() == (kind not in ("task", "names"))
