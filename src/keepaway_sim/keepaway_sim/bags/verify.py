"""Does a recorded match replay? The world is played again with the recorded requests.

It must give, cycle for cycle, the very bytes that were recorded as perceptions and truth. Whether
the players would decide the same again is checked by `keepaway_agent.checks.decisions`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from keepaway_sim.bags.match_bag import EpisodeSummary, MatchBag, Track
from keepaway_sim.errors import KeepawayError
from keepaway_sim.match.beginning import begin_match
from keepaway_sim.task import Outcome
from keepaway_sim.world.world import World


class Difference(NamedTuple):
    """Where what was recorded and what came of playing it again are not the same."""

    what: str  # "position of keeper_1"
    episode: int
    cycle: int

    def __str__(self) -> str:
        return f"{self.what} differs in episode {self.episode} at cycle {self.cycle}"


class Checked(NamedTuple):
    """How a check went."""

    episodes: int
    compared: int  # cycles, or decisions
    difference: Difference | None  # the first one


def check_world(bag: MatchBag) -> Checked:
    """Play a recorded match's finished episodes again, until something differs.

    Raises:
        KeepawayError: the bag does not begin with the match, or has gaps.
    """
    world = World(bag.task, bag.config)
    begin_match(world, bag.match["seed"], bag.match.get("first_episode", 0))
    episodes = compared = 0
    for episode, track in whole_episodes(bag):
        if episode.number != world.belief.episode[0]:
            raise KeepawayError(
                f"{bag.reader.path}: episode {world.belief.episode[0]} was not recorded, so"
                f" episode {episode.number} cannot be played again"
            )
        for row in range(len(track.time)):
            difference = _compare(world, track, row)
            if difference:
                return Checked(episodes, compared, difference)
            compared += 1
            _go_on(world, track, row)
        episodes += 1
    return Checked(episodes, compared, None)


def whole_episodes(bag: MatchBag) -> Iterator[tuple[EpisodeSummary, Track]]:
    """Every finished episode with its track.

    Raises:
        KeepawayError: a cycle is missing, or someone's perceptions, or every episode's end.
    """
    waiting = list(bag.episodes())
    if not waiting:
        raise KeepawayError(f"{bag.reader.path} has no episode's end, so none to play again")
    for episode, track in bag.tracks(waiting):
        due = waiting.pop(0)
        _check_whole(bag, due, track if due is episode else None)
        yield episode, track
    for episode in waiting:
        _check_whole(bag, episode, None)


def _check_whole(bag: MatchBag, episode: EpisodeSummary, track: Track | None) -> None:
    """Whether all cycles of an episode came."""
    found = 0 if track is None else len(track.time)
    expected = episode.cycles + 1 + (episode.outcome == Outcome.ABORTED)
    where = f"{bag.reader.path}: episode {episode.number}"
    if track is None or found != expected:
        raise KeepawayError(f"{where} has {found} of its {expected} field states")
    absent = np.isnan(track.believed).all(axis=(2, 3)).sum(axis=0)
    for name, count in zip(bag.match["player_names"], absent.tolist(), strict=True):
        if count:
            raise KeepawayError(f"{where} lacks {count} perceptions of {name}")


def _compare(world: World, track: Track, row: int) -> Difference | None:
    state, seen = world.truth, world.belief
    recorded = {
        "position": (track.position[row], state.position[0]),
        "yaw": (track.yaw[row], state.yaw[0]),
        "neck": (track.neck[row], seen.neck[0]),
        "outcome": (track.outcome[row], seen.outcome[0]),
        "cycle": (track.cycle[row], seen.cycle[0]),
        "belief": (track.believed[row], seen.position[0]),
        "age": (track.age[row], seen.age[0]),
    }
    for what, (then, now) in recorded.items():
        if not np.array_equal(then, now):
            return Difference(what, int(seen.episode[0]), int(seen.cycle[0]))
    return None


def _go_on(world: World, track: Track, row: int) -> None:
    """Play the cycle as it was played; requests that were not recorded are in the next state."""
    last = row + 1 == len(track.time)
    is_aborted = not last and track.outcome[row + 1] == Outcome.ABORTED
    if is_aborted and track.cycle[row + 1] == track.cycle[row]:  # as bags before 2026 have it
        world.abort(0)
        return
    now = track.requested[row], track.requested_target[row]
    then = (now[0], now[1]) if last else (track.action[row + 1], track.target[row + 1])
    asked = now[0] >= 0
    action = np.where(asked, now[0], then[0])
    target = np.where(asked, now[1], then[1])
    world.step(np.maximum(action, 0)[None], np.maximum(target, 0)[None])
    if is_aborted:
        world.abort(0)
