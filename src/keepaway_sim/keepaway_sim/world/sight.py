"""What one player perceives and remembers: the belief its skills and its agent act on.

A cycle has four steps for every player: `remember` and `roll_on` carry the last belief one cycle on
(own kick and turn included), `look` replaces by what is seen, in two of every three cycles (150 ms
between looks, 100 ms cycles), `hear` takes what a team-mate said.

Source: S visualsenderplayer.cpp for what is seen, P WorldModelUpdate.cc for what is made of it.
Simplified against P, and why: own position is the truth plus an error that stays between looks
(P: a particle filter over flags; the error is as large as was measured on the real server); players
beyond the distance at which numbers are readable are not confused with each other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import SIGHT_CELLS
from keepaway_sim.world.geometry import TWO_PI, bearing, length, quantize, rotated, wrap
from keepaway_sim.world.ghosts import forget_double, remove_ghosts
from keepaway_sim.world.memory import stop_ball_of_opponent
from keepaway_sim.world.streams import draw
from keepaway_sim.world.touch import feel_players

DIRECTION_CHANGE_STEP = math.radians(0.1)  # [rad/cycle] S: direction change is rounded to it


@compiled
def looks_now(w, f, p):
    """Does player p see something new in this cycle of its field's life?"""
    period, moment = w.constants.look_period, w.truth.time[f] + w.memory.look_phase[f, p]
    return period == 1 or moment % period != period - 1


class Glimpse(NamedTuple):
    """What a player gets of an object it sees or only feels."""

    dx: float  # true unit vector from the player to the object
    dy: float
    distance: float  # [m] true
    ux: float  # the unit vector as the player believes it
    uy: float
    seen: bool
    moves: bool  # is it seen how it moves?


@compiled
def look(w, f, p):
    """Player p sees its surroundings and updates its belief."""
    c, belief = w.constants, w.belief
    position, yaw = w.truth.position[f], w.truth.yaw[f]
    yaw_error = _look_at_self(w, f, p)
    face = yaw[p] + belief.neck[f, p]
    error = math.cos(yaw_error), math.sin(yaw_error)
    believed_face = math.cos(face + yaw_error), math.sin(face + yaw_error)
    w.scratch.felt[:] = math.nan
    for j in range(w.ball + 1):
        if j == p:
            continue
        dx, dy = position[j, 0] - position[p, 0], position[j, 1] - position[p, 1]
        distance = max(length(dx, dy), 1e-6)
        dx, dy = dx / distance, dy / distance
        direction = wrap(bearing(dx, dy) - face)
        seen = abs(direction) <= 0.5 * c.visible_angle
        if not seen and distance > c.feel_distance:
            continue
        if c.direction_step == 0.0:
            ux, uy = rotated(dx, dy, *error)
        else:
            step = round(direction / c.direction_step) + len(c.direction_cosine) // 2
            ux, uy = rotated(c.direction_cosine[step], c.direction_sine[step], *believed_face)
        if not seen and j < w.ball:
            away = _reported_distance(c, distance)
            w.scratch.felt[j, 0] = belief.position[f, p, p, 0] + away * ux
            w.scratch.felt[j, 1] = belief.position[f, p, p, 1] + away * uy
            w.scratch.felt[j, 2] = away
            continue
        moves = seen and _velocity_visible(w, f, distance)
        _see(w, f, p, j, Glimpse(dx, dy, distance, ux, uy, seen, moves))
        if j < w.ball:
            _recognize(w, f, p, j, wrap(yaw[j] + yaw_error), moves)
    own, ball = belief.position[f, p, p], belief.position[f, p, w.ball]
    out_of_reach = length(ball[0] - own[0], ball[1] - own[1]) > c.kickable_distance
    if belief.age[f, p, w.ball] == 0 and out_of_reach:
        stop_ball_of_opponent(w, f, p)
    if not sees_all(w):
        feel_players(w, f, p)
        remove_ghosts(w, f, p)


@compiled
def sees_all(w):
    """Do players see all round?"""
    return w.constants.visible_angle >= TWO_PI - 1e-9


@compiled
def _recognize(w, f, p, j, yaw, moves):
    """Player j is seen by name, facing `yaw`: what that leaves in player p's memory."""
    belief, memory = w.belief, w.memory
    belief.body[f, p, j] = yaw
    memory.seen[f, p, j, 0] = belief.position[f, p, j, 0]
    memory.seen[f, p, j, 1] = belief.position[f, p, j, 1]
    memory.seen_cycle[f, p, j] = belief.cycle[f]
    if moves:
        memory.seen[f, p, j, 2] = belief.velocity[f, p, j, 0]
        memory.seen[f, p, j, 3] = belief.velocity[f, p, j, 1]
    memory.nameless[f, p, j] = False
    if not sees_all(w):
        forget_double(w, f, p, j)


@compiled
def _look_at_self(w, f, p):
    """Player p finds out where it is and faces; gives the error of its body direction [rad]."""
    c, truth, belief = w.constants, w.truth, w.belief
    if c.self_position_error > 0.0:
        for axis in range(2):
            error = (2.0 * draw(w.random, f) - 1.0) * c.self_position_error
            w.memory.self_error[f, p, axis] = error
            belief.position[f, p, p, axis] = truth.position[f, p, axis] + error
    yaw_error = 0.0
    if c.self_yaw_error > 0.0:
        yaw_error = (2.0 * draw(w.random, f) - 1.0) * c.self_yaw_error
    belief.body[f, p, p] = wrap(truth.yaw[f, p] + yaw_error)
    return yaw_error


@compiled
def _see(w, f, p, j, glimpse):
    """What player p makes of its Glimpse of object j."""
    c, belief = w.constants, w.belief
    reported = _reported_distance(c, glimpse.distance)
    fresh = belief.age[f, p, j] <= 1
    old_x, old_y = belief.position[f, p, j, 0], belief.position[f, p, j, 1]
    belief.position[f, p, j, 0] = belief.position[f, p, p, 0] + reported * glimpse.ux
    belief.position[f, p, j, 1] = belief.position[f, p, p, 1] + reported * glimpse.uy
    belief.age[f, p, j] = 0
    if glimpse.moves:
        _see_motion(w, f, p, j, glimpse, reported)
    elif j == w.ball and fresh and not glimpse.seen:  # P: a felt ball's, from two positions
        belief.velocity[f, p, j, 0] += (belief.position[f, p, j, 0] - old_x) * c.ball_decay
        belief.velocity[f, p, j, 1] += (belief.position[f, p, j, 1] - old_y) * c.ball_decay


@compiled
def _see_motion(w, f, p, j, glimpse, reported):
    """How object j moves, as player p sees it."""
    c, belief, velocity = w.constants, w.belief, w.truth.velocity[f]
    dx, dy, distance = glimpse.dx, glimpse.dy, glimpse.distance
    wx, wy = velocity[j, 0] - velocity[p, 0], velocity[j, 1] - velocity[p, 1]
    radial = reported * quantize((wx * dx + wy * dy) / distance, c.change_step)
    turning = (dx * wy - dy * wx) / distance
    if c.change_step > 0.0:
        turning = quantize(turning, DIRECTION_CHANGE_STEP)
    rel_vx, rel_vy = rotated(radial, reported * turning, glimpse.ux, glimpse.uy)
    vx, vy = velocity[p, 0] + rel_vx, velocity[p, 1] + rel_vy
    if j == w.ball:
        vx, vy = _blended(c, vx, vy, belief.velocity[f, p, j, 0], belief.velocity[f, p, j, 1])
    belief.velocity[f, p, j, 0], belief.velocity[f, p, j, 1] = vx, vy
    w.memory.motion_cycle[f, p, j] = belief.cycle[f]


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
def _velocity_visible(w, f, distance):
    """Near objects show how they move; farther ones with falling probability."""
    c = w.constants
    if distance <= c.certain_distance:
        return True
    share = (c.unsure_distance - distance) / (c.unsure_distance - c.certain_distance)
    return draw(w.random, f) < share


@compiled
def _blended(c, seen_x, seen_y, expected_x, expected_y):
    """P: mean of seen and expected ball velocity, unless a player must have touched it."""
    near = 2.0 * c.ball_rand * length(expected_x, expected_y)
    if abs(seen_x - expected_x) <= near and abs(seen_y - expected_y) <= near:
        return 0.5 * (seen_x + expected_x), 0.5 * (seen_y + expected_y)
    return seen_x, seen_y


@compiled
def turn_neck(w, f, p, x, y, turn):
    """Turn player p's neck toward a point, as far as it goes, after its body turned by `turn`."""
    belief = w.belief
    own = belief.position[f, p, p]
    wanted = wrap(math.atan2(y - own[1], x - own[0]) - belief.body[f, p, p] - turn)
    belief.neck[f, p] = min(max(wanted, -0.25 * TWO_PI), 0.25 * TWO_PI)
