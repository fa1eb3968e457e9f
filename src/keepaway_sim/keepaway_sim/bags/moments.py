"""What was said in a match, moment by moment: in order, each thing once, and checked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from keepaway_sim.bags import checked, rows
from keepaway_sim.bags.belonging import lengths_of
from keepaway_sim.bags.blocks import Block
from keepaway_sim.bags.matches import Found
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire.cdr import Codec
from keepaway_sim.wire.messages import ACTION_REQUEST, FIELD_STATE, PERCEPTION

_STATE_FIELDS = ("positions", "velocities", "yaws", "neck_yaws", "actions", "targets")
_SEEN_FIELDS = ("decision_due", "ball_kickable", "positions", "ages", "cycles_to_ball")


class Moments(NamedTuple):
    """Messages of some episodes and cycles, of each topic in order, each moment once."""

    states: np.ndarray
    perceptions: dict[int, np.ndarray]  # by player
    requests: dict[int, list[np.ndarray]]  # by player; an array for every number of values
    last_episode: int
    repeated: int = 0  # messages that came again

    def by_episode(self) -> Iterator[tuple[int, Moments]]:
        """The same, cut where episodes end."""
        asked = [data for pieces in self.requests.values() for data in pieces]
        arrays = [self.states, *self.perceptions.values(), *asked]
        numbers = np.unique(np.concatenate([data["episode"] for data in arrays]))
        for number in numbers.tolist():
            yield (
                number,
                Moments(
                    _of(self.states, number),
                    {player: _of(data, number) for player, data in self.perceptions.items()},
                    {
                        player: [_of(data, number) for data in pieces]
                        for player, pieces in self.requests.items()
                    },
                    number,
                ),
            )


class Sorter:
    """Reads a match's perceptions, states and requests by moments."""

    def __init__(self, reader: BagReader, found: Found) -> None:
        """Check the definitions.

        Raises:
            KeepawayError: one lacks what reading needs.
        """
        self._reader, self._found = reader, found
        self._lengths = lengths_of(found.task)
        self._topics: dict[int, tuple[Codec, int]] = {}  # layout and player by topic's number
        names = {f"{found.namespace}/field_state": (FIELD_STATE, -1)}
        for player, name in enumerate(found.values["player_names"]):
            names[f"{found.namespace}/{name}/perception"] = PERCEPTION, player
            names[f"{found.namespace}/{name}/action_request"] = ACTION_REQUEST, player
        for number, topic in enumerate(reader.kinds):
            if topic.name in names:
                message_type, player = names[topic.name]
                self._topics[number] = self._layout(number, message_type), player
        self._known = np.array(sorted(self._topics), dtype=np.int64)
        self._before: dict[int, int] = {}  # the last key of each topic

    def load(self, number: int) -> Block:
        """The messages of one place, by the moments that they are of."""
        data, found, _ = self._reader.load(self._reader.places[number])
        found = found[self._found.own(number, data, found) & np.isin(found[:, 0], self._known)]
        keys = np.empty(len(found), dtype=np.int64)
        for topic in np.unique(found[:, 0]).tolist():
            own = found[:, 0] == topic
            keys[own] = checked.moment_keys(rows.fronts(self._topics[topic][0], data, found[own]))
        return Block(data, found, keys)

    def moments(self, block: Block) -> Moments:
        """A block's messages, each once.

        Raises:
            KeepawayError: messages that do not fit the match.
        """
        states: np.ndarray | None = None
        perceptions: dict[int, np.ndarray] = {}
        requests: dict[int, list[np.ndarray]] = {}
        kept = 0
        for topic, (codec, player) in self._topics.items():
            own = self._first_ones(topic, block)
            kept += int(own.sum())
            try:
                if codec.message_type == FIELD_STATE:
                    states = self._states(codec, block.data, block.rows[own])
                elif codec.message_type == PERCEPTION:
                    taken = self._perceptions(codec, block.data, block.rows[own], player)
                    perceptions[player] = taken
                else:
                    found = self._requests(codec, block.data, block.rows[own], player)
                    requests[player] = found
            except KeepawayError as error:
                name = self._reader.kinds[topic].name
                raise KeepawayError(f"{self._reader.path}: {name}: {error}") from error
        repeated = len(block.rows) - kept
        if states is None:
            states = np.zeros(0, _NO_STATES)
        return Moments(states, perceptions, requests, int(block.keys[-1] >> 32), repeated)

    def state(self, data: bytes) -> np.void:
        """One FieldState message of the match.

        Raises:
            KeepawayError: it does not fit the match.
        """
        for codec, player in self._topics.values():
            if player < 0:
                state: np.void = self._states(codec, data, np.array([[0, 0, 0, len(data)]]))[0]
                return state
        raise KeepawayError(f"{self._reader.path}: no topic of field states")

    def _first_ones(self, topic: int, block: Block) -> np.ndarray:
        """Which rows are a topic's, without those that came before with the same key."""
        own: np.ndarray = block.rows[:, 0] == topic
        at = np.flatnonzero(own)
        if len(at):
            keys = block.keys[at]
            again = np.diff(keys, prepend=self._before.get(topic, -1)) == 0
            own[at[again]] = False
            self._before[topic] = int(keys[-1])
        return own

    def _layout(self, number: int, message_type: str) -> Codec:
        codec = self._reader.codec_of(number)
        needed = {FIELD_STATE: _STATE_FIELDS, PERCEPTION: _SEEN_FIELDS}.get(message_type, ())
        try:
            rows.check_fields(codec, needed, self._lengths[message_type])
        except KeepawayError as error:
            name = self._reader.kinds[number].name
            raise KeepawayError(f"{self._reader.path}: {name}: {error}") from error
        return codec

    def _states(self, codec: Codec, data: bytes, found: np.ndarray) -> np.ndarray:
        states = rows.whole(codec, data, found, self._lengths[FIELD_STATE])
        checked.check_states(states, self._found.task)
        return states

    def _perceptions(self, codec: Codec, data: bytes, found: np.ndarray, player: int) -> np.ndarray:
        seen = rows.whole(codec, data, found, self._lengths[PERCEPTION])
        checked.check_perceptions(seen, player)
        return seen

    def _requests(
        self, codec: Codec, data: bytes, found: np.ndarray, player: int
    ) -> list[np.ndarray]:
        if "action_values.length" not in (codec.front({}).names or ()):
            pieces = [rows.whole(codec, data, found, {})]
        else:
            counts = rows.lengths(codec, data, found, "action_values")
            pieces = [
                rows.whole(
                    codec,
                    data,
                    found[counts == count],
                    {"action_values": checked.check_count(count)},
                )
                for count in np.unique(counts).tolist()
            ]
        for asked in pieces:
            checked.check_requests(asked, player, self._found.task)
        return pieces


_NO_STATES = np.dtype([("episode", "<u4"), ("cycle", "<u4"), ("outcome", "u1")])


def _of(data: np.ndarray, episode: int) -> np.ndarray:
    own: np.ndarray = data[data["episode"] == episode]
    return own


def joined(pieces: Sequence[np.ndarray], *names: str) -> list[np.ndarray]:
    """Some fields of messages that stand in several arrays, each as one array."""
    nothing = np.zeros(0, dtype=np.int64)
    return [np.concatenate([data[name] for data in pieces] or [nothing]) for name in names]
