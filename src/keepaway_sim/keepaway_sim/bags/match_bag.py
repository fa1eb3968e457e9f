"""Episodes of a match: recorded from a World without ROS, and read from a bag as arrays.

Topics are found by their types, so a match may have been recorded in any namespace.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.topics import Batch
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Outcome, Task
from keepaway_sim.wire.messages import (
    CYCLE_NS,
    MATCH,
    SECOND,
)
from keepaway_sim.world.config import CYCLE_TIME, NEVER, Config


class EpisodeSummary(NamedTuple):
    """One finished episode of a bag."""

    number: int
    start: int  # [ns] simulated time of the kick-off
    end: int  # [ns] of the last perceptions
    cycles: int
    duration: float  # [s]
    outcome: Outcome
    lost_by: int  # player index; -1 nobody


def episode_summaries(batch: Batch) -> Iterator[EpisodeSummary]:
    """The episodes that a batch of Episode messages tells of."""
    for entry in batch.data:
        end = int(entry["stamp.sec"]) * SECOND + int(entry["stamp.nanosec"])
        cycles = int(entry["cycles"])
        yield EpisodeSummary(
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
    action: np.ndarray  # (T, P) what everybody does
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
    """A bag of a match, understood.

    Attributes:
        reader: the bag.
        match: the Match message's fields.
        task: who plays, on what field.
        names: topics of the match without their namespace -> as recorded.
    """

    def __init__(self, path: Path | str) -> None:
        """Open a bag.

        Raises:
            KeepawayError: no bag, or not of one match.
        """
        self.reader = BagReader(path)
        topics = self.reader.of_type(MATCH)
        if len(topics) != 1:
            found = ", ".join(topics) or "none"
            raise KeepawayError(f"{path}: one topic of {MATCH} was expected, found {found}")
        first = next(self.reader.messages(topics), None)
        if first is None:
            raise KeepawayError(f"{path}: the match was never described")
        self.match = self.reader.codec(first.topic).decode(first.data)
        self.namespace = first.topic.rpartition("/")[0]
        self.task = Task(
            self.match["num_keepers"],
            self.match["num_takers"],
            self.match["field_length"],
            self.match["field_width"],
        )

    @property
    def config(self) -> Config:
        """The world's configuration.

        Raises:
            KeepawayError: the bag's is not one that this version knows.
        """
        return Config.from_dict(json.loads(self.match["config_json"]))

    def topic(self, name: str) -> str:
        """The full name of one of the match's topics, "keeper_1/perception"."""
        return f"{self.namespace}/{name}"

    def player_topics(self, name: str) -> list[str]:
        """The full names of every player's topic of that name, in match order."""
        return [self.topic(f"{player}/{name}") for player in self.match["player_names"]]

    def episodes(self) -> Iterator[EpisodeSummary]:
        """Every finished episode, in order."""
        for batch in self.reader.batches([self.topic("episode")]):
            yield from episode_summaries(batch)

    def unfinished(self) -> EpisodeSummary | None:
        """The episode that was being played when the recording ended, if there was one."""
        since = self.reader.end_time - SECOND
        last = None
        for batch in self.reader.batches([self.topic("field_state")], since):
            last = batch.data[-1]
        if last is None or last["outcome"] != Outcome.IN_PLAY:
            return None
        end = int(last["stamp.sec"]) * SECOND + int(last["stamp.nanosec"])
        cycles = int(last["cycle"])
        return EpisodeSummary(
            int(last["episode"]), end - cycles * CYCLE_NS, end, cycles,
            cycles * CYCLE_TIME, Outcome.IN_PLAY, -1,
        )  # fmt: skip

    def track(self, episode: EpisodeSummary) -> Track:
        """One episode's whole course."""
        return self.tracks(episode.start, episode.end)

    def tracks(self, start: int, end: int) -> Track:
        """What was recorded of start <= simulated time <= end [ns]."""
        said: dict[str, list[np.ndarray]] = {self.topic("field_state"): []}
        for name in ("perception", "action_request"):
            said |= {topic: [] for topic in self.player_topics(name)}
        for batch in self.reader.batches(said, start, end + 1):
            said[batch.topic].append(batch.data)
        states = said[self.topic("field_state")]
        if not states:
            raise KeepawayError(f"{self.reader.path}: no field states from {start} to {end} ns")
        state = np.concatenate(states)
        track = _empty_track(state, self.task)
        moments = {key: row for row, key in enumerate(_moments(state))}
        cycles = {key[1:]: row for key, row in moments.items()}
        for player, topic in enumerate(self.player_topics("perception")):
            for data in said[topic]:
                _add_perceptions(track, moments, player, data)
        for player, topic in enumerate(self.player_topics("action_request")):
            for data in said[topic]:
                _add_requests(track, cycles, player, data)
        return track


def _stamps(data: np.ndarray) -> np.ndarray:
    time: np.ndarray = data["stamp.sec"].astype(np.int64) * SECOND + data["stamp.nanosec"]
    return time


def _moments(data: np.ndarray) -> list[tuple[bool, int, int]]:
    """What tells two cycles apart: an episode that was aborted shows its last cycle twice."""
    ended = (data["outcome"] != Outcome.IN_PLAY).tolist()
    return list(zip(ended, data["episode"].tolist(), data["cycle"].tolist(), strict=True))


def _empty_track(state: np.ndarray, task: Task) -> Track:
    count, num = len(state), task.num_players
    return Track(
        time=_stamps(state),
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


def _add_perceptions(
    track: Track, moments: dict[tuple[bool, int, int], int], player: int, data: np.ndarray
) -> None:
    at = np.array([moments.get(moment, -1) for moment in _moments(data)])
    data, at = data[at >= 0], at[at >= 0]
    track.believed[at, player] = data["positions"].reshape(len(at), -1, 2)
    track.age[at, player] = data["ages"]
    track.kickable[at, player] = data["ball_kickable"]
    track.due[at, player] = data["decision_due"]
    track.cycles_to_ball[at, player] = data["cycles_to_ball"]


def _add_requests(
    track: Track, cycles: dict[tuple[int, int], int], player: int, data: np.ndarray
) -> None:
    answered = zip(data["episode"].tolist(), data["cycle"].tolist(), strict=True)
    at = np.array([cycles.get(cycle, -1) for cycle in answered])
    data, at = data[at >= 0], at[at >= 0]
    track.requested[at, player] = data["action"]
    track.requested_target[at, player] = data["target"]
    if "action_values" in (data.dtype.names or ()):
        values = data["action_values"][:, : track.values.shape[2]]
        track.values[at, player, : values.shape[1]] = values
