"""Episodes of a match: recorded from a World without ROS, and read from a bag as arrays.

Topics are found by their types, so a match may have been recorded in any namespace.
"""

from __future__ import annotations

import functools
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from keepaway_sim.bags import checked
from keepaway_sim.bags.blocks import Block
from keepaway_sim.bags.matches import find_matches
from keepaway_sim.bags.merging import merged
from keepaway_sim.bags.moments import Moments, Sorter
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.timeline import Timeline, chosen_match
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Outcome, Task
from keepaway_sim.wire.messages import CYCLE_NS, MATCH
from keepaway_sim.world.config import CYCLE_TIME, NEVER, Config


class EpisodeSummary(NamedTuple):
    """One finished episode of a bag."""

    number: int
    start: int  # [ns] simulated time of the kick-off
    end: int  # [ns] of the last perceptions
    cycles: int
    duration: float  # [s]
    outcome: Outcome
    lost_by: int  # player index; -1 none


def episode_summary(entry: np.void) -> EpisodeSummary:
    """What an Episode message contains."""
    end = int(checked.stamps_of(np.array([entry]))[0])
    cycles = int(entry["cycles"])
    return EpisodeSummary(
        number=int(entry["number"]),
        start=end - cycles * CYCLE_NS,
        end=end,
        cycles=cycles,
        duration=float(entry["duration"]),
        outcome=Outcome(int(entry["outcome"])),
        lost_by=int(entry["lost_by"]),
    )


class Track(NamedTuple):
    """One episode cycle by cycle; T cycles, P players, objects are players and, last, the ball.

    What was not recorded is NaN (positions, values), NEVER (ages) or -1 (actions, targets).
    """

    time: np.ndarray  # (T,) int64 [ns] simulated
    outcome: np.ndarray  # (T,) IN_PLAY but in the last row
    cycle: np.ndarray  # (T,) since kick-off
    position: np.ndarray  # (T, P + 1, 2) [m] truth
    velocity: np.ndarray  # (T, P + 1, 2) [m/s] truth
    yaw: np.ndarray  # (T, P) [rad] truth
    neck: np.ndarray  # (T, P) [rad]
    action: np.ndarray  # (T, P) what every player does
    target: np.ndarray  # (T, P)
    believed: np.ndarray  # (T, P, P + 1, 2) [m] where each player believes every object
    age: np.ndarray  # (T, P, P + 1) [cycles] how old that is
    kickable: np.ndarray  # (T, P) bool: believes that it can kick the ball
    due: np.ndarray  # (T, P) bool: has to decide
    cycles_to_ball: np.ndarray  # (T, P, P) [cycles] of the fastest of its team; else NEVER
    requested: np.ndarray  # (T, P) what was asked for in answer to this cycle; -1: nothing
    requested_target: np.ndarray  # (T, P)
    values: np.ndarray  # (T, P, num_keepers) action values of learners


class MatchBag:
    """One match of a bag, understood.

    Its messages are ordered by episode, cycle and player, whatever their log times; what came
    more than once counts once.

    Attributes:
        reader: the bag.
        found: where the match is in it.
        match: the Match message's fields.
        task: who plays, on what field.
        timeline: its messages, and what was recorded with them, as they came.
        message_count: of the bag; where it has several matches, this one's perceptions, field
            states and requests.
    """

    def __init__(self, path: Path | str, number: int | None = None) -> None:
        """Open a bag.

        Args:
            path: of the bag.
            number: of the match, from 1 on, where the bag has several.

        Raises:
            KeepawayError: no bag, none of a match, or of several and none is chosen.
        """
        self.reader = BagReader(path)
        matches = find_matches(self.reader)
        if not matches:
            raise KeepawayError(f"{path}: {self._why_none()}")
        self.found = chosen_match(matches, number, self.reader)
        self.match, self.task = self.found.values, self.found.task
        self.namespace = self.found.namespace
        others = [match for match in matches if match is not self.found]
        self.timeline = Timeline(self.reader, self.found, others)
        own = sum(self.found.counts.values())
        self.message_count = own if others else self.reader.message_count

    @functools.cached_property
    def config(self) -> Config:
        """The world's configuration.

        Raises:
            KeepawayError: the bag's is not one that this version knows.
        """
        try:
            data = checked.read_json(self.match["config_json"], "config_json")
            return Config.from_dict(checked.without_retired_settings(data))
        except (KeepawayError, OverflowError, AttributeError) as error:
            raise KeepawayError(f"{self.reader.path}: {error}") from error

    @property
    def kickable_distance(self) -> float:
        """From how near [m] a player kicks the ball; also of a configuration of other versions.

        Raises:
            KeepawayError: the bag's configuration does not tell it.
        """
        try:
            data = checked.read_json(self.match["config_json"], "config_json")
            return checked.kickable_distance(data)
        except KeepawayError as error:
            raise KeepawayError(f"{self.reader.path}: {error}") from error

    @functools.cached_property
    def agents(self) -> dict[str, dict[str, Any]]:
        """The settings of every player, by name, where the bag says who played; else empty.

        Raises:
            KeepawayError: it says it in another way than this version does.
        """
        try:
            return checked.read_agents(self.reader.info.get("agents", "{}"))
        except KeepawayError as error:
            raise KeepawayError(f"{self.reader.path}: {error}") from error

    def topic(self, name: str) -> str:
        """The full name of one of the match's topics, "keeper_1/perception"."""
        return f"{self.namespace}/{name}"

    def player_topics(self, name: str) -> list[str]:
        """The full names of every player's topic of that name, in match order."""
        return [self.topic(f"{player}/{name}") for player in self.match["player_names"]]

    def episodes(self) -> Iterator[EpisodeSummary]:
        """Every finished episode, in order."""
        return map(episode_summary, self.found.episodes)

    def unfinished(self) -> EpisodeSummary | None:
        """The episode that was being played when the recording ended, if there was one."""
        if self.found.last is None or self.found.last[2] != Outcome.IN_PLAY:
            return None
        episode, cycles, _, end = self.found.last
        if self.found.episodes and int(self.found.episodes[-1]["number"]) >= episode:
            return None
        start = end - cycles * CYCLE_NS
        duration = cycles * CYCLE_TIME
        return EpisodeSummary(episode, start, end, cycles, duration, Outcome.IN_PLAY, -1)

    def moments(self, episodes: Collection[int] | None = None) -> Iterator[Moments]:
        """All that was said in some episodes, or in all: in order, each thing once, and checked.

        Raises:
            KeepawayError: messages that do not fit the match.
        """
        sorter = Sorter(self.reader, self.found)
        wanted = None if episodes is None else np.array(sorted(episodes), dtype=np.int64)

        def load(number: int) -> Block:
            block = sorter.load(number)
            if wanted is None:
                return block
            chosen = np.isin(block.keys >> 32, wanted)
            return Block(block.data, block.rows[chosen], block.keys[chosen])

        pieces = self.found.pieces
        if wanted is not None:
            pieces = [piece for piece in pieces if _reaches(piece.low, piece.high, wanted)]
        for block in merged(pieces, load):
            if len(block.rows):
                yield sorter.moments(block)

    def track(self, episode: EpisodeSummary) -> Track:
        """One episode's whole course.

        Raises:
            KeepawayError: none of its field states was recorded.
        """
        for _, track in self.tracks([episode]):
            return track
        raise KeepawayError(f"{self.reader.path}: no field states of episode {episode.number}")

    def tracks(
        self, episodes: Collection[EpisodeSummary]
    ) -> Iterator[tuple[EpisodeSummary, Track]]:
        """The courses of some episodes in order, from one reading of the bag.

        Those of which no field state was recorded are left out.
        """
        by_number = {episode.number: episode for episode in episodes}
        pending: dict[int, list[Moments]] = {}
        for moments in self.moments(by_number):
            newest = moments.last_episode
            for number, part in moments.by_episode():
                pending.setdefault(number, []).append(part)
            for number in sorted(n for n in pending if n < newest):
                yield from _tracked(by_number[number], pending.pop(number), self)
        for number in sorted(pending):
            yield from _tracked(by_number[number], pending[number], self)

    def _why_none(self) -> str:
        topics = self.reader.of_type(MATCH)
        if topics:
            return "the match was never described"
        untyped = [t.name for t in self.reader.topics.values() if not t.message_type]
        hint = f"; {', '.join(untyped)[:100]}: without a type" if untyped else ""
        return f"one topic of {MATCH} was expected, found none{hint}"


def _reaches(low: int, high: int, episodes: np.ndarray) -> bool:
    first, last = np.searchsorted(episodes, [low >> 32, (high >> 32) + 1])
    return bool(last > first)


def _tracked(
    episode: EpisodeSummary, parts: list[Moments], bag: MatchBag
) -> Iterator[tuple[EpisodeSummary, Track]]:
    """An episode's track, if a field state of it was recorded."""
    states = [part.states for part in parts if len(part.states)]
    if not states:
        return
    keys = np.concatenate([checked.moment_keys(state) for state in states])
    track = _empty_track(np.concatenate(states), bag.task)
    for part in parts:
        for player, data in part.perceptions.items():
            _add_perceptions(track, keys, player, data)
        for player, pieces in part.requests.items():
            for data in pieces:
                _add_requests(track, keys, player, data)
    yield episode, track


def _empty_track(state: np.ndarray, task: Task) -> Track:
    count, num = len(state), task.num_players
    return Track(
        time=checked.stamps_of(state),
        outcome=state["outcome"].astype(np.int64),
        cycle=state["cycle"].astype(np.int64),
        position=state["positions"].reshape(count, num + 1, 2).copy(),
        velocity=state["velocities"].reshape(count, num + 1, 2).copy(),
        yaw=state["yaws"].copy(),
        neck=state["neck_yaws"].copy(),
        action=state["actions"].astype(np.int64),
        target=state["targets"].astype(np.int64),
        believed=np.full((count, num, num + 1, 2), np.nan),
        age=np.full((count, num, num + 1), NEVER, dtype=np.int64),
        kickable=np.zeros((count, num), dtype=np.bool_),
        due=np.zeros((count, num), dtype=np.bool_),
        cycles_to_ball=np.full((count, num, num), NEVER, dtype=np.int64),
        requested=np.full((count, num), -1, dtype=np.int64),
        requested_target=np.full((count, num), -1, dtype=np.int64),
        values=np.full((count, num, task.num_keepers), np.nan),
    )


def _rows_of(keys: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Where keys are among others that are sorted; -1: they are not."""
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    found: np.ndarray = np.where(keys[at] == wanted, at, -1)
    return found


def _add_perceptions(track: Track, keys: np.ndarray, player: int, data: np.ndarray) -> None:
    at = _rows_of(keys, checked.moment_keys(data))
    data, at = data[at >= 0], at[at >= 0]
    track.believed[at, player] = data["positions"].reshape(len(at), *track.believed.shape[2:])
    track.age[at, player] = data["ages"]
    track.kickable[at, player] = data["ball_kickable"]
    track.due[at, player] = data["decision_due"]
    track.cycles_to_ball[at, player] = data["cycles_to_ball"]


def _add_requests(track: Track, keys: np.ndarray, player: int, data: np.ndarray) -> None:
    at = _rows_of(keys, checked.moment_keys(data))
    data, at = data[at >= 0], at[at >= 0]
    track.requested[at, player] = data["action"]
    track.requested_target[at, player] = data["target"]
    if "action_values" in (data.dtype.names or ()):
        values = data["action_values"][:, : track.values.shape[2]]
        track.values[at, player, : values.shape[1]] = values
