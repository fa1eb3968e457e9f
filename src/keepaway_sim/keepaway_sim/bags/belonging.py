"""Which messages are a match's: by the number that they carry, else by where they stand."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from typing import NamedTuple

import numpy as np

from keepaway_sim.bags import checked, rows
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Task
from keepaway_sim.wire.cdr import Codec
from keepaway_sim.wire.messages import (
    ACTION_REQUEST,
    AGENT_STATUS,
    EPISODE,
    FIELD_STATE,
    MATCH,
    PERCEPTION,
)

_DEPTHS = {MATCH: 0, EPISODE: 0, FIELD_STATE: 0}
_DEPTHS |= {AGENT_STATUS: 1, PERCEPTION: 1, ACTION_REQUEST: 1}  # below the player's name
"""Slashes in the names of topics whose messages carry a match's number, within its namespace."""


class Span(NamedTuple):
    """A part of a namespace's messages."""

    by_time: bool = True  # by log times [ns]; else by places: number << 32 | row
    begin: int = -(2**63)
    end: int = 2**63 - 1

    def chosen(self, number: int, found: np.ndarray) -> np.ndarray:
        """(n,) bool for the rows of the place with that number."""
        at = found[:, 1] if self.by_time else (number << 32) + np.arange(len(found))
        chosen: np.ndarray = (at >= self.begin) & (at < self.end)
        return chosen


class Belonging(NamedTuple):
    """What tells a match's messages from those of all others in its namespace.

    Messages carry the number of their match since matches have numbers. What carries none (clocks,
    markers, messages of before) belongs to the match in whose span it stands.
    """

    match_id: int = 0  # 0: its messages carry none that is theirs alone
    others: tuple[int, ...] = ()  # of the matches beside it
    span: Span = Span()

    def chosen(self, ids: np.ndarray, number: int, found: np.ndarray) -> np.ndarray:
        """(n,) bool: whose messages the rows of a place are.

        Args:
            ids: (n,) that they carry, 0 where they carry none.
            number: of the place.
            found: (n, 4) its rows.
        """
        inside = self.span.chosen(number, found)
        chosen: np.ndarray
        if self.match_id:
            chosen = (ids == self.match_id) | (inside & (ids == 0))
        else:
            chosen = inside & ~np.isin(ids, np.array(self.others, np.uint64))
        return chosen


def lengths_of(task: Task) -> dict[str, dict[str, int]]:
    """The lengths of the sequences in a match's messages, by type."""
    num, objects = task.num_players, task.num_players + 1
    places = {"positions": 2 * objects, "velocities": 2 * objects}
    return {
        FIELD_STATE: {**places, "yaws": num, "neck_yaws": num, "actions": num, "targets": num},
        PERCEPTION: {**places, "ages": objects, "cycles_to_ball": num},
        ACTION_REQUEST: {},
    }


class MatchIds:
    """Reads from messages of one namespace which match they are of."""

    def __init__(self, reader: BagReader, namespace: str, tasks: Collection[Task]) -> None:
        """Find the topics.

        Args:
            reader: the bag.
            namespace: of the matches.
            tasks: theirs; a message as long as none of them makes it carries no number.
        """
        self._lengths = [lengths_of(task) for task in dict.fromkeys(tasks)]
        self._readers: dict[int, Callable[[bytes, np.ndarray], np.ndarray]] = {}
        prefix = f"{namespace}/"
        for number, topic in enumerate(reader.kinds):
            depth = topic.name.removeprefix(prefix).count("/")
            if topic.name.startswith(prefix) and depth == _DEPTHS.get(topic.message_type):
                found = self._reader_of(reader, number)
                if found:
                    self._readers[number] = found

    def of(self, data: bytes, found: np.ndarray) -> np.ndarray:
        """(n,) uint64 the numbers of the matches that messages are of; 0: they do not say."""
        ids = np.zeros(len(found), np.uint64)
        for number in np.unique(found[:, 0]).tolist():
            if number in self._readers:
                own = found[:, 0] == number
                ids[own] = self._readers[number](data, found[own])
        return ids

    def _reader_of(
        self, reader: BagReader, number: int
    ) -> Callable[[bytes, np.ndarray], np.ndarray] | None:
        try:
            codec = reader.codec_of(number)
            if codec.message_type in (MATCH, AGENT_STATUS):
                return lambda data, found: _decoded_ids(codec, data, found)
            layouts = list(self._layouts(codec))
        except KeepawayError:  # a reader that needs the topic reports it
            return None
        return lambda data, found: _ids_in(layouts, data, found)

    def _layouts(self, codec: Codec) -> Iterator[np.dtype[np.void]]:
        """How messages with a number are laid out, up to it."""
        if codec.message_type == ACTION_REQUEST:
            choices = [{"action_values": count} for count in range(checked.MOST_VALUES + 1)]
        else:
            choices = [lengths.get(codec.message_type, {}) for lengths in self._lengths]
        for lengths in choices:
            layout = codec.front(lengths)
            if layout.names and "match_id" in layout.names and layout["match_id"] == np.uint64:
                yield layout


def _ids_in(layouts: list[np.dtype[np.void]], data: bytes, found: np.ndarray) -> np.ndarray:
    ids = np.zeros(len(found), np.uint64)
    left = np.arange(len(found))
    for layout in layouts:
        own = rows.laid_out(layout, data, found[left])
        ids[left[own]] = rows.field(layout, "match_id", data, found[left[own]])
        left = left[~own]
        if not len(left):
            break
    return ids


def _decoded_ids(codec: Codec, data: bytes, found: np.ndarray) -> np.ndarray:
    ids = np.zeros(len(found), np.uint64)
    for row, (first, last) in enumerate(found[:, 2:].tolist()):
        try:
            value = codec.decode(data[first:last]).get("match_id", 0)
        except KeepawayError:  # a reader that needs it reports it
            continue
        ids[row] = value if isinstance(value, int) and 0 <= value < 2**64 else 0
    return ids
