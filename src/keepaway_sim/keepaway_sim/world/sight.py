"""What one player perceives and remembers: the belief its skills and its agent act on.

A cycle has three steps for every player: `remember` carries the last belief one cycle on (dead
reckoning, own kick and turn included), `hear` takes what a team-mate said, `look` replaces by
what is seen, in two of every three cycles (150 ms between looks, 100 ms cycles).

Source: S visualsenderplayer.cpp for what is seen, P WorldModelUpdate.cc for what is made of it.
Simplified against P, and why: own position is the truth plus an error that stays between looks
(P: a particle filter over flags, whose remaining error is about as large); an unseen opponent
that is not nearest to the ball rolls out (P moves it a quarter metre along x); players beyond
the distance at which numbers are readable are not confused with each other.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import NEVER, SIGHT_CELLS
from keepaway_sim.world.geometry import TWO_PI, bearing, length, quantize, rotated, wrap
from keepaway_sim.world.physics import dash_acceleration, kick_acceleration, limited
from keepaway_sim.world.streams import draw

NONE, DASH, TURN, KICK = 0.0, 1.0, 2.0, 3.0  # kinds of commands

OPEN_POINTS = 5  # P: a side of the grid of points where a keeper may get open
CHASE_SPEED = 0.3  # [m/cycle] P: an unseen opponent nearest to the ball is believed to come so fast
BUMPED_DISTANCE = 0.2  # [m] P: where a ball is believed after a bump
STALE_BALL = 3  # [cycles] a message about the ball helps a player who saw it longer ago
CHANGED_VELOCITY = 0.3  # [m/cycle] or one whose idea of its velocity differs by more
DEAF_RANGE = 3.0  # [m] P: nearer to the ball than this, a player trusts itself
GHOST_MARGIN = math.radians(10.0)  # inside the cone's edge: there it must be seen
SHARED_RANGE = 20.0  # [m] P: a player speaks of a ball it sees nearer than this
DIRECTION_CHANGE_STEP = math.radians(0.1)  # [rad/cycle] S: direction change is rounded to it


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


@compiled
def same_team(c, p, q):
    """Do players p and q play for the same team?"""
    return (p < c.num_keepers) == (q < c.num_keepers)


@compiled
def forget(c, s, m, f, p, uniforms, cursor):
    """A new episode: player p has seen nothing of it yet and gets a new phase of looking."""
    num = c.num_keepers + c.num_takers
    for j in range(num + 1):
        s.age[f, p, j] = NEVER
        s.velocity[f, p, j, 0] = 0.0
        s.velocity[f, p, j, 1] = 0.0
    m.motion_cycle[f, p, :] = -NEVER
    m.turned[f, p] = 0.0
    m.kicked[f, p] = False
    m.pass_cycle[f, p] = -2
    m.intercept_cycle[f, p] = -10
    m.search_cycle[f, p] = -10
    m.vain_dashes[f, p] = 0
    m.look_phase[f, p] = int(draw(uniforms, cursor, f) * c.look_period)


@compiled
def remember(c, s, m, f, p):
    """Carry player p's belief about all others one cycle on, before anything new is known."""
    num = c.num_keepers + c.num_takers
    position, velocity = s.position[f, p], s.velocity[f, p]
    ball, kicked = num, m.kicked[f, p]
    if kicked:
        ax, ay = kick_acceleration(
            c,
            m.command[f, p, 1],
            m.command[f, p, 2],
            position[ball, 0] - position[p, 0],
            position[ball, 1] - position[p, 1],
            s.body[f, p, p],
        )
        vx, vy = limited(velocity[ball, 0] + ax, velocity[ball, 1] + ay, c.ball_speed_max)
        velocity[ball, 0], velocity[ball, 1] = vx, vy
    s.body[f, p, p] = wrap(s.body[f, p, p] + m.turned[f, p])
    for j in range(num + 1):
        if s.age[f, p, j] < NEVER:
            s.age[f, p, j] += 1
    chaser = _nearest_opponent_to_ball(c, s, f, p)
    for j in range(num):
        if j == p:
            continue
        if j == chaser:
            dx = position[ball, 0] - position[j, 0]
            dy = position[ball, 1] - position[j, 1]
            distance = length(dx, dy)
            if distance > 0.0:
                position[j, 0] += CHASE_SPEED * dx / distance
                position[j, 1] += CHASE_SPEED * dy / distance
        else:
            position[j, 0] += velocity[j, 0]
            position[j, 1] += velocity[j, 1]
        velocity[j, 0] *= c.player_decay
        velocity[j, 1] *= c.player_decay
    position[ball, 0] += velocity[ball, 0]
    position[ball, 1] += velocity[ball, 1]
    velocity[ball, 0] *= c.ball_decay
    velocity[ball, 1] *= c.ball_decay
    if not kicked:
        _stop_ball_of_opponent(c, s, f, p)


@compiled
def _stop_ball_of_opponent(c, s, f, p):
    """P: a ball within an opponent's reach is believed to lie still; nobody knows his plans."""
    ball = c.num_keepers + c.num_takers
    opponent = _nearest_opponent_to_ball(c, s, f, p)
    if opponent < 0:
        return
    dx = s.position[f, p, ball, 0] - s.position[f, p, opponent, 0]
    dy = s.position[f, p, ball, 1] - s.position[f, p, opponent, 1]
    if length(dx, dy) < c.kickable_distance:
        s.velocity[f, p, ball, 0] = 0.0
        s.velocity[f, p, ball, 1] = 0.0


@compiled
def _nearest_opponent_to_ball(c, s, f, p):
    num = c.num_keepers + c.num_takers
    nearest, best = -1, math.inf
    for j in range(num):
        if same_team(c, p, j) or s.age[f, p, j] > c.player_lost_age:
            continue
        dx = s.position[f, p, j, 0] - s.position[f, p, num, 0]
        dy = s.position[f, p, j, 1] - s.position[f, p, num, 1]
        distance = dx * dx + dy * dy
        if distance < best:
            nearest, best = j, distance
    return nearest


@compiled
def feel_self(c, s, m, position, velocity, f, p):
    """Own position and speed as the body feels them, nearly exact; a bump shows in the speed."""
    ux, uy = _expected_own_velocity(c, s, m, f, p)
    s.position[f, p, p, 0] = position[p, 0] + m.self_error[f, p, 0]
    s.position[f, p, p, 1] = position[p, 1] + m.self_error[f, p, 1]
    speed = length(velocity[p, 0], velocity[p, 1])
    share = quantize(speed, c.speed_step) / speed if speed > 0.0 else 0.0
    vx, vy = share * velocity[p, 0], share * velocity[p, 1]
    s.velocity[f, p, p, 0], s.velocity[f, p, p, 1] = vx, vy
    s.age[f, p, p] = 0
    if s.cycle[f] > 0 and _seems_bumped(c, s, f, p, vx, vy, ux, uy):
        _bump_ball(c, s, f, p)


@compiled
def _expected_own_velocity(c, s, m, f, p):
    """Velocity that player p expects of its last command, before it feels the real one."""
    vx, vy = s.velocity[f, p, p]
    if m.command[f, p, 0] == DASH:
        ax, ay = dash_acceleration(c, m.command[f, p, 1], s.body[f, p, p])
        vx, vy = limited(vx + ax, vy + ay, c.player_speed_max)
    return c.player_decay * vx, c.player_decay * vy


@compiled
def _seems_bumped(c, s, f, p, vx, vy, ux, uy):
    """P: does felt velocity (vx, vy) against the expected (ux, uy) mean a bump into the ball?"""
    ball = c.num_keepers + c.num_takers
    own = s.position[f, p, p]
    away = length(s.position[f, p, ball, 0] - own[0], s.position[f, p, ball, 1] - own[1])
    felt, expected = length(vx, vy), length(ux, uy)
    if felt == 0.0:
        stopped = expected > 0.01 and away < 0.8
        return stopped or away < c.touch_distance
    if away >= c.kickable_distance + 0.5 or felt >= 0.25 * expected:
        return False
    return _turned_round(vx, ux) and _turned_round(vy, uy)


@compiled
def _turned_round(felt, expected):
    return felt * expected < 0.0 or abs(expected) < 0.08


@compiled
def _bump_ball(c, s, f, p):
    """P: after a bump the ball is believed just before the body, its velocity reversed.

    Unless another player is believed nearer, who then was bumped into.
    """
    ball = c.num_keepers + c.num_takers
    own = s.position[f, p, p]
    dx, dy = s.position[f, p, ball, 0] - own[0], s.position[f, p, ball, 1] - own[1]
    distance = length(dx, dy)
    for j in range(ball):
        if j == p or s.age[f, p, j] > c.player_lost_age:
            continue
        away = length(s.position[f, p, j, 0] - own[0], s.position[f, p, j, 1] - own[1])
        if away < distance:
            return
    angle = math.atan2(dy, dx)
    s.position[f, p, ball, 0] = own[0] + BUMPED_DISTANCE * math.cos(angle)
    s.position[f, p, ball, 1] = own[1] + BUMPED_DISTANCE * math.sin(angle)
    s.velocity[f, p, ball, 0] *= -0.1
    s.velocity[f, p, ball, 1] *= -0.1


@compiled
def hear(c, s, speech, f, p, uniforms, cursor):
    """Take the one message that player p hears this cycle: a random team-mate's."""
    first = 0 if p < c.num_keepers else c.num_keepers
    last = c.num_keepers if p < c.num_keepers else c.num_keepers + c.num_takers
    others = last - first - 1
    if others < 1:
        return
    speaker = first + int(draw(uniforms, cursor, f) * others)
    if speaker >= p:
        speaker += 1
    if speech.own_said[f, speaker]:
        _hear_of_player(s, f, p, speaker, speech.own[f, speaker, 0], speech.own[f, speaker, 1])
    told = speech.opponent[f, speaker]
    if told >= 0:
        x, y = speech.opponent_position[f, speaker]
        _hear_of_player(s, f, p, told, x, y)
    if speech.ball_age[f, speaker] >= 0:
        _hear_of_ball(c, s, speech, f, p, speaker)


@compiled
def _hear_of_player(s, f, p, who, x, y):
    if s.age[f, p, who] > 1:
        s.position[f, p, who, 0], s.position[f, p, who, 1] = x, y
        s.velocity[f, p, who, 0] = 0.0
        s.velocity[f, p, who, 1] = 0.0
        s.age[f, p, who] = 1


@compiled
def _hear_of_ball(c, s, speech, f, p, speaker):
    ball = c.num_keepers + c.num_takers
    x, y, vx, vy = speech.ball[f, speaker]
    own = s.position[f, p, p]
    known = s.age[f, p, ball] < NEVER
    if (
        known
        and length(s.position[f, p, ball, 0] - own[0], s.position[f, p, ball, 1] - own[1])
        < DEAF_RANGE
    ):
        return
    differs = (
        length(vx - s.velocity[f, p, ball, 0], vy - s.velocity[f, p, ball, 1]) > CHANGED_VELOCITY
    )
    if s.age[f, p, ball] > STALE_BALL or differs:
        s.position[f, p, ball, 0], s.position[f, p, ball, 1] = x, y
        s.velocity[f, p, ball, 0], s.velocity[f, p, ball, 1] = vx, vy
        s.age[f, p, ball] = speech.ball_age[f, speaker]


@compiled
def looks_now(c, m, f, p, time):
    """Does player p see something new in this cycle of its field's life?"""
    return c.look_period == 1 or (time + m.look_phase[f, p]) % c.look_period != c.look_period - 1


@compiled
def look(c, s, m, position, velocity, yaw, f, p, uniforms, cursor):
    """Player p sees its surroundings (truth: one field's arrays) and updates its belief."""
    num = c.num_keepers + c.num_takers
    if c.self_position_error > 0.0:
        for axis in range(2):
            error = (2.0 * draw(uniforms, cursor, f) - 1.0) * c.self_position_error
            m.self_error[f, p, axis] = error
            s.position[f, p, p, axis] = position[p, axis] + error
    yaw_error = 0.0
    if c.self_yaw_error > 0.0:
        yaw_error = (2.0 * draw(uniforms, cursor, f) - 1.0) * c.self_yaw_error
    s.body[f, p, p] = wrap(yaw[p] + yaw_error)
    face = yaw[p] + s.neck[f, p]
    error = math.cos(yaw_error), math.sin(yaw_error)
    believed_face = math.cos(face + yaw_error), math.sin(face + yaw_error)
    for j in range(num + 1):
        if j == p:
            continue
        dx, dy = position[j, 0] - position[p, 0], position[j, 1] - position[p, 1]
        distance = max(length(dx, dy), 1e-6)
        dx, dy = dx / distance, dy / distance
        direction = wrap(bearing(dx, dy) - face)
        seen = abs(direction) <= 0.5 * c.visible_angle
        if not seen and (distance > c.feel_distance or _is_nameless(c, s, f, p, j)):
            _forget_ghost(c, s, f, p, j)
            continue
        if c.direction_step == 0.0:
            ux, uy = rotated(dx, dy, *error)
        else:
            step = round(direction / c.direction_step) + len(c.direction_cosine) // 2
            ux, uy = rotated(c.direction_cosine[step], c.direction_sine[step], *believed_face)
        moves = seen and _velocity_visible(c, distance, uniforms, cursor, f)
        _see(c, s, velocity, f, p, j, dx, dy, distance, ux, uy, seen, moves)
        if seen and j < num:
            s.body[f, p, j] = wrap(yaw[j] + yaw_error)
            if moves:
                m.motion_cycle[f, p, j] = s.cycle[f]
    own, ball = s.position[f, p, p], s.position[f, p, num]
    if length(ball[0] - own[0], ball[1] - own[1]) > c.kickable_distance:
        _stop_ball_of_opponent(c, s, f, p)


@compiled
def _is_nameless(c, s, f, p, j):
    """S: who is only felt is no more than a player; P: it is taken for the one expected there."""
    return j < c.num_keepers + c.num_takers and s.age[f, p, j] > c.player_lost_age


@compiled
def _forget_ghost(c, s, f, p, j):
    """P removeGhosts: what is not where it must be seen is not known any more."""
    own = s.position[f, p, p]
    dx, dy = s.position[f, p, j, 0] - own[0], s.position[f, p, j, 1] - own[1]
    direction = wrap(bearing(dx, dy) - s.body[f, p, p] - s.neck[f, p])
    if abs(direction) < 0.5 * c.visible_angle - GHOST_MARGIN:
        s.age[f, p, j] = NEVER


@compiled
def _see(c, s, velocity, f, p, j, dx, dy, distance, ux, uy, seen, moves):
    """Object j as seen or only felt by player p.

    Args:
        dx, dy, distance: unit vector to the object and how far it is [m].
        ux, uy: the unit vector as player p believes it.
        seen, moves: is it seen, and how it moves?
    """
    reported = _reported_distance(c, distance)
    ball = c.num_keepers + c.num_takers
    fresh = s.age[f, p, j] <= 1
    old_x, old_y = s.position[f, p, j, 0], s.position[f, p, j, 1]
    s.position[f, p, j, 0] = s.position[f, p, p, 0] + reported * ux
    s.position[f, p, j, 1] = s.position[f, p, p, 1] + reported * uy
    s.age[f, p, j] = 0
    if not seen:
        if j == ball and fresh:  # P: velocity of a felt ball from two positions
            s.velocity[f, p, j, 0] += (s.position[f, p, j, 0] - old_x) * c.ball_decay
            s.velocity[f, p, j, 1] += (s.position[f, p, j, 1] - old_y) * c.ball_decay
        return
    if not moves:
        return
    wx, wy = velocity[j, 0] - velocity[p, 0], velocity[j, 1] - velocity[p, 1]
    radial = reported * quantize((wx * dx + wy * dy) / distance, c.change_step)
    turning = (dx * wy - dy * wx) / distance
    if c.change_step > 0.0:
        turning = quantize(turning, DIRECTION_CHANGE_STEP)
    rel_vx, rel_vy = rotated(radial, reported * turning, ux, uy)
    vx, vy = velocity[p, 0] + rel_vx, velocity[p, 1] + rel_vy
    if j == ball:
        vx, vy = _blended(c, vx, vy, s.velocity[f, p, j, 0], s.velocity[f, p, j, 1])
    s.velocity[f, p, j, 0], s.velocity[f, p, j, 1] = vx, vy


@compiled
def _reported_distance(c, distance):
    """The distance as the server reports it, see `config._sight_tables`."""
    if c.quantize_step == 0.0:
        return distance
    edge = c.sight_first[min(int(distance * SIGHT_CELLS), len(c.sight_first) - 1)]
    while distance >= c.sight_edge[edge]:
        edge += 1
    return c.sight_value[edge]


@compiled
def _velocity_visible(c, distance, uniforms, cursor, f):
    """Near objects show how they move; farther ones with falling probability."""
    if distance <= c.certain_distance:
        return True
    share = (c.unsure_distance - distance) / (c.unsure_distance - c.certain_distance)
    return draw(uniforms, cursor, f) < share


@compiled
def _blended(c, seen_x, seen_y, expected_x, expected_y):
    """P: mean of seen and expected ball velocity, unless somebody must have touched it."""
    near = 2.0 * c.ball_rand * length(expected_x, expected_y)
    if abs(seen_x - expected_x) <= near and abs(seen_y - expected_y) <= near:
        return 0.5 * (seen_x + expected_x), 0.5 * (seen_y + expected_y)
    return seen_x, seen_y


@compiled
def speak(c, s, speech, m, f, p, kicked):
    """Compose what player p tells its team-mates after it chose its command.

    A message holds ten characters (S): six for the ball, four for an opponent, three for the
    own position, so the own position is left out where both others are told.
    """
    num = c.num_keepers + c.num_takers
    own, ball = s.position[f, p, p], s.position[f, p, num]
    distance = length(ball[0] - own[0], ball[1] - own[1])
    speech.ball_age[f, p] = -1
    if s.age[f, p, num] == 0 and distance < SHARED_RANGE:
        _speak_of_ball(c, s, speech, m, f, p, distance, kicked)
    nearest, best = -1, c.feel_distance
    for j in range(num):
        if same_team(c, p, j) or s.age[f, p, j] != 0:
            continue
        away = length(s.position[f, p, j, 0] - own[0], s.position[f, p, j, 1] - own[1])
        if away < best:
            nearest, best = j, away
    speech.opponent[f, p] = nearest
    if nearest >= 0:
        x, y = s.position[f, p, nearest]
        speech.opponent_position[f, p, 0] = quantize(x, c.hear_step_x)
        speech.opponent_position[f, p, 1] = quantize(y, c.hear_step_y)
    speech.own_said[f, p] = not (nearest >= 0 and speech.ball_age[f, p] >= 0)
    speech.own[f, p, 0] = quantize(own[0] + s.velocity[f, p, p, 0], c.hear_step_x)
    speech.own[f, p, 1] = quantize(own[1] + s.velocity[f, p, p, 1], c.hear_step_y)


@compiled
def _speak_of_ball(c, s, speech, m, f, p, distance, kicked):
    ball = c.num_keepers + c.num_takers
    x, y = s.position[f, p, ball]
    vx, vy = s.velocity[f, p, ball]
    speech.ball_age[f, p] = 1
    if distance < c.kickable_distance:
        away = False
        if kicked:
            ax, ay = kick_acceleration(
                c,
                m.command[f, p, 1],
                m.command[f, p, 2],
                x - s.position[f, p, p, 0],
                y - s.position[f, p, p, 1],
                s.body[f, p, p],
            )
            wx, wy = limited(vx + ax, vy + ay, c.ball_speed_max)
            nx = s.position[f, p, p, 0] + s.velocity[f, p, p, 0]
            ny = s.position[f, p, p, 1] + s.velocity[f, p, p, 1]
            away = length(x + wx - nx, y + wy - ny) > c.kickable_distance + 0.2
        if away:
            x, y = x + wx, y + wy
            vx, vy = wx * c.ball_decay, wy * c.ball_decay
            speech.ball_age[f, p] = 0
        else:
            vx, vy = 0.0, 0.0
    speech.ball[f, p, 0] = quantize(x, c.hear_step_x)
    speech.ball[f, p, 1] = quantize(y, c.hear_step_y)
    speech.ball[f, p, 2] = quantize(vx, c.hear_step_velocity)
    speech.ball[f, p, 3] = quantize(vy, c.hear_step_velocity)


@compiled
def turn_neck(c, s, f, p, x, y, turn):
    """Turn player p's neck toward a point, as far as it goes, after its body turned by `turn`."""
    own = s.position[f, p, p]
    wanted = wrap(math.atan2(y - own[1], x - own[0]) - s.body[f, p, p] - turn)
    s.neck[f, p] = min(max(wanted, -0.25 * TWO_PI), 0.25 * TWO_PI)
