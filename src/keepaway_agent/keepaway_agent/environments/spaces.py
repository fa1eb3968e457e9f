"""Spaces of observations: state variables of keepers and takers, and the truth of the field."""

from __future__ import annotations

import math

import numpy as np
from gymnasium.spaces import Box

from keepaway_agent.actions import Role
from keepaway_agent.learning.features import features
from keepaway_sim.task import Task
from keepaway_sim.world.config import Config


def observation_space(task: Task, role: Role = Role.KEEPER) -> Box:
    """Of a player's state variables: metres up to the field's diagonal, angles up to pi."""
    diagonal = math.hypot(task.field_length, task.field_width)
    variables = features(role, task.num_keepers, task.num_takers)
    high = [math.pi if each.kind == "min_angle" else diagonal for each in variables]
    return Box(np.zeros(len(high), np.float32), np.array(high, np.float32), dtype=np.float32)


def variable_names(task: Task, role: Role = Role.KEEPER) -> tuple[str, ...]:
    """What the entries of a player's observation are, in order: see the package's README.

    >>> variable_names(Task.parse("2v1"))[:3]
    ('dist_k1_c', 'dist_k1_k2', 'dist_k1_t1')
    """
    return tuple(each.name for each in features(role, task.num_keepers, task.num_takers))


def state_space(task: Task, config: Config) -> Box:
    """Of the truth: x, y [m] and vx, vy [m/cycle] of all players and the ball, then bodies [rad].

    Places reach two cycles' way beyond the field, because an episode ends when the ball is out.
    """
    speeds = np.full(task.num_players + 1, config.physics.player_speed_max)
    speeds[-1] = config.physics.ball_speed_max
    sides = np.array([task.field_length, task.field_width])
    places = np.tile(sides, (task.num_players + 1, 1))
    motion = np.concatenate([places, np.stack([speeds, speeds], axis=1)], axis=1)
    high = np.concatenate([motion.ravel(), np.full(task.num_players, math.pi)])
    return Box(-high.astype(np.float32), high.astype(np.float32), dtype=np.float32)
