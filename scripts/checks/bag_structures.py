"""Bags that are whole MCAP files and odd inside: layouts, JSON shapes, values, lengths, types."""

import contextlib
import json
import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from mcap.reader import NonSeekingReader
from mcap.writer import CompressionType, IndexType, Writer

from keepaway_sim.analysis.tally import episode_table
from keepaway_sim.bags.gaps import count_gaps
from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.playback import Playback
from keepaway_sim.bags.repair import repair
from keepaway_sim.bags.verify import check_world
from keepaway_sim.errors import KeepawayError
from keepaway_sim.view.page import replay_page
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.messages import MATCH

NUMBERS = (-1, 0, 1, 3, 99, 255, 2**15, 2**31, 2**32 - 1, 2**63, 2**64 - 1)
FLOATS = (0.0, -1.0, math.nan, math.inf, -math.inf, 1e308, 1e-308)
TEXTS = (
    *("", "\x1b[31m", "../../x", "a" * 5000, "[" * 1000, "{}", "null", "</script>", "3v2"),
    *("a\nb", "\u202e", "$\\x$"),
)
NAMES = ("\x1b[31mred", "a\nb", "<script>alert(1)</script>", "\u202e", "", "a b", "~", "a" * 300)
SHAPES: tuple[Any, ...] = (None, [], {}, 7, "x", [[[]]], {"a": {"b": {"c": []}}}, 1e308, True)


class Said(NamedTuple):
    """One message."""

    topic: str
    message_type: str
    definition: bytes
    time: int
    data: bytes


def read_all(file: Path) -> list[Said]:
    """The messages of a file."""
    with file.open("rb") as stream:
        return [
            Said(c.topic, s.name, s.data, m.log_time, m.data)
            for s, c, m in NonSeekingReader(stream).iter_messages(log_time_order=False)
            if s
        ]


def changed(messages: list[Said], case: random.Random) -> list[Said]:
    """The messages with one to three odd things among them."""
    for _ in range(case.randint(1, 3)):
        with contextlib.suppress(KeepawayError):  # what an earlier change broke is left as it is
            messages = case.choice(CHANGES)(list(messages), case)
    return messages


def odd_value(messages: list[Said], case: random.Random) -> list[Said]:
    """One field of one message has another value, or its sequence another length."""
    at = 0 if case.random() < 0.3 else case.randrange(len(messages))
    said = messages[at]
    layout = codec(said.message_type)
    values = layout.decode(said.data)
    name = case.choice(list(values))
    values[name] = _odd(values[name], case)
    try:
        messages[at] = said._replace(data=layout.encode(values))
    except (ValueError, OverflowError):
        messages[at] = said._replace(data=said.data[: case.randrange(len(said.data))])
    return messages


def odd_json(messages: list[Said], case: random.Random) -> list[Said]:
    """The match's configuration has another shape."""
    layout, said = codec(MATCH), messages[0]
    if said.message_type != MATCH:
        return messages
    values = layout.decode(said.data)
    try:
        config = json.loads(values["config_json"])
        group = config[case.choice([name for name in config if isinstance(config[name], dict)])]
        group[case.choice(list(group))] = case.choice(SHAPES)
        values["config_json"] = json.dumps(case.choice([config, config, *SHAPES]), allow_nan=True)
    except (ValueError, TypeError, KeyError, IndexError):
        values["config_json"] = case.choice(TEXTS)
    messages[0] = said._replace(data=layout.encode(values))
    return messages


def odd_definition(messages: list[Said], case: random.Random) -> list[Said]:
    """A type's definition lacks a line, has one twice, or one of another type."""
    chosen = case.choice(messages).message_type
    lines = next(m for m in messages if m.message_type == chosen).definition.split(b"\n")
    at = case.randrange(len(lines))
    new = case.choice([[], [lines[at]] * 2, [b"string odd"], [b"Odd[] odd"], [b"uint8[9999999] x"]])
    lines[at : at + 1] = new
    return [
        m._replace(definition=b"\n".join(lines)) if m.message_type == chosen else m
        for m in messages
    ]


def odd_type(messages: list[Said], case: random.Random) -> list[Said]:
    """A topic carries another type."""
    topic, other = case.choice(messages).topic, case.choice(messages)
    name = case.choice([other.message_type, "foo", "a/msg/B", ""])
    return [m._replace(message_type=name) if m.topic == topic else m for m in messages]


def odd_name(messages: list[Said], case: random.Random) -> list[Said]:
    """A topic, or the namespace of all, has a name that no ROS program would give it."""
    name = case.choice(NAMES)
    if case.random() < 0.5:
        return [m._replace(topic=f"/{name}{m.topic}") for m in messages]
    topic = case.choice(messages).topic
    return [m._replace(topic=f"/{name}") if m.topic == topic else m for m in messages]


def odd_match(messages: list[Said], case: random.Random) -> list[Said]:
    """Some messages are of another match; or all are there again, in another match's number."""
    number, again = case.choice([7, 2**64 - 1]), case.random() < 0.5
    changed = [_of_match(m, number) for m in messages]
    if again:
        return (
            case.sample(messages + changed, 2 * len(messages))
            if case.random() < 0.5
            else (messages + changed)
        )
    return [case.choice(pair) for pair in zip(messages, changed, strict=True)]


def _of_match(said: Said, number: int) -> Said:
    """The same message in another match's number, where it has one."""
    layout = codec(said.message_type)
    values = layout.decode(said.data)
    if "match_id" not in values:
        return said
    return said._replace(data=layout.encode({**values, "match_id": number}))


def odd_order(messages: list[Said], case: random.Random) -> list[Said]:
    """Messages are lost, doubled, or in disorder; times are of the wall, odd, or all alike."""
    kind = case.randrange(5)
    if kind == 0:
        return case.sample(messages, len(messages))
    if kind == 1:
        return [m for m in messages for _ in range(case.randrange(3))]
    if kind == 2:
        gone = case.choice(messages).topic
        return [m for m in messages if m.topic != gone]
    if kind == 3:
        time = case.choice([0, 7, 2**62, 2**63, 2**64 - 1])
        return [m._replace(time=time) for m in messages]
    return [m._replace(time=(m.time + 1_750_000_000_000_000_000) % 2**64) for m in messages]


CHANGES: tuple[Callable[[list[Said], random.Random], list[Said]], ...] = (
    odd_value, odd_value, odd_value, odd_json, odd_definition, odd_type, odd_order, odd_name,
    odd_match,
)  # fmt: skip


def write(path: Path, messages: list[Said], agents: str, case: random.Random) -> None:
    """A file of them, by a writer of any settings."""
    options: dict[str, Any] = {
        "chunk_size": case.choice([1, 2000, 10**6]),
        "use_chunking": case.random() < 0.8,
        "use_statistics": case.random() < 0.8,
        "repeat_channels": case.random() < 0.8,
        "repeat_schemas": case.random() < 0.8,
        "enable_crcs": case.random() < 0.8,
        "index_types": case.choice([IndexType.ALL, IndexType.NONE, IndexType.CHUNK]),
        "compression": case.choice([CompressionType.ZSTD, CompressionType.LZ4]),
    }
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="ros2")
        writer.add_metadata("keepaway", {"agents": agents})
        schemas: dict[tuple[str, bytes], int] = {}
        channels: dict[tuple[str, int], int] = {}
        for said in messages:
            key = said.message_type, said.definition
            if key not in schemas:
                made = writer.register_schema(key[0], "ros2msg", key[1]) if key[0] else 0
                schemas[key] = made
            channel = said.topic, schemas[key]
            if channel not in channels:
                channels[channel] = writer.register_channel(said.topic, "cdr", schemas[key], {})
            writer.add_message(channels[channel], said.time, said.data, said.time, 0)
        writer.finish()


def structure_reader(source: Path, folder: Path) -> Callable[[bytes], object]:
    """Lets every tool read the bag that a case's bytes stand for, whatever the other tools do.

    Raises:
        KeepawayError: every tool refused it.
    """
    messages = read_all(source)
    folder.mkdir()

    def read(data: bytes) -> object:
        case = random.Random(data)
        path = folder / "case.mcap"
        shape = case.choice([{}, {"keeper_1": {"policy": "hand"}}, *SHAPES])
        agents = json.dumps(shape, allow_nan=True)
        write(path, changed(messages, case), agents, case)
        refusals = [refusal for tool in TOOLS if (refusal := _refusal(tool, path))]
        if len(refusals) == len(TOOLS):
            raise refusals[0]
        return refusals

    return read


def _refusal(tool: Callable[[Path], object], path: Path) -> KeepawayError | None:
    try:
        tool(path)
    except KeepawayError as error:
        if not str(error).isprintable():
            raise RuntimeError("a refusal that is not one printable line") from error
        return error
    return None


def _page(path: Path) -> None:
    page, _ = replay_page(path)
    assert "NaN" not in page.split('type="application/json">')[1].split("</script>")[0]
    assert "<script>alert" not in page
    assert "\x1b" not in page


def _report(path: Path) -> None:
    assert count_gaps(MatchBag(path)).report().isprintable()


def _play(path: Path) -> None:
    playback = Playback(MatchBag(path).timeline, 0.0)
    while not playback.finished:
        playback.due(0.0)


def _repair(path: Path) -> None:
    output = path.with_name("repaired")
    try:
        repair(path, output)
    finally:
        for file in output.glob("*"):
            file.unlink()
        if output.is_dir():
            output.rmdir()


TOOLS: tuple[Callable[[Path], object], ...] = (
    episode_table,
    _page,
    _play,
    _repair,
    lambda path: check_world(MatchBag(path)),
    _report,
)


def _odd(value: Any, case: random.Random) -> Any:
    if isinstance(value, list):
        return case.choice([value[:-1], value * 2, [], [_odd(v, case) for v in value]])
    if isinstance(value, dict):
        name = case.choice(list(value))
        return {**value, name: _odd(value[name], case)}
    if isinstance(value, str):
        return case.choice(TEXTS)
    return case.choice(FLOATS if isinstance(value, float) else NUMBERS)
