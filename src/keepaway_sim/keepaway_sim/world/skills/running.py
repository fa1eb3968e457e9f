"""Turning, dashing, moving to a point, searching for the ball."""

from __future__ import annotations

import math

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.geometry import length, wrap
from keepaway_sim.world.skills.prediction import dash_power, turn_moment
from keepaway_sim.world.state import DASH, TURN


@compiled
def expected_turn(c, s, f, p, kind, angle):
    """By how much player p expects its body to turn with a command."""
    if kind != TURN:
        return 0.0
    speed = length(s.velocity[f, p, p, 0], s.velocity[f, p, p, 1])
    return angle / (1.0 + c.inertia_moment * speed)


@compiled
def turn_body_to(c, s, f, p, x, y, cycles):
    """Turn toward a point as seen from where the player will have rolled after `cycles`."""
    px, py = s.position[f, p, p]
    vx, vy = s.velocity[f, p, p]
    roll = c.player_roll[cycles]
    angle = wrap(math.atan2(y - py - roll * vy, x - px - roll * vx) - s.body[f, p, p])
    return TURN, 0.0, turn_moment(c, angle, length(vx, vy))


@compiled
def turn_body_along(c, s, f, p, direction):
    """Turn toward a global direction."""
    x, y = s.position[f, p, p]
    reach = 1.0
    return turn_body_to(
        c, s, f, p, x + reach * math.cos(direction), y + reach * math.sin(direction), 1
    )


@compiled
def dash_to(c, s, f, p, x, y, cycles):
    """Dash so as to come nearest to a point in `cycles`."""
    px, py = s.position[f, p, p]
    vx, vy = s.velocity[f, p, p]
    cosine, sine = math.cos(s.body[f, p, p]), math.sin(s.body[f, p, p])
    along = cosine * (x - px) + sine * (y - py)
    return DASH, dash_power(c, along, cosine * vx + sine * vy, cycles), 0.0


@compiled
def move_to(c, s, f, p, x, y, when_to_turn, back_distance):
    """Run to a point: dash if it lies ahead (or near behind), else turn (P: moveToPos)."""
    px, py = s.position[f, p, p]
    vx, vy = s.velocity[f, p, p]
    roll = 1.0 / (1.0 - c.player_decay)
    angle = wrap(math.atan2(y - py - roll * vy, x - px - roll * vx) - s.body[f, p, p])
    back = wrap(angle + math.pi)
    away = length(x - px, y - py)
    if abs(angle) < when_to_turn or (abs(back) < when_to_turn and away < back_distance):
        return dash_to(c, s, f, p, x, y, 1)
    speed = length(vx, vy)
    turns, left = 0, angle
    while abs(left) > when_to_turn and turns < 3:
        left -= turn_moment(c, left, speed) / (1.0 + c.inertia_moment * speed)
        speed *= c.player_decay
        turns += 1
    if turns < 3:
        return turn_body_to(c, s, f, p, x, y, 2)
    return dash_to(c, s, f, p, px, py, 1)  # too fast to turn: stop first


@compiled
def search(c, s, m, f, p):
    """Turn on and on in steps, first toward where the ball was believed (P: searchBall)."""
    now = s.cycle[f]
    if now - m.search_cycle[f, p] > 3:
        ball = c.num_keepers + c.num_takers
        dx = s.position[f, p, ball, 0] - s.position[f, p, p, 0]
        dy = s.position[f, p, ball, 1] - s.position[f, p, p, 1]
        left = wrap(math.atan2(dy, dx) - s.body[f, p, p]) >= 0.0
        m.search_sign[f, p] = 1.0 if left else -1.0
    m.search_cycle[f, p] = now
    s.neck[f, p] = 0.0
    return turn_body_along(c, s, f, p, s.body[f, p, p] + m.search_sign[f, p] * c.search_turn)


@compiled
def direction_of_play(c, p):
    """Keepers play toward +x, takers toward -x (the server's left and right team)."""
    return 0.0 if p < c.num_keepers else math.pi
