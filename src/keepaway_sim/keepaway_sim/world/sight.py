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
from keepaway_sim.world.geometry import TWO_PI, length, rotated, wrap
from keepaway_sim.world.ghosts import forget_double, remove_ghosts
from keepaway_sim.world.memory import stop_ball_of_opponent
from keepaway_sim.world.streams import draw
from keepaway_sim.world.touch import feel_players
from keepaway_sim.world.trigonometry import bearing, unit


class Glimpse(NamedTuple):
    """What a player gets of an object it sees or only feels."""

    distance: float  # [m] as reported
    ux: float  # the unit vector from the player to the object as the player believes it
    uy: float
    radial: float  # [1/cycle] change of distance as a share of it, as reported
    turning: float  # [rad/cycle] change of direction, as reported
    seen: bool
    moves: bool  # is it seen how it moves?


@compiled
def look(w, f, p):
    """Player p sees its surroundings, which `survey` has measured, and updates its belief."""
    c, belief, sights = w.constants, w.belief, w.sights
    yaw_error = _look_at_self(w, f, p)
    turn = yaw_error  # from `_reported_direction` to what the player believes
    if c.direction_step > 0.0:
        turn = w.truth.yaw[f, p] + belief.neck[f, p] + yaw_error
    cosine, sine = unit(turn)
    w.scratch.felt[:] = math.nan
    for j in range(w.ball + 1):
        if j == p:
            continue
        k = sights.first[p] + j
        distance = sights.distance[k]
        seen = abs(sights.direction[k]) <= 0.5 * c.visible_angle
        if not seen and distance > c.feel_distance:
            continue
        ux, uy = rotated(*_reported_direction(w, k), cosine, sine)
        reported = _reported_distance(c, distance)
        if not seen and j < w.ball:
            w.scratch.felt[j, 0] = belief.position[f, p, p, 0] + reported * ux
            w.scratch.felt[j, 1] = belief.position[f, p, p, 1] + reported * uy
            w.scratch.felt[j, 2] = reported
            continue
        moves = seen and _velocity_visible(w, f, distance)
        radial, turning = sights.radial[k], sights.turning[k]
        _see(w, f, p, j, Glimpse(reported, ux, uy, radial, turning, seen, moves))
        if j < w.ball:
            _recognize(w, f, p, j, wrap(w.truth.yaw[f, j] + yaw_error), moves)
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
    c, belief, away = w.constants, w.belief, glimpse.distance
    fresh = belief.age[f, p, j] <= 1
    old_x, old_y = belief.position[f, p, j, 0], belief.position[f, p, j, 1]
    belief.position[f, p, j, 0] = belief.position[f, p, p, 0] + away * glimpse.ux
    belief.position[f, p, j, 1] = belief.position[f, p, p, 1] + away * glimpse.uy
    belief.age[f, p, j] = 0
    if glimpse.moves:
        _see_motion(w, f, p, j, glimpse)
    elif j == w.ball and fresh and not glimpse.seen:  # P: a felt ball's, from two positions
        belief.velocity[f, p, j, 0] += (belief.position[f, p, j, 0] - old_x) * c.ball_decay
        belief.velocity[f, p, j, 1] += (belief.position[f, p, j, 1] - old_y) * c.ball_decay


@compiled
def _see_motion(w, f, p, j, glimpse):
    """How object j moves, as player p sees it."""
    c, belief, velocity = w.constants, w.belief, w.truth.velocity[f]
    radial, across = glimpse.distance * glimpse.radial, glimpse.distance * glimpse.turning
    rel_vx, rel_vy = rotated(radial, across, glimpse.ux, glimpse.uy)
    vx, vy = velocity[p, 0] + rel_vx, velocity[p, 1] + rel_vy
    if j == w.ball:
        vx, vy = _blended(c, vx, vy, belief.velocity[f, p, j, 0], belief.velocity[f, p, j, 1])
    belief.velocity[f, p, j, 0], belief.velocity[f, p, j, 1] = vx, vy
    w.memory.motion_cycle[f, p, j] = belief.cycle[f]


@compiled
def _reported_direction(w, k):
    """Pair k's unit vector: as it is, or rounded as the server reports it, then from the view."""
    c, sights = w.constants, w.sights
    if c.direction_step == 0.0:
        return sights.dx[k], sights.dy[k]
    step = int(sights.steps[k]) + len(c.direction_cosine) // 2
    return c.direction_cosine[step], c.direction_sine[step]


@compiled
def _reported_distance(c, distance):
    """The distance as the server reports it, see `config._sight_tables`."""
    if c.quantize_step == 0.0:
        return distance
    edge = c.sight_first[min(int(distance * SIGHT_CELLS), len(c.sight_first) - 1)]
    edge += distance >= c.sight_edge[edge]  # few cells have more edges than one
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
    wanted = wrap(bearing(x - own[0], y - own[1]) - belief.body[f, p, p] - turn)
    belief.neck[f, p] = min(max(wanted, -0.25 * TWO_PI), 0.25 * TWO_PI)
