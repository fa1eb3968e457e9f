"""What a player with a limited view makes of whom it should see and does not.

Who is not where it must be seen has moved (P WorldModelUpdate.cc: removeGhosts); who is seen by
name was perhaps already there, felt without a name (processNewObjectInfo).
"""

from __future__ import annotations

import math

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import NEVER
from keepaway_sim.world.geometry import length, wrap
from keepaway_sim.world.memory import nearest_opponent_to_ball, same_team
from keepaway_sim.world.phantoms import (
    SAME_PLAYER,
    age_of,
    farthest,
    num_opponents,
    opponent,
    place_of,
    put,
    set_age,
    yaw_of,
)
from keepaway_sim.world.trigonometry import bearing, unit

MUST_BE_SEEN = 0.65  # [1] P: inside this share of half the cone everything must be seen
MUST_BE_FELT = 0.9  # [1] P: of the distance at which the ball is felt, for noise
EDGE = math.radians(20.0)  # P: an unseen opponent further inside than this is forgotten
UNSURE = math.radians(10.0)  # P: nearer to the middle than this it may have gone either way
FACED_LATELY = 4  # [cycles] P: its body direction, seen less long ago, tells which
SAME_BALL = 2.0  # [m] P: an unseen ball is with an opponent so near to it
HOLDER_RANGE = 4.5  # [m] P: who is unseen too, and no further away


@compiled
def forget_double(w, f, p, j):
    """Player p sees j by name: a team-mate of j's that was only felt near there was j itself.

    P: processNewObjectInfo.
    """
    c = w.constants
    x, y = place_of(w, f, p, j)
    double, best = -1, SAME_PLAYER
    for k in range(w.num_players):
        unsure = w.memory.nameless[f, p, k] and w.belief.age[f, p, k] <= c.player_lost_age
        if k in (j, p) or not unsure or not same_team(c, j, k):
            continue
        kx, ky = place_of(w, f, p, k)
        away = length(kx - x, ky - y)
        if away < best:
            double, best = k, away
    for s in range(0 if same_team(c, p, j) else c.phantom_slots):
        k = w.ball + 1 + s
        kx, ky = place_of(w, f, p, k)
        away = length(kx - x, ky - y)
        if age_of(w, f, p, k) <= c.player_lost_age and away < best:
            double, best = k, away
    if double >= 0 and best < farthest(w, f, p, double):
        set_age(w, f, p, double, NEVER)


@compiled
def remove_ghosts(w, f, p):
    """After a look: forget or move who and what is not where player p must see or feel it."""
    c, belief = w.constants, w.belief
    _remove_ghost_ball(w, f, p)
    for k in range(num_opponents(w, p)):
        j = opponent(w, p, k)
        if 0 < age_of(w, f, p, j) <= c.player_lost_age:
            _remove_ghost_opponent(w, f, p, j)
    for j in range(w.num_players):
        if j == p or not same_team(c, p, j) or not 0 < belief.age[f, p, j] <= c.player_lost_age:
            continue
        x, y = belief.position[f, p, j]
        if abs(_off_centre(w, f, p, x, y)) < _must_be_seen(c):
            belief.age[f, p, j] = NEVER


@compiled
def _must_be_seen(c):
    """How far off the middle of its view a player must still see everything [rad]."""
    return 0.5 * MUST_BE_SEEN * c.visible_angle


@compiled
def _remove_ghost_opponent(w, f, p, j):
    """An opponent who is not seen is forgotten, or has left the cone; not felt, it is no nearer."""
    x, y = place_of(w, f, p, j)
    off = abs(_off_centre(w, f, p, x, y))
    if off < _must_be_seen(w.constants) - EDGE:
        set_age(w, f, p, j, NEVER)
    elif off < _must_be_seen(w.constants):
        _move_to_edge(w, f, p, j)
    _move_out_of_touch(w, f, p, j)


@compiled
def _off_centre(w, f, p, x, y):
    """Direction of a point from the middle of player p's view [rad]."""
    belief = w.belief
    own = belief.position[f, p, p]
    return wrap(bearing(x - own[0], y - own[1]) - belief.body[f, p, p] - belief.neck[f, p])


@compiled
def _move_to_edge(w, f, p, j):
    """An unseen opponent is believed at the nearer edge of the cone, if it can have run there."""
    c, belief = w.constants, w.belief
    own = belief.position[f, p, p]
    x, y = place_of(w, f, p, j)
    off = _off_centre(w, f, p, x, y)
    if abs(off) < UNSURE and _faced_lately(w, f, p, j):
        ux, uy = unit(yaw_of(w, f, p, j))
        off = _off_centre(w, f, p, x + 2.0 * ux, y + 2.0 * uy)
    edge = belief.body[f, p, p] + belief.neck[f, p]
    edge += 0.5 * c.visible_angle if off > 0.0 else -0.5 * c.visible_angle
    away = length(x - own[0], y - own[1])
    ux, uy = unit(edge)
    to_x, to_y = own[0] + away * ux, own[1] + away * uy
    if length(to_x - x, to_y - y) < farthest(w, f, p, j):
        put(w, f, p, j, to_x, to_y)


@compiled
def _faced_lately(w, f, p, j):
    """Has player p seen not long ago which way j faces? A phantom's way is never seen."""
    if j > w.ball:
        return False
    return w.belief.cycle[f] - w.memory.motion_cycle[f, p, j] < FACED_LATELY


@compiled
def _move_out_of_touch(w, f, p, j):
    """An opponent who is expected in touch, and not felt, is believed just out of it."""
    c, own = w.constants, w.belief.position[f, p, p]
    x, y = place_of(w, f, p, j)
    dx, dy = x - own[0], y - own[1]
    away = length(dx, dy)
    if 0.0 < away < c.feel_distance:
        share = c.feel_distance / away
        put(w, f, p, j, own[0] + share * dx, own[1] + share * dy)


@compiled
def _remove_ghost_ball(w, f, p):
    """A ball that is not where it must be is with an opponent close to it, or it is forgotten."""
    c, belief, ball = w.constants, w.belief, w.ball
    if belief.age[f, p, ball] in (0, NEVER):
        return
    own, place = belief.position[f, p, p], belief.position[f, p, ball]
    felt = length(place[0] - own[0], place[1] - own[1]) < MUST_BE_FELT * c.feel_distance
    if abs(_off_centre(w, f, p, place[0], place[1])) < _must_be_seen(c):
        holder = _holder(w, f, p)
        x, y = place_of(w, f, p, holder) if holder >= 0 else (own[0], own[1])
        near = length(x - own[0], y - own[1]) < HOLDER_RANGE
        if holder >= 0 and near and age_of(w, f, p, holder) > 0:
            place[0], place[1] = x, y
        else:
            belief.age[f, p, ball] = NEVER
    if felt:
        holder = _holder(w, f, p)
        if holder >= 0:
            place[0], place[1] = place_of(w, f, p, holder)
        else:
            belief.age[f, p, ball] = NEVER


@compiled
def _holder(w, f, p):
    """The opponent believed with the ball; -1: none is so near to it."""
    holder = nearest_opponent_to_ball(w, f, p)
    if holder < 0:
        return -1
    x, y = place_of(w, f, p, holder)
    bx, by = w.belief.position[f, p, w.ball]
    return holder if length(x - bx, y - by) < SAME_BALL else -1
