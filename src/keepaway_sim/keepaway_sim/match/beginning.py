"""How a match begins: what is played, from which seed, by whom."""

from __future__ import annotations

import secrets

import numpy as np

from keepaway_sim.world.world import World

WORLD_KEY = (0, 0)
"""The spawn key of the world's seed in a match of nodes: trial 0; second, 1 is the players'."""


def random_match_id() -> int:
    """A number that no other match has: 1 .. 2^63 - 1, as a ROS parameter can be."""
    return secrets.randbelow(2**63 - 1) + 1


def begin_match(world: World, seed: int, first_episode: int = 0) -> None:
    """Kick off a match of nodes: field 0 of a world plays from `first_episode` on.

    A match that continues after its simulator died has random numbers of its own: they follow from
    the seed and the number of the episode that it continues with.
    """
    key = (*WORLD_KEY, first_episode) if first_episode else WORLD_KEY
    world.start(0, np.random.SeedSequence(seed, spawn_key=key))
    world.belief.episode[0] = first_episode
