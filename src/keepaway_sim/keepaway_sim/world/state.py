"""Every array of the world: one record that compiled functions take whole.

`Fields` holds what is fixed (constants), what is so (truth), what every player believes, remembers
and says, the discs as pymunk takes them, the random numbers, and room to calculate in. Arrays begin
with the axis of the fields (F), then that of the players (P); the ball is the object after the
last player. No array of a record is ever replaced, only written into.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from keepaway_sim.world.config import NEVER
from keepaway_sim.world.constants import OPEN_LANES
from keepaway_sim.world.passing import record
from keepaway_sim.world.streams import Draws

SIGHT_LANES = 8  # pairs that one instruction may serve
NONE, DASH, TURN, KICK = 0.0, 1.0, 2.0, 3.0  # kinds of commands


class Command(NamedTuple):
    """What a player does in a cycle."""

    kind: float  # NONE, DASH, TURN or KICK
    power: float  # of a dash or a kick
    angle: float  # [rad] a turn's moment; a kick's direction, relative to the body


@record
class Truth(NamedTuple):
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


@record
class Belief(NamedTuple):
    """What every player of every field believes.

    The last axis but one of `position` and `velocity`, and the last of `age`, counts objects:
    players in match order, then the ball. Positions are in the field frame.
    """

    position: np.ndarray  # (F, P, P + 1, 2) [m]
    velocity: np.ndarray  # (F, P, P + 1, 2) [m/cycle]
    age: np.ndarray  # (F, P, P + 1) int32 [cycles] since seen, felt or heard of; NEVER
    body: np.ndarray  # (F, P, P) [rad] body directions; own on the diagonal
    neck: np.ndarray  # (F, P) [rad] own neck relative to own body
    cycles_to_ball: np.ndarray  # (F, P, P) int32 [cycles] of the fastest keeper; else NEVER
    ball_kickable: np.ndarray  # (F, P) bool
    decision_due: np.ndarray  # (F, P) bool
    outcome: np.ndarray  # (F,) int8
    episode: np.ndarray  # (F,) int64, counted from 0
    cycle: np.ndarray  # (F,) int64 [cycles] since kick-off


@record
class Memory(NamedTuple):
    """What a player keeps from cycle to cycle beside its belief."""

    self_error: np.ndarray  # (F, P, 2) [m] believed minus true own position
    look_phase: np.ndarray  # (F, P) int64
    seen: np.ndarray  # (F, P, P, 4) another as seen last: x, y [m], vx, vy [m/cycle]
    seen_cycle: np.ndarray  # (F, P, P) int64 cycle in which another was seen or felt last
    motion_cycle: np.ndarray  # (F, P, P + 1) int64 cycle in which its motion was seen last
    nameless: np.ndarray  # (F, P, P) bool: another was felt last, and may be another player
    behind: np.ndarray  # (F, P, P) int64 cycles by which another's place was old when heard of
    command: np.ndarray  # (F, P, 3) kind, power, angle of the last command
    turned: np.ndarray  # (F, P) [rad] own turn expected of the last command
    kicked: np.ndarray  # (F, P) bool: the last command kicked the ball
    pass_cycle: np.ndarray  # (F, P) int64 last cycle in which a pass was asked for or continued
    pass_rank: np.ndarray  # (F, P) int64 its receiver's rank by distance, 0 the closest
    intercept_cycle: np.ndarray  # (F, P) int64 cycle in which the ball is to be met
    intercept_point: np.ndarray  # (F, P, 2) [m] and where
    vain_dashes: np.ndarray  # (F, P) int64 cycles in a row of dashing backward at rest
    search_cycle: np.ndarray  # (F, P) int64 last cycle of a search
    search_sign: np.ndarray  # (F, P) which way round


@record
class Phantoms(NamedTuple):
    """Opponents in whom a player with a limited view believes beside the real ones (S slots)."""

    position: np.ndarray  # (F, P, S, 2) [m]
    age: np.ndarray  # (F, P, S) int32 [cycles] since felt; NEVER: an empty slot
    felt: np.ndarray  # (F, P, S, 2) [m] where it was felt last
    felt_cycle: np.ndarray  # (F, P, S) int64 and in which cycle


@record
class Speech(NamedTuple):
    """What every player says this cycle, heard by team-mates in the next."""

    ball: np.ndarray  # (F, P, 4) x, y [m], vx, vy [m/cycle]
    ball_age: np.ndarray  # (F, P) int32 [cycles]; -1: nothing said of the ball
    opponent: np.ndarray  # (F, P) int32 player told of; -1: none
    opponent_position: np.ndarray  # (F, P, 2) [m]


@record
class Discs(NamedTuple):
    """Players and ball of the fields of which pymunk is asked; made by `Bodies`.

    Such a field takes a slot for a cycle: a place of its own in the shared space.
    """

    motion: np.ndarray  # (F, P + 1, 4) by slot: x, y [m] in the shared space, vx, vy [m/cycle]
    place: np.ndarray  # (F, 2) by slot: [m] where a field's origin lies in the shared space
    radius: np.ndarray  # (P + 1,) [m]
    asked: np.ndarray  # (F,) int64 by slot: the field
    num_asked: np.ndarray  # (1,) int64: how many slots are taken
    slot: np.ndarray  # (F,) int64 by field: its slot; -1: none, its discs touch nothing
    touched: np.ndarray  # (F,) bool by field: discs touch


@record
class Sights(NamedTuple):
    """What the server measures for a field's players who look, by pair (N pairs), see `survey`."""

    first: np.ndarray  # (P,) int64 by player: its pair with the first object
    dx: np.ndarray  # (N,) unit vector from the player to the object
    dy: np.ndarray
    distance: np.ndarray  # (N,) [m]
    direction: np.ndarray  # (N,) [rad] from the middle of the player's view
    steps: np.ndarray  # (N,) the same in steps, a whole number: the direction that is sent
    radial: np.ndarray  # (N,) [1/cycle] change of distance as a share of it, as it is sent
    turning: np.ndarray  # (N,) [rad/cycle] change of direction, as it is sent


@record
class Scratch(NamedTuple):
    """Room to calculate in: nothing in it outlives the cycle of one field."""

    acceleration: np.ndarray  # (P + 1, 2) [m/cycle^2]
    pushed_to: np.ndarray  # (P + 1, 2) [m] sum of the places to which a disc is pushed
    num_pushes: np.ndarray  # (P + 1,)
    collided: np.ndarray  # (P + 1,) bool
    congestion: np.ndarray  # (OPEN_LANES,) float32 [1/m] of the points where a keeper may get open
    felt: np.ndarray  # (P, 3) [m] x, y, distance of a player who is only felt; NaN: not felt
    numbers: np.ndarray  # (P, 2) int64 the numbers that it may have, from .. to


@record
class Fields(NamedTuple):
    """All that compiled functions of the world work on."""

    num_players: int
    ball: int  # the ball's index among objects: it follows the last player
    constants: Any  # of the task and its configuration, see `constants.pack`
    truth: Truth
    belief: Belief
    memory: Memory
    phantoms: Phantoms
    speech: Speech
    bodies: Discs
    random: Draws  # a stream for each field
    sights: Sights
    scratch: Scratch


def make_fields(constants: Any, bodies: Discs, random: Draws) -> Fields:
    """Fields on which nothing has begun, the number that `bodies` has."""
    num_fields, num_players = len(bodies.place), len(bodies.radius) - 1
    objects = num_players + 1
    return Fields(
        num_players=num_players,
        ball=num_players,
        constants=constants,
        truth=_make_truth(num_fields, num_players),
        belief=_make_belief(num_fields, num_players),
        memory=_make_memory(num_fields, num_players),
        phantoms=_make_phantoms(num_fields, num_players, constants.phantom_slots),
        speech=_make_speech(num_fields, num_players),
        bodies=bodies,
        random=random,
        sights=_make_sights(num_players),
        scratch=Scratch(
            acceleration=np.zeros((objects, 2)),
            pushed_to=np.zeros((objects, 2)),
            num_pushes=np.zeros(objects),
            collided=np.zeros(objects, dtype=np.bool_),
            congestion=np.zeros(OPEN_LANES, dtype=np.float32),
            felt=np.zeros((num_players, 3)),
            numbers=np.zeros((num_players, 2), dtype=np.int64),
        ),
    )


def _make_sights(num_players: int) -> Sights:
    """Rows for all pairs, and some more, up to a multiple of SIGHT_LANES."""
    num_pairs = num_players * (num_players + 1)
    length = math.ceil(num_pairs / SIGHT_LANES) * SIGHT_LANES
    first = np.zeros(num_players, dtype=np.int64)
    return Sights(first, *(np.zeros(length) for _ in Sights._fields[1:]))


def _make_truth(num_fields: int, num_players: int) -> Truth:
    return Truth(
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


def _make_belief(num_fields: int, num_players: int) -> Belief:
    """Belief of players who know nothing yet."""
    objects = num_players + 1
    return Belief(
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


def _make_memory(num_fields: int, num_players: int) -> Memory:
    """Memory of players before their first cycle."""
    shape = (num_fields, num_players)
    return Memory(
        self_error=np.zeros((*shape, 2)),
        look_phase=np.zeros(shape, dtype=np.int64),
        seen=np.zeros((*shape, num_players, 4)),
        seen_cycle=np.full((*shape, num_players), -NEVER, dtype=np.int64),
        motion_cycle=np.full((*shape, num_players + 1), -NEVER, dtype=np.int64),
        nameless=np.zeros((*shape, num_players), dtype=np.bool_),
        behind=np.zeros((*shape, num_players), dtype=np.int64),
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
    )


def _make_phantoms(num_fields: int, num_players: int, num_slots: int) -> Phantoms:
    """Empty slots."""
    shape = (num_fields, num_players, num_slots)
    return Phantoms(
        position=np.zeros((*shape, 2)),
        age=np.full(shape, NEVER, dtype=np.int32),
        felt=np.zeros((*shape, 2)),
        felt_cycle=np.full(shape, -NEVER, dtype=np.int64),
    )


def _make_speech(num_fields: int, num_players: int) -> Speech:
    """Speech of players who said nothing."""
    shape = (num_fields, num_players)
    return Speech(
        ball=np.zeros((*shape, 4)),
        ball_age=np.full(shape, -1, dtype=np.int32),
        opponent=np.full(shape, -1, dtype=np.int32),
        opponent_position=np.zeros((*shape, 2)),
    )
