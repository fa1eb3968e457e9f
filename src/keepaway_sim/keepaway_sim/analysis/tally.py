"""What happened in a recorded match: a row for every episode, passes, losses, actions; and figures.

A bag is read moment by moment, and the rows are written as they are made: memory does not grow
with the bag but by a few numbers an episode. What depends on missing messages is not counted:
passes, and where the ball was, only of episodes whose field states are all there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from keepaway_sim.bags.gaps import gap_counter
from keepaway_sim.bags.match_bag import EpisodeSummary, MatchBag
from keepaway_sim.bags.moments import joined
from keepaway_sim.task import Action, Outcome

if TYPE_CHECKING:
    import pandas as pd


class EpisodeRow(NamedTuple):
    """One episode of the table; None where messages are missing that it would rest on."""

    number: int
    start_s: float  # simulated time of the kick-off
    cycles: int
    duration_s: float
    outcome: str  # "taken_away", "out_of_bounds" or "aborted"
    lost_by: str  # the keeper that had the ball last, or empty
    lost_x: float | None  # where the ball was at the end [m]
    lost_y: float | None
    passes: int | None  # that arrived at another keeper
    decisions: int | None  # of keepers with the ball: holds and passes asked for
    holds: int | None  # those of them that were holds
    held_cycles: int | None  # with the ball within a keeper's reach


@dataclass
class Tally:
    """What a match's table does not say by episode.

    Attributes:
        passes: (num_keepers, num_keepers), from whom to whom the ball went.
        actions: (num_players, num_actions) requests.
        losses: where the ball was at the end of episodes, x and y [m] and the outcome.
        durations: of the episodes [s].
        outcomes: of the episodes.
        whole: how many episodes have all their field states; passes and losses are theirs.
    """

    passes: np.ndarray
    actions: np.ndarray
    losses: list[tuple[float, float, int]]
    durations: list[float]
    outcomes: list[int]
    whole: int = 0


class _Partial:
    """What is known so far of an episode that is running."""

    __slots__ = ("ball", "decisions", "held", "holds", "passes", "states")

    def __init__(self) -> None:
        self.decisions = self.holds = self.held = self.states = 0
        self.passes: dict[tuple[int, int], int] = {}  # from whom to whom
        self.ball: tuple[float, float] | None = None

    def is_whole(self, episode: EpisodeSummary) -> bool:
        """Whether every one of the episode's field states came."""
        aborted = episode.outcome == Outcome.ABORTED  # then the last cycle is published twice
        return self.ball is not None and self.states == episode.cycles + 1 + aborted


class Analyst:
    """Reads a match once, giving a row for every finished episode; the rest is in `tally`.

    Attributes:
        bag: the match.
        tally, gaps: filled while `rows` is consumed.
    """

    def __init__(self, bag: MatchBag) -> None:
        """Begin with nothing counted.

        Raises:
            KeepawayError: the match's configuration does not tell from how near a ball is kicked.
        """
        task = bag.task
        self.bag, self.gaps = bag, gap_counter(bag)
        self.tally = Tally(
            passes=np.zeros((task.num_keepers, task.num_keepers), dtype=np.int64),
            actions=np.zeros((task.num_players, len(Action)), dtype=np.int64),
            losses=[],
            durations=[],
            outcomes=[],
        )
        self._reach = bag.kickable_distance
        self._partial: dict[int, _Partial] = {}
        self._last = (-1, -1)  # episode, and the last keeper in it that had the ball
        counts = bag.found.counts
        keepers = bag.player_topics("action_request")[: task.num_keepers]
        self._knows_requests = all(counts.get(topic) for topic in keepers)

    def rows(self) -> Iterator[EpisodeRow]:
        """The table's rows, in order.

        Raises:
            KeepawayError: messages that do not fit the match.
        """
        waiting = list(self.bag.episodes())[::-1]
        for moments in self.bag.moments():
            self.gaps.add(self.bag, moments)
            self._add_states(moments.states)
            for player, asked in moments.requests.items():
                self._add_requests(player, *joined(asked, "episode", "action"))
            while waiting and waiting[-1].number < moments.last_episode:
                yield self._row(waiting.pop())
        while waiting:
            yield self._row(waiting.pop())

    def _row(self, episode: EpisodeSummary) -> EpisodeRow:
        known = self._partial.pop(episode.number, None) or _Partial()
        ball: tuple[float, float] | None = None
        if known.is_whole(episode) and known.ball:
            ball = known.ball
            self.tally.whole += 1
            self.tally.losses.append((*ball, int(episode.outcome)))
            for (before, now), count in known.passes.items():
                self.tally.passes[before, now] += count
        self.tally.durations.append(episode.duration)
        self.tally.outcomes.append(int(episode.outcome))
        by = episode.lost_by
        return EpisodeRow(
            number=episode.number,
            start_s=episode.start / 1e9,
            cycles=episode.cycles,
            duration_s=round(episode.duration, 6),
            outcome=episode.outcome.name.lower(),
            lost_by=self.bag.match["player_names"][by] if by >= 0 else "",
            lost_x=ball[0] if ball else None,
            lost_y=ball[1] if ball else None,
            passes=sum(known.passes.values()) if ball else None,
            decisions=known.decisions if self._knows_requests else None,
            holds=known.holds if self._knows_requests else None,
            held_cycles=known.held if ball else None,
        )

    def _of(self, episode: int) -> _Partial:
        return self._partial.setdefault(episode, _Partial())

    def _add_states(self, data: np.ndarray) -> None:
        if not len(data):
            return
        position = data["positions"].reshape(len(data), -1, 2)
        keepers = position[:, : self.bag.task.num_keepers]
        away = np.linalg.norm(keepers - position[:, -1:], axis=2)
        holder = np.where(away.min(axis=1) < self._reach, away.argmin(axis=1), -1)
        held = holder >= 0
        episode = data["episode"].astype(np.int64)
        for number, count in _counted(episode):
            self._of(number).states += count
        for number, count in _counted(episode[held]):
            self._of(number).held += count
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
        passed = np.flatnonzero(same & (before != holder))
        moves = zip(episode[passed], before[passed], holder[passed], strict=True)
        for number, giver, taker in moves:
            passes = self._of(int(number)).passes
            passes[int(giver), int(taker)] = passes.get((int(giver), int(taker)), 0) + 1
        self._last = int(episode[-1]), int(holder[-1])

    def _add_requests(self, player: int, episode: np.ndarray, action: np.ndarray) -> None:
        kinds = action.astype(np.int64)
        self.tally.actions[player] += np.bincount(kinds, minlength=len(Action))
        if player >= self.bag.task.num_keepers:
            return
        for wanted in (Action.HOLD_BALL, Action.PASS_BALL):
            for number, count in _counted(episode[kinds == wanted].astype(np.int64)):
                partial = self._of(number)
                partial.decisions += count
                partial.holds += count if wanted == Action.HOLD_BALL else 0


def _counted(numbers: np.ndarray) -> Iterator[tuple[int, int]]:
    """Every different number, and how often it is there."""
    found, counts = np.unique(numbers, return_counts=True)
    return zip(found.tolist(), counts.tolist(), strict=True)


def episode_table(path: Path | str, number: int | None = None) -> pd.DataFrame:
    """The table of a match's finished episodes, a row each (see `EpisodeRow`)."""
    import pandas as pd  # a second and 90 MB that nothing else here needs

    rows = list(Analyst(MatchBag(path, number)).rows())
    return pd.DataFrame(rows, columns=list(EpisodeRow._fields))
