"""Running to the ball and taking it."""

from __future__ import annotations

import math

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.geometry import clip, length, wrap
from keepaway_sim.world.skills.kicking import FREEZE_SHARE, closest_opponent_to
from keepaway_sim.world.skills.prediction import (
    LOOK_AHEAD,
    ball_of,
    body_of,
    dash_power,
    heading_to_go,
    meeting_cycles,
    turn_moment,
)
from keepaway_sim.world.skills.running import dash_to, direction_of_play, turn_body_along
from keepaway_sim.world.state import DASH, NONE, TURN, Command
from keepaway_sim.world.trigonometry import bearing, unit

CLOSE_RANGE = 3.0  # [m] an opponent so near makes a player take the ball at once
FACING = math.radians(25.0)  # [rad] faces its direction of play well enough


@compiled
def intercept(w, f, p):
    """Go where the ball can be met first (P: intercept, predictCommandToInterceptBall)."""
    c, belief, memory = w.constants, w.belief, w.memory
    body, now = body_of(w, f, p, p), belief.cycle[f]
    has_old = memory.intercept_cycle[f, p] >= now - 2
    old_x, old_y = memory.intercept_point[f, p]
    cycles, to_x, to_y = meeting_cycles(c, body, ball_of(w, f, p), old_x, old_y, has_old)
    memory.intercept_cycle[f, p] = now
    memory.intercept_point[f, p, 0], memory.intercept_point[f, p, 1] = to_x, to_y
    if cycles < 3:
        close = meet_closely(w, f, p)
        if close.kind != NONE:
            return close
    roll = c.player_roll[min(cycles, LOOK_AHEAD)]
    x, y, vx, vy, ux, uy = body
    if length(to_x - x - roll * vx, to_y - y - roll * vy) < 0.5:
        return turn_body_along(w, f, p, direction_of_play(c, p))
    turns, wx, wy = heading_to_go(c, body, to_x, to_y, cycles)
    if turns:
        angle = bearing(ux * wx + uy * wy, ux * wy - uy * wx)
        return Command(TURN, 0.0, turn_moment(c, angle, length(vx, vy)))
    return dash_to(w, f, p, to_x, to_y, max(cycles, 1))


@compiled
def meet_closely(w, f, p):
    """Command for a ball that can be met within two cycles; NONE if nothing helps.

    With an opponent near, a dash brings the ball into reach at once; otherwise the player first
    turns toward its direction of play while the ball comes (P: interceptClose).
    """
    c, belief = w.constants, w.belief
    ball = w.ball
    px, py = belief.position[f, p, p]
    vx, vy = belief.velocity[f, p, p]
    bx, by = belief.position[f, p, ball]
    ux, uy = belief.velocity[f, p, ball]
    power, dash_helps = _one_dash(w, f, p)
    if dash_helps and closest_opponent_to(w, f, p, px, py)[1] < CLOSE_RANGE:
        return Command(DASH, power, 0.0)
    forward = direction_of_play(c, p)
    yaw = belief.body[f, p, p]
    turn = turn_body_along(w, f, p, forward)
    within = FREEZE_SHARE * c.kickable_distance
    turn_helps = False
    reached = yaw
    speed = length(vx, vy)
    for cycles in (1, 2):
        angle = wrap(forward - reached)
        reached += turn_moment(c, angle, speed) / (1.0 + c.inertia_moment * speed)
        speed *= c.player_decay
        roll, ball_roll = c.player_roll[cycles], c.ball_roll[cycles]
        away = length(px + roll * vx - bx - ball_roll * ux, py + roll * vy - by - ball_roll * uy)
        if away < within:
            turn_helps = True
            if abs(wrap(forward - reached)) < FACING:
                return turn
    if abs(wrap(forward - yaw)) > FACING:
        kind, stop, _ = dash_to(w, f, p, px, py, 1)
        ahead_x, ahead_y = unit(yaw)
        sx = px + vx + c.dash_power_rate * stop * ahead_x
        sy = py + vy + c.dash_power_rate * stop * ahead_y
        ball_roll = c.ball_roll[2]
        if length(sx - bx - ball_roll * ux, sy - by - ball_roll * uy) < within:
            return Command(kind, stop, 0.0)
    if turn_helps:
        return turn
    if dash_helps:
        return Command(DASH, power, 0.0)
    return Command(NONE, 0.0, 0.0)


@compiled
def _one_dash(w, f, p):
    """(power, helps): the dash after which the ball lies in front of the body and in reach.

    The player's line of movement is cut with a circle around the next place of the ball; of the
    two points the one further in its direction of play is taken, then the other.
    """
    c, belief = w.constants, w.belief
    ball = w.ball
    px, py = belief.position[f, p, p]
    vx, vy = belief.velocity[f, p, p]
    yaw = belief.body[f, p, p]
    cosine, sine = unit(yaw)
    bx = belief.position[f, p, ball, 0] + belief.velocity[f, p, ball, 0]
    by = belief.position[f, p, ball, 1] + belief.velocity[f, p, ball, 1]
    speed = cosine * vx + sine * vy
    rel_x, rel_y = bx - px - vx, by - py - vy
    along, across = cosine * rel_x + sine * rel_y, cosine * rel_y - sine * rel_x
    reach = c.touch_distance + c.kickable_margin / 6.0
    half = reach * reach - across * across
    if half >= 0.0:
        step = math.sqrt(half)
        if (cosine if p < c.num_keepers else -cosine) < 0.0:
            step = -step
        for sign in (1.0, -1.0):
            power, away = _dash_result(c, along + sign * step, speed, along, across)
            if away < 0.95 * c.kickable_distance:
                return power, True
    power, away = _dash_result(c, along, speed, along, across)
    return power, away < 0.95 * c.kickable_distance


@compiled
def _dash_result(c, wanted, speed, along, across):
    """(power, distance to the ball) of a dash meant to end `wanted` beyond rolling out once."""
    power = dash_power(c, wanted + speed, speed, 1)
    gained = clip(power, c.min_dash_power, 100.0) * c.dash_power_rate
    return power, length(along - gained, across)
