"""The matches of a bag: which there are, and where the messages of each are.

A match is what one Match message describes. Its messages are known by their topics' namespace
and, where one topic describes several matches, by the match's number that they carry. Those
without a number are told apart by when they came: by their log times, or in bags whose log times
are simulated (each match begins at 0) by their places.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from keepaway_sim.bags import checked, rows
from keepaway_sim.bags.belonging import Belonging, MatchIds, Span
from keepaway_sim.bags.blocks import Piece
from keepaway_sim.bags.reader import BagReader, Place
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Task
from keepaway_sim.wire.messages import (
    ACTION_REQUEST,
    EPISODE,
    FIELD_STATE,
    MATCH,
    PERCEPTION,
)

_MOST_MATCHES = 1000
_KEYED = {"field_state": FIELD_STATE, "perception": PERCEPTION, "action_request": ACTION_REQUEST}
_KEY_FIELDS = {
    FIELD_STATE: ("stamp.sec", "stamp.nanosec", "episode", "cycle", "outcome"),
    PERCEPTION: ("stamp.sec", "stamp.nanosec", "player_index", "episode", "cycle", "outcome"),
    ACTION_REQUEST: ("player_index", "episode", "cycle", "action", "target"),
    EPISODE: ("stamp.sec", "stamp.nanosec", "number", "cycles", "duration", "outcome", "lost_by"),
}


@dataclass
class Found:
    """One match of a bag.

    Attributes:
        topic: that describes it.
        values: the Match message's fields.
        task: who plays, on what field.
        belonging: which messages of its namespace are its own.
        ids: reads the numbers that messages carry; None: the bag's matches have none.
        pieces: where its perceptions, states and requests are, by moments; sources are numbers
            of `BagReader.places`.
        episodes: (n,) its Episode messages, each number once, in order.
        repeated: Match and Episode messages that came again.
        strange: messages of matches that the bag does not describe, on this one's topics.
        mixed: places that have other messages as well.
        counts: its perceptions, states and requests by the topics' names.
        simulated: log times are the messages' own stamps.
        last: the newest field state's episode, cycle, outcome and stamp [ns]; None without one.
    """

    topic: str
    values: dict[str, Any]
    task: Task
    belonging: Belonging = field(default_factory=Belonging)
    ids: MatchIds | None = None
    pieces: list[Piece] = field(default_factory=list)
    episodes: list[np.void] = field(default_factory=list)
    repeated: int = 0
    strange: int = 0
    mixed: set[int] = field(default_factory=set)
    counts: Counter[str] = field(default_factory=Counter)
    simulated: bool = True
    last: tuple[int, int, int, int] | None = None
    _ends: dict[int, np.void] = field(default_factory=dict)

    @property
    def namespace(self) -> str:
        """What its topics' names begin with."""
        return self.topic.rpartition("/")[0]

    def ids_of(self, data: bytes, rows: np.ndarray) -> np.ndarray:
        """(n,) uint64 the numbers of the matches that messages are of; 0: not known."""
        return self.ids.of(data, rows) if self.ids else np.zeros(len(rows), np.uint64)

    def own(self, number: int, data: bytes, rows: np.ndarray) -> np.ndarray:
        """(n,) bool: which rows of the place with that number are messages of this match."""
        if number not in self.mixed:
            return np.ones(len(rows), np.bool_)
        return self.belonging.chosen(self.ids_of(data, rows), number, rows)


class _Description(NamedTuple):
    """A Match message and where it came first."""

    values: dict[str, Any]
    time: int  # [ns] log time
    place: int  # number << 32 | row


def find_matches(reader: BagReader) -> list[Found]:
    """All matches of a bag, in the order in which they began.

    Raises:
        KeepawayError: a Match that makes no sense, or messages that are not a match's.
    """
    described, repeated = _descriptions(reader)
    matches: list[Found] = []
    for topic, descriptions in described.items():
        of_topic = [_found(topic, description) for description in descriptions]
        _index(reader, of_topic[:1])
        if len(of_topic) > 1:
            _divide(of_topic, descriptions, of_topic[0].simulated)
            _index(reader, of_topic)
        of_topic[0].repeated += repeated[topic]
        matches += of_topic
    return matches


def _descriptions(reader: BagReader) -> tuple[dict[str, list[_Description]], dict[str, int]]:
    """The different Match messages of every topic, and how many came again."""
    found: dict[str, dict[str, _Description]] = {}
    repeated: dict[str, int] = {}
    for topic in reader.of_type(MATCH):
        found[topic], repeated[topic] = {}, 0
        codec = reader.codec(topic)
        seen: dict[bytes, dict[str, Any]] = {}
        for at, time, data in _raw_messages(reader, topic):
            if data not in seen:
                if len(seen) >= _MOST_MATCHES:
                    raise KeepawayError(f"{reader.path}: more than {_MOST_MATCHES} Matches")
                seen[data] = _decoded(reader, codec, data)
            key = repr({**seen[data], "first_episode": 0, "speed": 0})
            before = found[topic].get(key)
            repeated[topic] += before is not None
            if before is None or time < before.time:
                values = before.values if before else seen[data]
                first = min(at, before.place) if before else at
                found[topic][key] = _Description(values, time, first)
    return {topic: list(by_key.values()) for topic, by_key in found.items() if by_key}, repeated


def _decoded(reader: BagReader, codec: Any, data: bytes) -> dict[str, Any]:
    try:
        values: dict[str, Any] = codec.decode(data)
        checked.check_match(values)
    except KeepawayError as error:
        raise KeepawayError(f"{reader.path}: {error}") from error
    return values


def _raw_messages(reader: BagReader, topic: str) -> Iterator[tuple[int, int, bytes]]:
    number = reader.number(topic)
    for at, place in enumerate(reader.places):
        if not place.file.may_have(place.run, (topic,)):
            continue
        data, found, _ = reader.load(place)
        for row in np.flatnonzero(found[:, 0] == number).tolist():
            _, time, first, last = found[row].tolist()
            yield (at << 32) | row, time, data[first:last]


def _found(topic: str, description: _Description) -> Found:
    return Found(topic, description.values, checked.check_match(description.values))


def _divide(matches: list[Found], descriptions: list[_Description], simulated: bool) -> None:
    """Tell the messages of one topic's matches apart: from its description to the next one's."""
    whole = Span()
    begins = [d.place if simulated else d.time for d in descriptions]
    order = sorted(range(len(begins)), key=begins.__getitem__)
    bounds = [whole.begin, *sorted(begins)[1:], whole.end]
    for rank, number in enumerate(order):
        span = Span(not simulated, bounds[rank], bounds[rank + 1])
        matches[number].belonging = Belonging(span=span)
    matches.sort(key=lambda match: match.belonging.span.begin)


def _number(reader: BagReader, matches: list[Found]) -> None:
    """Let the messages of one topic's matches be told apart by the matches' numbers."""
    numbers = [int(match.values.get("match_id", 0)) for match in matches]
    if not any(numbers):
        return
    ids = MatchIds(reader, matches[0].namespace, [match.task for match in matches])
    for match, number in zip(matches, numbers, strict=True):
        alone = number if numbers.count(number) == 1 else 0
        others = tuple(set(numbers) - {number, 0})
        match.belonging = match.belonging._replace(match_id=alone, others=others)
        match.ids = ids


def _index(reader: BagReader, matches: list[Found]) -> None:
    """Find where the messages of each match are (of one topic's matches, which share a name)."""
    _number(reader, matches)
    for match in matches:
        match.pieces.clear()
        match._ends.clear()
        match.counts.clear()
        match.mixed.clear()
        match.repeated, match.strange, match.simulated, match.last = 0, 0, True, None
    layouts = [_layouts(reader, match) for match in matches]
    known = np.array([0, *(match.values.get("match_id", 0) for match in matches)], np.uint64)
    for at, place in enumerate(reader.places):
        data, found, _ = reader.load(place)
        ids = matches[0].ids_of(data, found)
        strange = int((~np.isin(ids, known)).sum()) if known[1:].all() else 0
        for match, layout in zip(matches, layouts, strict=True):
            match.strange += strange
            own = match.belonging.chosen(ids, at, found)
            if not own.all():
                match.mixed.add(at)
            _index_place(reader, match, layout, (at, place, data, found[own]))
    for match in matches:
        match.episodes = [match._ends[number] for number in sorted(match._ends)]


def _index_place(
    reader: BagReader,
    match: Found,
    layouts: dict[int, Any],
    content: tuple[int, Place, bytes, np.ndarray],
) -> None:
    at, place, data, found = content
    low, high = 2**63 - 1, -1
    for number in np.unique(found[:, 0]).tolist():
        if number not in layouts:
            continue
        codec, of_topic = layouts[number], found[found[:, 0] == number]
        try:
            heads = rows.fronts(codec, data, of_topic)
            if codec.message_type == EPISODE:
                _add_ends(match, heads)
                continue
            checked.check_moments(heads)
        except KeepawayError as error:
            name = reader.kinds[number].name
            raise KeepawayError(f"{reader.path}: {name}: {error}") from error
        match.counts[reader.kinds[number].name] += len(of_topic)
        keys = checked.moment_keys(heads)
        low, high = min(low, int(keys.min())), max(high, int(keys.max()))
        if codec.message_type != ACTION_REQUEST and match.simulated:
            match.simulated = bool((checked.stamps_of(heads) == of_topic[:, 1]).all())
        if codec.message_type == FIELD_STATE:
            _note_last(match, heads, keys)
    if high >= 0:
        match.pieces.append(Piece(low, high, place.run.size, at))


def _layouts(reader: BagReader, match: Found) -> dict[int, Any]:
    """How the match's keyed messages are laid out, by their topics' numbers.

    Raises:
        KeepawayError: a definition that lacks what tells messages apart, or a wrong type.
    """
    layouts = {}
    for number, topic in enumerate(reader.kinds):
        expected = _expected_type(match, topic.name)
        if expected is None:
            continue
        if topic.message_type != expected:
            carried = checked.printable(topic.message_type)
            raise KeepawayError(f"{reader.path}: {topic.name} carries {carried}, not {expected}")
        reader.number(topic.name)  # of one type only
        codec = reader.codec_of(number)
        try:
            rows.check_fields(codec, _KEY_FIELDS[expected], {})
            if {*_KEY_FIELDS[expected]} - {*(codec.front({}).names or ())}:
                raise KeepawayError("its definition begins otherwise than this version's")
        except KeepawayError as error:
            raise KeepawayError(f"{reader.path}: {topic.name}: {error}") from error
        layouts[number] = codec
    return layouts


def _expected_type(match: Found, topic: str) -> str | None:
    """What a topic of a match carries; None: it is none of those that are indexed."""
    name = topic.rpartition("/")[2]
    if name in ("field_state", "episode") and topic == f"{match.namespace}/{name}":
        return EPISODE if name == "episode" else FIELD_STATE
    for player in match.values["player_names"]:
        if name in _KEYED and topic == f"{match.namespace}/{player}/{name}":
            return _KEYED[name]
    return None


def _namespace_of(topic: str) -> str:
    parts = topic.split("/")
    return "/".join(parts[:-2] if parts[-1] in ("perception", "action_request") else parts[:-1])


def _add_ends(match: Found, data: np.ndarray) -> None:
    checked.check_episodes(data, match.task)
    for entry in data:
        number = int(entry["number"])
        match.repeated += number in match._ends
        match._ends.setdefault(number, entry.copy())


def _note_last(match: Found, heads: np.ndarray, keys: np.ndarray) -> None:
    newest = heads[int(keys.argmax())]
    stamp = int(checked.stamps_of(newest[None])[0])
    last = int(newest["episode"]), int(newest["cycle"]), int(newest["outcome"]), stamp
    if match.last is None or last > match.last:
        match.last = last
