"""What a player believes of what it does not see: dead reckoning, own body, bumps."""

from __future__ import annotations

import math

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import NEVER
from keepaway_sim.world.geometry import length, quantize, wrap
from keepaway_sim.world.phantoms import age_of, grow_old, num_opponents, opponent, place_of, put
from keepaway_sim.world.physics import dash_acceleration, kick_acceleration, limited
from keepaway_sim.world.skills.fastest import fastest_opponent
from keepaway_sim.world.state import DASH
from keepaway_sim.world.streams import draw
from keepaway_sim.world.trigonometry import bearing, unit

CHASE_SPEED = 0.3  # [m/cycle] P: the opponent fastest to the ball is believed to come so fast
DRIFT = 0.25  # [m/cycle] P: so fast the others drift along x while they are not seen
FLYING_BALL = 1.0  # [m/cycle] P: and twice as fast while the ball flies faster along x
BUMPED_DISTANCE = 0.2  # [m] P: where a ball is believed after a bump


@compiled
def same_team(c, p, q):
    """Do players p and q play for the same team?"""
    return (p < c.num_keepers) == (q < c.num_keepers)


@compiled
def forget(w, f, p):
    """A new episode: player p has seen nothing of it yet and gets a new phase of looking."""
    c, belief, memory = w.constants, w.belief, w.memory
    num = w.num_players
    for j in range(num + 1):
        belief.age[f, p, j] = NEVER
        belief.velocity[f, p, j, 0] = 0.0
        belief.velocity[f, p, j, 1] = 0.0
    memory.seen_cycle[f, p, :] = -NEVER
    memory.motion_cycle[f, p, :] = -NEVER
    memory.nameless[f, p, :] = False
    memory.behind[f, p, :] = 0
    w.phantoms.age[f, p, :] = NEVER
    memory.turned[f, p] = 0.0
    memory.kicked[f, p] = False
    memory.pass_cycle[f, p] = -2
    memory.intercept_cycle[f, p] = -10
    memory.search_cycle[f, p] = -10
    memory.vain_dashes[f, p] = 0
    memory.look_phase[f, p] = int(draw(w.random, f) * c.look_period)


@compiled
def remember(w, f, p):
    """Carry player p's belief about itself and the ball one cycle on (P: after sense_body).

    A ball is believed to lie still once it is within reach of the opponent that was nearest to it.
    """
    c, belief, memory = w.constants, w.belief, w.memory
    position, velocity = belief.position[f, p], belief.velocity[f, p]
    ball, kicked = w.ball, memory.kicked[f, p]
    if kicked:
        ax, ay = kick_acceleration(
            c,
            memory.command[f, p, 1],
            memory.command[f, p, 2],
            position[ball, 0] - position[p, 0],
            position[ball, 1] - position[p, 1],
            belief.body[f, p, p],
        )
        vx, vy = limited(velocity[ball, 0] + ax, velocity[ball, 1] + ay, c.ball_speed_max)
        velocity[ball, 0], velocity[ball, 1] = vx, vy
    belief.body[f, p, p] = wrap(belief.body[f, p, p] + memory.turned[f, p])
    grow_old(w, f, p)
    holder = nearest_opponent_to_ball(w, f, p)
    position[ball, 0] += velocity[ball, 0]
    position[ball, 1] += velocity[ball, 1]
    velocity[ball, 0] *= c.ball_decay
    velocity[ball, 1] *= c.ball_decay
    if not kicked:
        _stop_ball(w, f, p, holder)


@compiled
def roll_on(w, f, p):
    """Carry player p's belief about the other players one cycle on.

    P updateDynamicObjectForNextCycle: team-mates roll out, but for the first, who is never moved.
    The opponent who is fastest to the ball comes to it. Of the plans of the others nothing is
    known, and they drift along x: ahead while the ball flies ahead, else back. What was heard of an
    opponent was old, and makes up for it.

    Returns:
        Chase: the opponent who comes to the ball.
    """
    c, belief, memory = w.constants, w.belief, w.memory
    keeps, chase = p < c.num_keepers, fastest_opponent(w, f, p)
    ball = chase.ball
    ahead = 1.0 if keeps else -1.0  # each team's own +x
    drift = DRIFT * (2.0 if abs(ball.vx) > FLYING_BALL else 1.0)
    drift = drift * ahead if ahead * ball.vx > 0.0 else -drift * ahead
    position, velocity = belief.position[f, p], belief.velocity[f, p]
    unmoved = 0 if keeps else c.num_keepers
    for j in range(w.num_players):
        if j in (p, unmoved) or belief.age[f, p, j] > c.player_lost_age:
            continue
        if same_team(c, p, j):
            position[j, 0] += velocity[j, 0]
            position[j, 1] += velocity[j, 1]
        velocity[j, 0] *= c.player_decay
        velocity[j, 1] *= c.player_decay
    for k in range(num_opponents(w, p)):
        j = opponent(w, p, k)
        if age_of(w, f, p, j) > c.player_lost_age:
            continue
        x, y = place_of(w, f, p, j)
        vx, vy = toward(x, y, ball.x, ball.y, CHASE_SPEED) if j == chase.player else (drift, 0.0)
        cycles = 1
        if j < w.ball:
            cycles += memory.behind[f, p, j]
            memory.behind[f, p, j] = 0
        put(w, f, p, j, x + cycles * vx, y + cycles * vy)
    return chase


@compiled
def toward(x, y, to_x, to_y, size):
    """The vector of this size from a point toward another; no vector from a point to itself."""
    dx, dy = to_x - x, to_y - y
    distance = length(dx, dy)
    share = size / distance if distance > 0.0 else 0.0
    return share * dx, share * dy


@compiled
def stop_ball_of_opponent(w, f, p):
    """P: a ball within an opponent's reach is believed to lie still; his plans are unknown."""
    _stop_ball(w, f, p, nearest_opponent_to_ball(w, f, p))


@compiled
def _stop_ball(w, f, p, holder):
    """Believe that the ball lies still if it is within this opponent's reach; -1: none."""
    position, velocity, ball = w.belief.position[f, p], w.belief.velocity[f, p], w.ball
    if holder < 0:
        return
    x, y = place_of(w, f, p, holder)
    if length(position[ball, 0] - x, position[ball, 1] - y) < w.constants.kickable_distance:
        velocity[ball, 0], velocity[ball, 1] = 0.0, 0.0


@compiled
def nearest_opponent_to_ball(w, f, p):
    """The known opponent believed nearest to the ball, be it a phantom; -1: none is known."""
    bx, by = w.belief.position[f, p, w.ball]
    nearest, best = -1, math.inf
    for k in range(num_opponents(w, p)):
        j = opponent(w, p, k)
        if age_of(w, f, p, j) > w.constants.player_lost_age:
            continue
        x, y = place_of(w, f, p, j)
        dx, dy = x - bx, y - by
        distance = dx * dx + dy * dy
        if distance < best:
            nearest, best = j, distance
    return nearest


@compiled
def feel_self(w, f, p):
    """Own position and speed as the body feels them, nearly exact; a bump shows in the speed."""
    c, belief, memory = w.constants, w.belief, w.memory
    position, velocity = w.truth.position[f], w.truth.velocity[f]
    ux, uy = _expected_own_velocity(w, f, p)
    belief.position[f, p, p, 0] = position[p, 0] + memory.self_error[f, p, 0]
    belief.position[f, p, p, 1] = position[p, 1] + memory.self_error[f, p, 1]
    speed = length(velocity[p, 0], velocity[p, 1])
    share = quantize(speed, c.speed_step) / speed if speed > 0.0 else 0.0
    vx, vy = share * velocity[p, 0], share * velocity[p, 1]
    belief.velocity[f, p, p, 0], belief.velocity[f, p, p, 1] = vx, vy
    belief.age[f, p, p] = 0
    if belief.cycle[f] > 0 and _seems_bumped(w, f, p, vx, vy, ux, uy):
        _bump_ball(w, f, p)


@compiled
def _expected_own_velocity(w, f, p):
    """Velocity that player p expects of its last command, before it feels the real one."""
    c, belief, memory = w.constants, w.belief, w.memory
    vx, vy = belief.velocity[f, p, p]
    if memory.command[f, p, 0] == DASH:
        ax, ay = dash_acceleration(c, memory.command[f, p, 1], belief.body[f, p, p])
        vx, vy = limited(vx + ax, vy + ay, c.player_speed_max)
    return c.player_decay * vx, c.player_decay * vy


@compiled
def _seems_bumped(w, f, p, vx, vy, ux, uy):
    """P: does felt velocity (vx, vy) against the expected (ux, uy) mean a bump into the ball?"""
    c, belief = w.constants, w.belief
    ball = w.ball
    own = belief.position[f, p, p]
    away = length(belief.position[f, p, ball, 0] - own[0], belief.position[f, p, ball, 1] - own[1])
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
def _bump_ball(w, f, p):
    """P: after a bump the ball is believed just before the body, its velocity reversed.

    Unless another player is believed nearer, who then was bumped into.
    """
    c, belief = w.constants, w.belief
    ball = w.ball
    own = belief.position[f, p, p]
    dx, dy = belief.position[f, p, ball, 0] - own[0], belief.position[f, p, ball, 1] - own[1]
    distance = length(dx, dy)
    for j in range(ball + 1 + c.phantom_slots):
        if j in (p, ball) or age_of(w, f, p, j) > c.player_lost_age:
            continue
        x, y = place_of(w, f, p, j)
        if length(x - own[0], y - own[1]) < distance:
            return
    ux, uy = unit(bearing(dx, dy))
    belief.position[f, p, ball, 0] = own[0] + BUMPED_DISTANCE * ux
    belief.position[f, p, ball, 1] = own[1] + BUMPED_DISTANCE * uy
    belief.velocity[f, p, ball, 0] *= -0.1
    belief.velocity[f, p, ball, 1] *= -0.1
