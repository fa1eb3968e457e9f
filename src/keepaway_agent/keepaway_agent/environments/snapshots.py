"""Snapshots of environments, from which play can be continued.

A snapshot is plain data: it can be pickled, kept, and put into any environment of the same task
and configuration, any number of times. Equal choices after it give equal play, bit for bit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from keepaway_agent.environments.refusals import checked_seed
from keepaway_agent.errors import AgentError
from keepaway_sim.world.streams import StreamSnapshot
from keepaway_sim.world.world import FieldSnapshot


class FieldState(NamedTuple):
    """All there is of one of `DecisionFields`; see `DecisionFields.get_state`."""

    world: FieldSnapshot
    streams: list[StreamSnapshot]  # of the players' policies
    takers: np.ndarray  # (3, num_takers) int64: last choice, when, and whom it named
    requests: np.ndarray  # (2, num_players) int64: actions and targets
    choosing: np.ndarray  # (num_players,) bool


class KeeperState(NamedTuple):
    """Of a field of `KeeperEnv` and `KeeperVectorEnv`."""

    field: FieldState
    books: tuple[int | bool, ...]  # its row of `KeeperBooks`


class TurnState(NamedTuple):
    """Of `KeepawayAECEnv`."""

    field: FieldState
    agents: list[str]
    selected: str
    choices: dict[str, int]  # made, but not in force yet
    books: tuple[dict[str, Any], ...]  # rewards, their sums, terminations, truncations, infos


class CycleState(NamedTuple):
    """Of `KeepawayParallelEnv`."""

    field: FieldState
    agents: list[str]


def with_new_luck(state: FieldState, seed: int) -> FieldState:
    """The same moment, with all random numbers from now on drawn from a seed.

    For planners: without it a rollout meets exactly the noise that the real play will meet.
    """
    checked = checked_seed(seed)
    children = np.random.SeedSequence(checked).spawn(1 + len(state.streams))
    streams = [StreamSnapshot(np.random.default_rng(child), np.empty(0)) for child in children]
    return state._replace(world=state.world._replace(random=streams[0]), streams=streams[1:])


def require_kind(state: Any, kind: type) -> Any:
    """Refuse what is no snapshot of this kind of environment.

    Raises:
        AgentError: something else than `get_state` of such an environment gave.
    """
    if isinstance(state, kind):
        return state
    raise AgentError(f"state={state!r:.60}: give what get_state of such an environment gave")
