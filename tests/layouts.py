"""A match's bag as other writers lay it out, and what every tool makes of it: docs' table.

.venv/bin/python tests/layouts.py         # writes the table anew
"""

import hashlib
import itertools
import json
import pickle
import random
import re
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

from mcap.reader import NonSeekingReader
from mcap.writer import IndexType, Writer

from keepaway_agent.checks.decisions import check_decisions
from keepaway_agent.errors import AgentError
from keepaway_sim.analysis.report import analyse, draw
from keepaway_sim.analysis.tally import Tally
from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.playback import Playback, difference_from_installed, episode_times
from keepaway_sim.bags.repair import repair
from keepaway_sim.bags.verify import check_world
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Task
from keepaway_sim.view.page import replay_page

PAGE = Path(__file__).resolve().parents[1] / "src/keepaway_sim/docs/recordings.md"
BEGIN, END = "<!-- the table of tests/layouts.py -->", "<!-- its end -->"
WALL = 1_750_000_000_000_000_000  # [ns]
TOOLS = ("analyze", "view", "check", "replay", "repair")
SAME = "same numbers"


class Said(NamedTuple):
    """One message of the bag that is laid out anew."""

    topic: str
    message_type: str
    definition: bytes
    metadata: dict[str, str]
    time: int
    data: bytes


Many = list[Said]


def read(bag: Path) -> Many:
    """All messages of a bag of one file, as they stand in it."""
    with next(bag.glob("*.mcap")).open("rb") as stream:
        return [
            Said(c.topic, s.name, s.data, dict(c.metadata), m.log_time, m.data)
            for s, c, m in NonSeekingReader(stream).iter_messages(log_time_order=False)
            if s
        ]


def write(path: Path, messages: Many, info: dict[str, str] | None = None, **options: Any) -> Path:
    """One MCAP file of these messages; a topic without a type has no schema.

    Args:
        path: of the file.
        messages: in their order.
        info: metadata "keepaway".
        options: of `mcap.writer.Writer`.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="ros2", library="layouts")
        schemas: dict[tuple[str, bytes], int] = {("", b""): 0}
        channels: dict[str, int] = {}
        if info:
            writer.add_metadata("keepaway", info)
        for number, said in enumerate(messages):
            key = said.message_type, said.definition
            if key not in schemas:
                schemas[key] = writer.register_schema(key[0], "ros2msg", key[1])
            if said.topic not in channels:
                how = "cdr" if said.message_type else "json"
                channels[said.topic] = writer.register_channel(
                    said.topic, how, schemas[key], said.metadata
                )
            writer.add_message(channels[said.topic], said.time, said.data, said.time, number)
        writer.finish()
    return path


def shuffled(messages: Many) -> Many:
    """The same in disorder."""
    return random.Random(1).sample(messages, len(messages))


def of_the_wall(messages: Many, begin: int = WALL) -> Many:
    """The same as `ros2 bag record` stamps them."""
    return [said._replace(time=begin + said.time) for said in messages]


def with_foreign_topics(messages: Many) -> Many:
    """And topics of a type that is not installed, and of none at all."""
    thing = Said("/thing", "nobody_msgs/msg/Thing", b"float64 x\n", {}, 0, bytes(12))
    raw = Said("/raw", "", b"", {}, 0, b"{}")
    return [
        each
        for number, said in enumerate(messages)
        for each in (said, *([thing, raw] if number % 10 == 0 else []))
        for each in [each._replace(time=said.time)]
    ]


def old_definition(messages: Many) -> Many:
    """A Perception's definition without cycles_to_ball and what came to stand behind it."""

    def older(definition: bytes) -> bytes:
        head, *inside = definition.decode().split("=" * 80, 1)
        lines = [line for line in head.splitlines() if line.split("#")[0].strip()]
        known = itertools.takewhile(lambda line: "[] cycles_to_ball" not in line, lines)
        return "\n".join([*known, *("=" * 80 + part for part in inside)]).encode()

    return [
        said._replace(definition=older(said.definition))
        if said.message_type.endswith("/Perception")
        else said
        for said in messages
    ]


def without(messages: Many, name: str) -> Many:
    """All but the topics whose names end so."""
    return [said for said in messages if not said.topic.endswith(name)]


def layouts() -> dict[str, tuple[Callable[[Many], Many], dict[str, Any]]]:
    """Ten layouts, then eight odd bags: how the messages are changed, and the writer's options."""

    def as_they_are(messages: Many) -> Many:
        return messages

    return {
        "plain": (as_they_are, {}),
        "messages outside chunks": (as_they_are, {"use_chunking": False}),
        "no definitions in the summary": (
            as_they_are,
            {"repeat_channels": False, "repeat_schemas": False},
        ),
        "no statistics": (as_they_are, {"use_statistics": False}),
        "no index": (as_they_are, {"index_types": IndexType.NONE}),
        "no CRC": (as_they_are, {"enable_crcs": False}),
        "log times of the wall": (of_the_wall, {}),
        "no QoS": (lambda m: [said._replace(metadata={}) for said in m], {}),
        "chunks in disorder": (shuffled, {"chunk_size": 1}),
        "foreign topics, no schema": (with_foreign_topics, {}),
        "odd: every message twice": (lambda m: [said for said in m for _ in range(2)], {}),
        "odd: an older Perception": (old_definition, {}),
        "odd: nobody's perceptions": (lambda m: without(m, "/perception"), {}),
        "odd: no perceptions of keeper_2": (lambda m: without(m, "keeper_2/perception"), {}),
        "odd: no field states": (lambda m: without(m, "/field_state"), {}),
        "odd: no ends of episodes": (lambda m: without(m, "/episode"), {}),
        "odd: no match": (lambda m: without(m, "/match"), {}),
        "odd: all log times 0": (lambda m: [said._replace(time=0) for said in m], {}),
    }


def laid_out(bag: Path, folder: Path) -> Iterator[tuple[str, Path]]:
    """The bag in every layout, as files by themselves."""
    messages, info = read(bag), MatchBag(bag).reader.info
    for number, (name, (changed, options)) in enumerate(layouts().items()):
        path = folder / f"{number}" / "bag.mcap"
        yield name, write(path, changed(messages), {**info}, **options)


def results(path: Path, folder: Path) -> dict[str, str]:
    """What every tool makes of a bag: its numbers as a text, or the sentence that refuses it."""
    made = {}
    for tool in TOOLS:
        try:
            made[tool] = RUN[tool](path, folder / tool)
        except (KeepawayError, AgentError) as error:
            made[tool] = re.sub(r"\S*/(bag\.mcap|repair)", "BAG", str(error))
    return made


def _analyze(path: Path, folder: Path) -> str:
    with mock.patch("keepaway_sim.analysis.report.draw", _draw_once):
        words = analyse(path, folder)
    summary = json.loads((folder / "summary.json").read_text())
    table = hashlib.sha256((folder / "episodes.csv").read_bytes()).hexdigest()
    del summary["messages"]
    missing = summary.pop("missing")
    return f"{_told(missing)}{_unknown(words)}|{json.dumps(summary)}{table}"


_DRAWN: set[bytes] = set()


def _draw_once(tally: Tally, task: Task, made_by: str, output: Path) -> None:
    """Draw what no other bag has had drawn: figures of equal numbers are equal."""
    numbers = pickle.dumps((tally, task, made_by))
    if numbers not in _DRAWN:
        draw(tally, task, made_by, output)
        _DRAWN.add(numbers)


def _view(path: Path, _: Path) -> str:
    page, missing = replay_page(path)
    found = re.search(r'<script id="data" type="application/json">(.*?)</script>', page, re.S)
    assert found
    data = json.loads(found[1])
    return f"{_told(missing)}|{json.dumps(data['episodes'])}"


def _check(path: Path, _: Path) -> str:
    return f"|{check_world(MatchBag(path))} {check_decisions(MatchBag(path))}"


def _replay(path: Path, _: Path) -> str:
    bag = MatchBag(path)
    for topic in bag.timeline.topics.values():
        if topic.name in bag.reader.topics and topic.name not in ("/thing", "/raw"):
            difference = difference_from_installed(topic)
            if difference:
                raise KeepawayError(f"BAG: {topic.name}: {difference}")
    playback = Playback(bag.timeline, 0.0, *episode_times(bag, 1, 2))
    said = playback.prologue()
    while not playback.finished:
        said += playback.due(0.0)
    own = {m for m in said if m.message_type.startswith("keepaway_msgs")}
    twice = "messages come as often as they are there" if len(own) < len(said) * 0.6 else ""
    digest = hashlib.sha256(repr(sorted(own)).encode()).hexdigest()
    return f"{twice}|{digest}"


def _repair(path: Path, folder: Path) -> str:
    repair(path, folder)
    return _analyze(folder, folder.with_name("analysis"))


RUN: dict[str, Callable[[Path, Path], str]] = {
    "analyze": _analyze,
    "view": _view,
    "check": _check,
    "replay": _replay,
    "repair": _repair,
}


def _told(missing: str) -> str:
    """What is said of a bag that lacks something, or has something twice."""
    parts = [part for part in missing.split("; ") if not part.startswith("nothing is missing")]
    return "; ".join(parts)


def _unknown(words: str) -> str:
    return "; passes are not known" if "passes are not known" in words else ""


def cells(plain: dict[str, str], found: dict[str, str]) -> dict[str, str]:
    """A row of the table: "same numbers", and what is said besides."""
    row = {}
    for tool in TOOLS:
        told, bar, numbers = found[tool].rpartition("|")
        if not bar:
            row[tool] = found[tool]
            continue
        same = numbers == plain[tool].rpartition("|")[2]
        row[tool] = "; ".join(filter(None, [SAME if same else "", told])) or "what is there"
    return row


def table(bag: Path, folder: Path) -> str:
    """The table in Markdown."""
    lines = ["| bag | " + " | ".join(TOOLS) + " |", "|---" * (1 + len(TOOLS)) + "|"]
    plain: dict[str, str] = {}
    for name, path in laid_out(bag, folder):
        found = results(path, path.parent)
        plain = plain or found
        lines.append(f"| {name} | " + " | ".join(cells(plain, found).values()) + " |")
    return "\n".join(lines)


def record(folder: Path) -> Path:
    """The match of the table."""
    from recorded import record_agents

    players = ("keeper_1", "keeper_2", "keeper_3", "taker_1", "taker_2")
    agents: dict[str, dict[str, Any]] = {name: {"policy": "hand"} for name in players}
    return record_agents(folder / "match", agents, seed=3, episodes=3)


def in_page(text: str) -> str:
    """The table as the page has it."""
    return text.split(BEGIN)[1].split(END)[0].strip()


def main() -> None:
    """Write the table into the page."""
    with tempfile.TemporaryDirectory() as folder:
        made = table(record(Path(folder)), Path(folder))
    text = PAGE.read_text()
    PAGE.write_text(text.replace(in_page(text), made))


if __name__ == "__main__":
    main()
