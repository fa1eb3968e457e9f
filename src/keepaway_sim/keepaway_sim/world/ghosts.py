"""What a player with a limited view makes of whom it feels but does not see, and of ghosts.

Within 3 m a player is felt all round, but only as a player: nobody knows who it is (S
visualsenderplayer.cpp). Who is not where it must be seen has moved (P WorldModelUpdate.cc:
mapUnknownPlayers, removeGhosts).
"""

from __future__ import annotations

import math

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import NEVER
from keepaway_sim.world.geometry import bearing, length, wrap
from keepaway_sim.world.memory import nearest_opponent_to_ball, same_team

MUST_BE_SEEN = 0.65  # [1] P: inside this share of half the cone everything must be seen
MUST_BE_FELT = 0.9  # [1] P: of the distance at which the ball is felt, for noise
EDGE = math.radians(20.0)  # P: an unseen opponent further inside than this is forgotten
UNSURE = math.radians(10.0)  # P: nearer to the middle than this it may have gone either way
FACED_LATELY = 4  # [cycles] P: its body direction, seen less long ago, tells which
SAME_BALL = 2.0  # [m] P: an unseen ball is with an opponent so near to it
HOLDER_RANGE = 4.5  # [m] P: who is unseen too, and no further away
SAME_PLAYER = 7.5  # [m] P: a felt player this near to an expected one may be that one
SPARE_WAY = 2.0  # [m] P: that it may have made beyond full speed, because of noise
UNKNOWN_BODY = math.radians(80.0)  # P: -1000 degrees stands for an unknown body direction


@compiled
def feel_somebody(w, f, p, x, y):
    """Player p feels a player at (x, y): it is taken for who is expected nearest to there, unseen.

    If nobody can be, then for an opponent of whom nothing is known.
    """
    c, belief, memory = w.constants, w.belief, w.memory
    who, best = -1, SAME_PLAYER
    for k in range(w.num_players):
        if k == p or belief.age[f, p, k] == 0 or belief.age[f, p, k] >= c.player_lost_age:
            continue
        away = length(x - belief.position[f, p, k, 0], y - belief.position[f, p, k, 1])
        if away < best:
            who, best = k, away
    if who < 0 or best >= _farthest(w, f, p, who) + SPARE_WAY:
        who = _unknown_opponent(w, f, p)
    if who < 0:
        return
    belief.position[f, p, who, 0], belief.position[f, p, who, 1] = x, y
    belief.velocity[f, p, who, 0], belief.velocity[f, p, who, 1] = 0.0, 0.0
    belief.body[f, p, who] = UNKNOWN_BODY if p < c.num_keepers else UNKNOWN_BODY - math.pi
    belief.age[f, p, who] = 0
    memory.seen[f, p, who, 0], memory.seen[f, p, who, 1] = x, y
    memory.seen_cycle[f, p, who] = belief.cycle[f]
    memory.motion_cycle[f, p, who] = -NEVER
    memory.nameless[f, p, who] = True


@compiled
def _farthest(w, f, p, j):
    """How far player j may have run since it was perceived (P: getMaxTraveledDistance) [m]."""
    return w.belief.age[f, p, j] * w.constants.player_speed_max


@compiled
def _unknown_opponent(w, f, p):
    """The first opponent of whom player p knows nothing; -1: there is none."""
    c = w.constants
    for k in range(w.num_players):
        if not same_team(c, p, k) and w.belief.age[f, p, k] >= c.player_lost_age:
            return k
    return -1


@compiled
def forget_double(w, f, p, j):
    """Player p sees j by name: a team-mate of j's that was only felt near there was j itself.

    P: processNewObjectInfo.
    """
    c, belief = w.constants, w.belief
    x, y = belief.position[f, p, j]
    double, best = -1, SAME_PLAYER
    for k in range(w.num_players):
        unsure = w.memory.nameless[f, p, k] and belief.age[f, p, k] <= c.player_lost_age
        if k in (j, p) or not unsure or not same_team(c, j, k):
            continue
        away = length(belief.position[f, p, k, 0] - x, belief.position[f, p, k, 1] - y)
        if away < best:
            double, best = k, away
    if double >= 0 and best < _farthest(w, f, p, double):
        belief.age[f, p, double] = NEVER


@compiled
def remove_ghosts(w, f, p):
    """After a look: forget or move who and what is not where player p must see or feel it."""
    c, belief = w.constants, w.belief
    _remove_ghost_ball(w, f, p)
    for j in range(w.num_players):
        if j == p or belief.age[f, p, j] == 0 or belief.age[f, p, j] > c.player_lost_age:
            continue
        x, y = belief.position[f, p, j]
        off = abs(_off_centre(w, f, p, x, y))
        inside = 0.5 * MUST_BE_SEEN * c.visible_angle
        if off < inside and (same_team(c, p, j) or off < inside - EDGE):
            belief.age[f, p, j] = NEVER
        elif off < inside:
            _move_to_edge(w, f, p, j)
        if not same_team(c, p, j):
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
    x, y = belief.position[f, p, j]
    off = _off_centre(w, f, p, x, y)
    if abs(off) < UNSURE and belief.cycle[f] - w.memory.motion_cycle[f, p, j] < FACED_LATELY:
        yaw = belief.body[f, p, j]
        off = _off_centre(w, f, p, x + 2.0 * math.cos(yaw), y + 2.0 * math.sin(yaw))
    edge = belief.body[f, p, p] + belief.neck[f, p]
    edge += 0.5 * c.visible_angle if off > 0.0 else -0.5 * c.visible_angle
    away = length(x - own[0], y - own[1])
    to_x, to_y = own[0] + away * math.cos(edge), own[1] + away * math.sin(edge)
    if length(to_x - x, to_y - y) < _farthest(w, f, p, j):
        belief.position[f, p, j, 0], belief.position[f, p, j, 1] = to_x, to_y


@compiled
def _move_out_of_touch(w, f, p, j):
    """An opponent who is expected in touch, and not felt, is believed just out of it."""
    c, belief = w.constants, w.belief
    own = belief.position[f, p, p]
    dx, dy = belief.position[f, p, j, 0] - own[0], belief.position[f, p, j, 1] - own[1]
    away = length(dx, dy)
    if 0.0 < away < c.feel_distance:
        belief.position[f, p, j, 0] = own[0] + c.feel_distance * dx / away
        belief.position[f, p, j, 1] = own[1] + c.feel_distance * dy / away


@compiled
def _remove_ghost_ball(w, f, p):
    """A ball that is not where it must be is with an opponent close to it, or it is forgotten."""
    c, belief, ball = w.constants, w.belief, w.ball
    if belief.age[f, p, ball] in (0, NEVER):
        return
    own, place = belief.position[f, p, p], belief.position[f, p, ball]
    felt = length(place[0] - own[0], place[1] - own[1]) < MUST_BE_FELT * c.feel_distance
    off = abs(_off_centre(w, f, p, place[0], place[1]))
    if not felt and off >= 0.5 * MUST_BE_SEEN * c.visible_angle:
        return
    opponent = nearest_opponent_to_ball(w, f, p)
    if opponent >= 0:
        x, y = belief.position[f, p, opponent]
        has_it = length(x - place[0], y - place[1]) < SAME_BALL
        if not felt:
            near = length(x - own[0], y - own[1]) < HOLDER_RANGE
            has_it = has_it and near and belief.age[f, p, opponent] > 0
        if has_it:
            place[0], place[1] = x, y
            return
    belief.age[f, p, ball] = NEVER
