"""What happened in a recorded match: a row for every episode, passes, losses, actions; and figures.

A bag is read once, chunk by chunk, and the rows are written as they are made: memory does not grow
with the bag but by a few numbers an episode.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from keepaway_sim.bags.match_bag import EpisodeSummary, MatchBag, episode_summaries
from keepaway_sim.bags.topics import Batch
from keepaway_sim.task import Action, Outcome


class EpisodeRow(NamedTuple):
    """One episode of the table."""

    number: int
    start_s: float  # simulated time of the kick-off
    cycles: int
    duration_s: float
    outcome: str  # "taken_away", "out_of_bounds" or "aborted"
    lost_by: str  # the keeper that had the ball last, or empty
    lost_x: float  # where the ball was at the end [m]
    lost_y: float
    passes: int  # that arrived at another keeper
    decisions: int  # of keepers with the ball: holds and passes asked for
    holds: int  # those of them that were holds
    held_cycles: int  # with the ball within a keeper's reach


@dataclass
class Tally:
    """What a match's table does not say by episode.

    Attributes:
        passes: (num_keepers, num_keepers), from whom to whom the ball went.
        actions: (num_players, num_actions) requests.
        losses: where the ball was at the end of episodes, x and y [m] and the outcome.
        durations: of the episodes [s].
    """

    passes: np.ndarray
    actions: np.ndarray
    losses: list[tuple[float, float, int]]
    durations: list[float]


class _Partial:
    """What is known so far of an episode that goes on."""

    __slots__ = ("ball", "decisions", "held", "holds", "passes")

    def __init__(self) -> None:
        self.passes = self.decisions = self.holds = self.held = 0
        self.ball = (float("nan"), float("nan"))


class Analyst:
    """Reads a bag once, giving a row for every finished episode; the rest is in `tally`.

    Attributes:
        bag: the match.
        tally: filled while `rows` is consumed.
    """

    def __init__(self, bag: MatchBag) -> None:
        """Begin with nothing counted."""
        task, physics = bag.task, bag.config.physics
        self.bag = bag
        self.tally = Tally(
            passes=np.zeros((task.num_keepers, task.num_keepers), dtype=np.int64),
            actions=np.zeros((task.num_players, len(Action)), dtype=np.int64),
            losses=[],
            durations=[],
        )
        self._reach = physics.player_size + physics.ball_size + physics.kickable_margin
        self._partial: dict[int, _Partial] = {}
        self._last = (-1, -1)  # episode, and the last keeper in it that had the ball
        self._requests = {
            topic: player for player, topic in enumerate(bag.player_topics("action_request"))
        }

    def rows(self) -> Iterator[EpisodeRow]:
        """The table's rows, in order."""
        states, episodes = self.bag.topic("field_state"), self.bag.topic("episode")
        waiting: list[EpisodeSummary] = []
        newest = -1
        for batch in self.bag.reader.batches([states, episodes, *self._requests]):
            if batch.topic == episodes:
                waiting += episode_summaries(batch)
            elif batch.topic == states:
                self._add_states(batch)
                newest = int(batch.data["episode"][-1])
            else:
                self._add_requests(self._requests[batch.topic], batch)
            while waiting and waiting[0].number + 1 < newest:
                yield self._row(waiting.pop(0))
        for episode in waiting:
            yield self._row(episode)

    def _row(self, episode: EpisodeSummary) -> EpisodeRow:
        known = self._partial.pop(episode.number, None) or _Partial()
        self.tally.durations.append(episode.duration)
        self.tally.losses.append((*known.ball, int(episode.outcome)))
        by = episode.lost_by
        return EpisodeRow(
            number=episode.number,
            start_s=episode.start / 1e9,
            cycles=episode.cycles,
            duration_s=round(episode.duration, 6),
            outcome=episode.outcome.name.lower(),
            lost_by=self.bag.match["player_names"][by] if by >= 0 else "",
            lost_x=known.ball[0],
            lost_y=known.ball[1],
            passes=known.passes,
            decisions=known.decisions,
            holds=known.holds,
            held_cycles=known.held,
        )

    def _of(self, episode: int) -> _Partial:
        return self._partial.setdefault(episode, _Partial())

    def _add_states(self, batch: Batch) -> None:
        data = batch.data
        position = data["positions"].reshape(len(data), -1, 2)
        keepers = position[:, : self.bag.task.num_keepers]
        away = np.linalg.norm(keepers - position[:, -1:], axis=2)
        holder = np.where(away.min(axis=1) < self._reach, away.argmin(axis=1), -1)
        held = holder >= 0
        episode = data["episode"].astype(np.int64)
        for number, count in zip(*np.unique(episode[held], return_counts=True), strict=True):
            self._of(int(number)).held += int(count)
        self._add_passes(episode[held], holder[held])
        for row in np.flatnonzero(data["outcome"] != Outcome.IN_PLAY).tolist():
            x, y = position[row, -1].tolist()
            self._of(int(episode[row])).ball = (x, y)

    def _add_passes(self, episode: np.ndarray, holder: np.ndarray) -> None:
        """Count who had the ball after whom; rows without a holder are left out."""
        if not len(holder):
            return
        before = np.concatenate([[self._last[1]], holder[:-1]])
        same = np.concatenate([[self._last[0]], episode[:-1]]) == episode
        passed = same & (before != holder)
        np.add.at(self.tally.passes, (before[passed], holder[passed]), 1)
        numbers, counts = np.unique(episode[passed], return_counts=True)
        for number, count in zip(numbers.tolist(), counts.tolist(), strict=True):
            self._of(number).passes += count
        self._last = int(episode[-1]), int(holder[-1])

    def _add_requests(self, player: int, batch: Batch) -> None:
        action = batch.data["action"]
        self.tally.actions[player] += np.bincount(action, minlength=len(Action))[: len(Action)]
        if player >= self.bag.task.num_keepers:
            return
        for wanted in (Action.HOLD_BALL, Action.PASS_BALL):
            numbers, counts = np.unique(batch.data["episode"][action == wanted], return_counts=True)
            for number, count in zip(numbers.tolist(), counts.tolist(), strict=True):
                partial = self._of(number)
                partial.decisions += count
                partial.holds += count if wanted == Action.HOLD_BALL else 0


def episode_table(path: Path | str) -> pd.DataFrame:
    """The table of a bag's finished episodes, a row each (see `EpisodeRow`)."""
    rows = list(Analyst(MatchBag(path)).rows())
    return pd.DataFrame(rows, columns=list(EpisodeRow._fields))
