"""Every array of the world: the truth, what players believe, say and remember."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from keepaway_sim.world.config import NEVER

NONE, DASH, TURN, KICK = 0.0, 1.0, 2.0, 3.0  # kinds of commands


OPEN_POINTS = 5  # P: a side of the grid of points where a keeper may get open


class Perceptions(NamedTuple):
    """What every player of every field believes; leading axes (num_fields, num_players).

    The last axis but one of `position`, `velocity` and `age` counts objects: players in match
    order, then the ball. Positions are in the field frame [m], velocities in m/cycle.
    """

    position: np.ndarray  # (F, P, P + 1, 2) [m]
    velocity: np.ndarray  # (F, P, P + 1, 2) [m/cycle]
    age: np.ndarray  # (F, P, P + 1) int32 [cycles] since seen, felt or heard of; NEVER
    body: np.ndarray  # (F, P, P) [rad] body directions; own on the diagonal
    neck: np.ndarray  # (F, P) [rad] own neck relative to own body
    cycles_to_ball: np.ndarray  # (F, P, P) int32 [cycles] of the fastest of the team; else NEVER
    ball_kickable: np.ndarray  # (F, P) bool
    decision_due: np.ndarray  # (F, P) bool
    outcome: np.ndarray  # (F,) int8
    episode: np.ndarray  # (F,) int64, counted from 0
    cycle: np.ndarray  # (F,) int64 [cycles] since kick-off


class Speech(NamedTuple):
    """What every player says this cycle, heard by team-mates in the next."""

    ball: np.ndarray  # (F, P, 4) x, y [m], vx, vy [m/cycle]
    ball_age: np.ndarray  # (F, P) int32 [cycles]; -1: nothing said of the ball
    opponent: np.ndarray  # (F, P) int32 player told of; -1: none
    opponent_position: np.ndarray  # (F, P, 2) [m]
    own: np.ndarray  # (F, P, 2) [m] own next position
    own_said: np.ndarray  # (F, P) bool


class Memory(NamedTuple):
    """What a player keeps from cycle to cycle beside its belief."""

    self_error: np.ndarray  # (F, P, 2) [m] believed minus true own position
    look_phase: np.ndarray  # (F, P) int64
    motion_cycle: np.ndarray  # (F, P, P) int64 cycle in which another's motion was seen last
    command: np.ndarray  # (F, P, 3) kind, power, angle of the last command
    turned: np.ndarray  # (F, P) [rad] own turn expected of the last command
    kicked: np.ndarray  # (F, P) bool: the last command kicked the ball
    pass_cycle: np.ndarray  # (F, P) int64 cycle of the last fresh pass decision
    pass_rank: np.ndarray  # (F, P) int64 receiver's rank by distance then, 0 the closest
    intercept_cycle: np.ndarray  # (F, P) int64 cycle in which the ball is to be met
    intercept_point: np.ndarray  # (F, P, 2) [m] and where
    vain_dashes: np.ndarray  # (F, P) int64 cycles in a row of dashing backward at rest
    search_cycle: np.ndarray  # (F, P) int64 last cycle of a search
    search_sign: np.ndarray  # (F, P) which way round
    open_x: np.ndarray  # (25,) [m] the points where a keeper may get open
    open_y: np.ndarray  # (25,) [m]
    congestion: np.ndarray  # (25,) [1/m] scratch


def make_perceptions(num_fields: int, num_players: int) -> Perceptions:
    """Perceptions of players who know nothing yet."""
    objects = num_players + 1
    return Perceptions(
        position=np.zeros((num_fields, num_players, objects, 2)),
        velocity=np.zeros((num_fields, num_players, objects, 2)),
        age=np.full((num_fields, num_players, objects), NEVER, dtype=np.int32),
        body=np.zeros((num_fields, num_players, num_players)),
        neck=np.zeros((num_fields, num_players)),
        cycles_to_ball=np.full((num_fields, num_players, num_players), NEVER, dtype=np.int32),
        ball_kickable=np.zeros((num_fields, num_players), dtype=np.bool_),
        decision_due=np.zeros((num_fields, num_players), dtype=np.bool_),
        outcome=np.zeros(num_fields, dtype=np.int8),
        episode=np.zeros(num_fields, dtype=np.int64),
        cycle=np.zeros(num_fields, dtype=np.int64),
    )


def make_speech(num_fields: int, num_players: int) -> Speech:
    """Speech of players who said nothing."""
    shape = (num_fields, num_players)
    return Speech(
        ball=np.zeros((*shape, 4)),
        ball_age=np.full(shape, -1, dtype=np.int32),
        opponent=np.full(shape, -1, dtype=np.int32),
        opponent_position=np.zeros((*shape, 2)),
        own=np.zeros((*shape, 2)),
        own_said=np.zeros(shape, dtype=np.bool_),
    )


def make_memory(c: Any, num_fields: int) -> Memory:
    """Memory of players before their first cycle."""
    num_players = c.num_keepers + c.num_takers
    share = np.linspace(-0.5, 0.5, OPEN_POINTS) * (1.0 - 2.0 * c.open_border)
    open_x, open_y = np.meshgrid(c.field_length * share, -c.field_width * share, indexing="ij")
    shape = (num_fields, num_players)
    return Memory(
        self_error=np.zeros((*shape, 2)),
        look_phase=np.zeros(shape, dtype=np.int64),
        motion_cycle=np.full((*shape, num_players), -NEVER, dtype=np.int64),
        command=np.zeros((*shape, 3)),
        turned=np.zeros(shape),
        kicked=np.zeros(shape, dtype=np.bool_),
        pass_cycle=np.full(shape, -2, dtype=np.int64),
        pass_rank=np.zeros(shape, dtype=np.int64),
        intercept_cycle=np.full(shape, -10, dtype=np.int64),
        intercept_point=np.zeros((*shape, 2)),
        vain_dashes=np.zeros(shape, dtype=np.int64),
        search_cycle=np.full(shape, -10, dtype=np.int64),
        search_sign=np.ones(shape),
        open_x=open_x.ravel(),
        open_y=open_y.ravel(),
        congestion=np.zeros(OPEN_POINTS**2),
    )


class State(NamedTuple):
    """The truth of every field; the ball is the last object."""

    position: np.ndarray  # (F, P + 1, 2) [m]
    velocity: np.ndarray  # (F, P + 1, 2) [m/cycle], after decay
    yaw: np.ndarray  # (F, P) [rad] body directions
    action: np.ndarray  # (F, P) int64, the action in force
    target: np.ndarray  # (F, P) int64, its receiver or marked keeper
    take_count: np.ndarray  # (F,) int64, the referee's counter
    last_keeper: np.ndarray  # (F,) int64, keeper that controlled the ball last; -1 none
    time: np.ndarray  # (F,) int64 [cycles] since the field was started
    running: np.ndarray  # (F,) bool: started and not stopped


def make_state(num_fields: int, num_players: int) -> State:
    """Fields on which nothing has begun."""
    return State(
        position=np.zeros((num_fields, num_players + 1, 2)),
        velocity=np.zeros((num_fields, num_players + 1, 2)),
        yaw=np.zeros((num_fields, num_players)),
        action=np.zeros((num_fields, num_players), dtype=np.int64),
        target=np.zeros((num_fields, num_players), dtype=np.int64),
        take_count=np.zeros(num_fields, dtype=np.int64),
        last_keeper=np.full(num_fields, -1, dtype=np.int64),
        time=np.zeros(num_fields, dtype=np.int64),
        running=np.zeros(num_fields, dtype=np.bool_),
    )
