"""Turning, dashing, moving to a point, searching for the ball."""

from __future__ import annotations

import math

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.geometry import length, wrap
from keepaway_sim.world.physics import dash_acceleration
from keepaway_sim.world.skills.prediction import dash_power, turn_moment
from keepaway_sim.world.state import DASH, TURN, Command
from keepaway_sim.world.trigonometry import bearing, unit


@compiled
def expected_turn(w, f, p, command):
    """By how much player p expects its body to turn with a command."""
    c, belief = w.constants, w.belief
    if command.kind != TURN:
        return 0.0
    speed = length(belief.velocity[f, p, p, 0], belief.velocity[f, p, p, 1])
    return command.angle / (1.0 + c.inertia_moment * speed)


@compiled
def place_after(w, f, p, command):
    """Where player p expects to be a cycle after a command."""
    belief = w.belief
    x, y = belief.position[f, p, p]
    vx, vy = belief.velocity[f, p, p]
    ax, ay = 0.0, 0.0
    if command.kind == DASH:
        ax, ay = dash_acceleration(w.constants, command.power, belief.body[f, p, p])
    return x + vx + ax, y + vy + ay


@compiled
def turn_body_to(w, f, p, x, y, cycles):
    """Turn toward a point as seen from where the player will have rolled after `cycles`."""
    c, belief = w.constants, w.belief
    px, py = belief.position[f, p, p]
    vx, vy = belief.velocity[f, p, p]
    roll = c.player_roll[cycles]
    angle = wrap(bearing(x - px - roll * vx, y - py - roll * vy) - belief.body[f, p, p])
    return Command(TURN, 0.0, turn_moment(c, angle, length(vx, vy)))


@compiled
def turn_body_along(w, f, p, direction):
    """Turn toward a global direction."""
    belief = w.belief
    x, y = belief.position[f, p, p]
    ux, uy = unit(direction)
    return turn_body_to(w, f, p, x + ux, y + uy, 1)


@compiled
def dash_to(w, f, p, x, y, cycles):
    """Dash so as to come nearest to a point in `cycles`."""
    c, belief = w.constants, w.belief
    px, py = belief.position[f, p, p]
    vx, vy = belief.velocity[f, p, p]
    cosine, sine = unit(belief.body[f, p, p])
    along = cosine * (x - px) + sine * (y - py)
    return Command(DASH, dash_power(c, along, cosine * vx + sine * vy, cycles), 0.0)


@compiled
def move_to(w, f, p, x, y, when_to_turn, back_distance):
    """Run to a point: dash if it lies ahead (or near behind), else turn (P: moveToPos)."""
    c, belief = w.constants, w.belief
    px, py = belief.position[f, p, p]
    vx, vy = belief.velocity[f, p, p]
    roll = 1.0 / (1.0 - c.player_decay)
    angle = wrap(bearing(x - px - roll * vx, y - py - roll * vy) - belief.body[f, p, p])
    back = wrap(angle + math.pi)
    away = length(x - px, y - py)
    if abs(angle) < when_to_turn or (abs(back) < when_to_turn and away < back_distance):
        return dash_to(w, f, p, x, y, 1)
    speed = length(vx, vy)
    turns, left = 0, angle
    while abs(left) > when_to_turn and turns < 3:
        left -= turn_moment(c, left, speed) / (1.0 + c.inertia_moment * speed)
        speed *= c.player_decay
        turns += 1
    if turns < 3:
        return turn_body_to(w, f, p, x, y, 2)
    return dash_to(w, f, p, px, py, 1)  # too fast to turn: stop first


@compiled
def search(w, f, p):
    """Turn on and on in steps, first toward where the ball was believed (P: searchBall)."""
    c, belief, memory = w.constants, w.belief, w.memory
    now = belief.cycle[f]
    if now - memory.search_cycle[f, p] > 3:
        ball = w.ball
        dx = belief.position[f, p, ball, 0] - belief.position[f, p, p, 0]
        dy = belief.position[f, p, ball, 1] - belief.position[f, p, p, 1]
        left = wrap(bearing(dx, dy) - belief.body[f, p, p]) >= 0.0
        memory.search_sign[f, p] = 1.0 if left else -1.0
    memory.search_cycle[f, p] = now
    belief.neck[f, p] = 0.0
    return turn_body_along(w, f, p, belief.body[f, p, p] + memory.search_sign[f, p] * c.search_turn)


@compiled
def direction_of_play(c, p):
    """Keepers play toward +x, takers toward -x (the server's left and right team)."""
    return 0.0 if p < c.num_keepers else math.pi
