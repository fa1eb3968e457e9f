"""Predictions of a player's own and others' movement: who reaches the ball when, and how.

Source: P WorldModelPredict.cc. Simplified: the meeting point is the first one in reach unless the
one already chosen can still be met safely (P also moves on to a safer point next to it).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import NEVER, ROLL_CYCLES
from keepaway_sim.world.geometry import clip, length
from keepaway_sim.world.trigonometry import unit

LOOK_AHEAD = 4  # [cycles] P: a player rolls out so long before a turn is judged
SAME_POINT = 1.0  # [m] P: a new meeting point so near the old one is the old one
SAFE_SHARE = 0.7  # [1] of the kickable distance: safely in reach
BEYOND = 100  # [cycles] P: a ball out of reach is followed to where it is about to lie
KEEP_HORIZON = 20  # [cycles] P: so much later than the first point the old one may be met
UNKNOWN_SPEED = 0.3  # [m/cycle] P: speed of a player not seen moving lately
TURNS = 3  # [cycles] of turning that a player may be spared where the ball comes its way
ROUNDING = 1e-6  # [m] more than all rounding of a distance
ALMOST_ONE = 1.0 - 1e-9  # [cycles] makes `int` round up, but for rounding errors
MOVING_BALL = 0.6  # [m/cycle] P: slower balls need no old meeting point


class Body(NamedTuple):
    """A player as another one believes it."""

    x: float  # [m]
    y: float
    vx: float  # [m/cycle]
    vy: float
    ux: float  # unit vector of the body direction; both 0: unknown
    uy: float


class Ball(NamedTuple):
    """The ball as a player believes it."""

    x: float  # [m]
    y: float
    vx: float  # [m/cycle]
    vy: float


class Meeting(NamedTuple):
    """When and where a player meets the ball."""

    cycles: int  # from now; NEVER if it does not
    x: float  # [m]
    y: float


@compiled
def body_of(w, f, p, j):
    """Player j as player p believes it."""
    x, y = w.belief.position[f, p, j]
    vx, vy = w.belief.velocity[f, p, j]
    yaw = w.belief.body[f, p, j]
    ux, uy = unit(yaw)
    return Body(x, y, vx, vy, ux, uy)


@compiled
def ball_of(w, f, p):
    """The ball as player p believes it."""
    x, y = w.belief.position[f, p, w.ball]
    vx, vy = w.belief.velocity[f, p, w.ball]
    return Ball(x, y, vx, vy)


@compiled
def ball_ahead(c, ball, cycles):
    """Where the ball will have rolled after `cycles`, at most ROLL_CYCLES - 1."""
    roll = c.ball_roll[cycles]
    return ball.x + roll * ball.vx, ball.y + roll * ball.vy


@compiled
def dash_power(c, along, speed_along, cycles):
    """Power of the dash that covers `along` metres ahead in `cycles` (P: getPowerForDash)."""
    wanted = c.player_speed_max
    if along * (1.0 - c.player_decay) < c.player_speed_max:  # else too far for any `cycles`
        wanted = min(along / c.player_roll[cycles], wanted)
    return clip((wanted - speed_along) / c.dash_power_rate, -100.0, 100.0)


@compiled
def turn_moment(c, angle, speed):
    """Moment to send so that a player at `speed` turns by `angle` (P: getAngleForTurn)."""
    return clip(angle * (1.0 + c.inertia_moment * speed), -math.pi, math.pi)


@compiled
def heading_to_go(c, body, to_x, to_y, cycles):
    """Does a player turn before it runs to a point, and where does it face a cycle later?

    A player turns while the point lies off the line of its body, or behind it and further than
    `back_dash_distance`; near points may also be reached backwards (P: predictCommandTurnTowards).

    Args:
        c: Constants.
        body: Body of the player.
        to_x, to_y, cycles: the point, and the time there is to reach it.

    Returns:
        whether it turns, and the unit vector of its body after one cycle of it.
    """
    x, y, vx, vy, ux, uy = body
    back_distance = c.back_dash_distance
    roll = c.player_roll[min(cycles, LOOK_AHEAD)]
    rel_x, rel_y = to_x - x - roll * vx, to_y - y - roll * vy
    away = length(to_x - x, to_y - y)
    ratio = 3.0 if away > 20.0 else (2.0 if away > 10.0 else 0.9)
    allowed = ratio * c.kickable_distance
    rest = length(rel_x, rel_y)
    if not _off(ux, uy, rel_x, rel_y, rest, allowed, back_distance):
        return False, ux, uy
    rel_x, rel_y = rel_x / rest, rel_y / rest
    most = math.pi / (1.0 + c.inertia_moment * length(vx, vy))
    ahead_x, ahead_y = _turned(ux, uy, rel_x, rel_y, most)
    near = cycles < 4 and rest < back_distance
    if near and _off(ahead_x, ahead_y, rest * rel_x, rest * rel_y, rest, allowed, back_distance):
        back_x, back_y = _turned(ux, uy, -rel_x, -rel_y, most)
        if rest * abs(back_x * rel_y - back_y * rel_x) < 0.9 * c.kickable_distance:
            return True, back_x, back_y
    return True, ahead_x, ahead_y


@compiled
def _faces(c, body, rel_x, rel_y):
    """Does a point lie so well ahead that `heading_to_go` does not turn? Cheap, and misses some."""
    rel_x, rel_y = rel_x - body.vx, rel_y - body.vy
    ahead = body.ux * rel_x + body.uy * rel_y
    across = body.ux * rel_y - body.uy * rel_x
    return ahead > 0.0 and abs(across) <= 0.9 * c.kickable_distance


@compiled
def _off(ux, uy, rel_x, rel_y, rest, allowed, back_distance):
    """Does a point lie too far off the line of a body, or too far behind it?"""
    behind = ux * rel_x + uy * rel_y < 0.0
    return abs(ux * rel_y - uy * rel_x) > allowed or (behind and rest > back_distance)


@compiled
def _turned(ux, uy, to_x, to_y, most):
    """The unit vector u turned toward the unit vector `to`, but by no more than `most` [rad]."""
    ahead = ux * to_x + uy * to_y
    if most > 3.0 or (most > 1.6 and ahead >= 0.0):  # slow players turn anywhere, or half round
        return to_x, to_y
    cosine, _ = unit(most)
    if ahead >= cosine:
        return to_x, to_y
    sine = math.sqrt(1.0 - cosine * cosine)
    if ux * to_y - uy * to_x < 0.0:
        sine = -sine
    return cosine * ux - sine * uy, sine * ux + cosine * uy


@compiled
def reach_after(c, body, to_x, to_y, cycles):
    """Distance to a point that is left after `cycles` of going there (P: intercept loop).

    The player turns as long as it must, then runs on its line. Simplified: the speed limit of a
    player that rolls sideways while it dashes at full power is left out.
    """
    while cycles > 0:
        turning, ux, uy = heading_to_go(c, body, to_x, to_y, cycles)
        body = Body(body.x, body.y, body.vx, body.vy, ux, uy)
        if not turning:
            break
        body = _rolled(c, body)
        cycles -= 1
    x, y, vx, vy, ux, uy = body
    rel_x, rel_y = to_x - x, to_y - y
    along, speed = ux * rel_x + uy * rel_y, ux * vx + uy * vy
    across = ux * rel_y - uy * rel_x - c.player_roll[cycles] * (ux * vy - uy * vx)
    forward, speed = (along, speed) if along >= 0.0 else (-along, -speed)
    return length(max(forward - full_run(c, speed, cycles), 0.0), across)


@compiled
def _rolled(c, body):
    """A body a cycle later, if its player does nothing."""
    x, y, vx, vy, ux, uy = body
    return Body(x + vx, y + vy, c.player_decay * vx, c.player_decay * vy, ux, uy)


@compiled
def full_run(c, speed, cycles):
    """Metres made in `cycles` of dashing at full power, from a speed of `speed` ahead.

    Speeds before decay approach the top speed geometrically, so after k dashes the way made is
    top * k + (first - top) * (1 - decay**k) / (1 - decay).
    """
    roll = c.player_roll[min(cycles, ROLL_CYCLES - 1)]
    return c.top_speed * cycles + (speed + c.full_dash - c.top_speed) * roll


@compiled
def meeting_cycles(c, body, ball, old_x, old_y, has_old):
    """The first Meeting of a player with the ball, or the old one if that can still be kept.

    Args:
        c: Constants.
        body: Body of the player.
        ball: Ball.
        old_x, old_y, has_old: the meeting point chosen in the last cycles, if any.

    Returns:
        Meeting, after BEYOND cycles if there is none within the horizon.
    """
    first = Meeting(NEVER, 0.0, 0.0)
    kept, kept_off = Meeting(NEVER, 0.0, 0.0), SAME_POINT
    speed = length(ball.vx, ball.vy)
    i = straight_run(c, body, 0, ball, c.intercept_horizon)
    while i <= c.intercept_horizon:
        bx, by = ball_ahead(c, ball, i)
        off = length(bx - old_x, by - old_y) if has_old else math.inf
        moving = speed * _left_of_speed(c, c.ball_roll[i]) > MOVING_BALL
        candidate = moving and off < kept_off
        skip = 1
        if first.cycles == NEVER or candidate:
            left = _left_after(c, body, bx, by, i)
            if first.cycles == NEVER and left < c.kickable_distance:
                first = Meeting(i, bx, by)
            if candidate and left < SAFE_SHARE * c.kickable_distance:
                kept, kept_off = Meeting(i, bx, by), off
            if first.cycles == NEVER:
                skip = max(int((left - c.kickable_distance) / (1.0 + speed)), 1)
        decided = not has_old or not moving or i >= first.cycles + KEEP_HORIZON
        if first.cycles != NEVER and decided:
            break
        i += skip
    if kept.cycles != NEVER:
        return kept
    if first.cycles != NEVER:
        return first
    bx, by = ball_ahead(c, ball, BEYOND)
    return Meeting(BEYOND, bx, by)


@compiled
def _left_after(c, body, to_x, to_y, cycles):
    """`reach_after`, but only a lower bound where the point is out of question."""
    roll = c.player_roll[min(cycles, LOOK_AHEAD)]
    rest = length(to_x - body.x - roll * body.vx, to_y - body.y - roll * body.vy)
    if rest / c.player_speed_max > cycles + c.kickable_distance:
        return rest - cycles * c.player_speed_max
    return reach_after(c, body, to_x, to_y, cycles)


@compiled
def run_cycles(c, distance, speed):
    """Full dashes needed to come within kicking distance of a point straight ahead.

    Args:
        distance: to the point [m].
        speed: the player's own toward it [m/cycle].
    """
    needed = distance - c.kickable_distance
    if needed <= 0.0:
        return 0
    lag = (c.top_speed - c.full_dash - speed) * c.player_roll[ROLL_CYCLES - 1]
    cycles = max(int((needed + min(lag, 0.0)) / c.top_speed), 1)
    while full_run(c, speed, cycles) < needed:
        cycles += 1
    return cycles


@compiled
def cycles_to_point(c, body, to_x, to_y):
    """Cycles a player needs to bring a point within kicking distance (turns included).

    A player whose heading is unknown (ux = uy = 0) is believed to run there (P).
    """
    cycles = 0
    for _ in range(5):
        rel_x, rel_y = to_x - body.x, to_y - body.y
        distance = length(rel_x, rel_y)
        if distance < c.kickable_distance:
            return cycles
        if body.ux == 0.0 and body.uy == 0.0:
            return run_cycles(c, distance, UNKNOWN_SPEED)
        if _faces(c, body, rel_x, rel_y):
            break
        turns, ux, uy = heading_to_go(c, body, to_x, to_y, 1)
        body = Body(body.x, body.y, body.vx, body.vy, ux, uy)
        if not turns:
            break
        body = _rolled(c, body)
        cycles += 1
    speed = body.ux * body.vx + body.uy * body.vy
    return cycles + run_cycles(c, length(to_x - body.x, to_y - body.y), speed)


@compiled
def reach_ball(c, body, lead, ball, start, limit):
    """When a player reaches the moving ball.

    The first cycle i in which the ball's place i cycles ahead can be reached within i cycles
    (P: createInterceptFeatures). Cycles are skipped in which it cannot be.

    Args:
        c: Constants.
        body: Body of the player.
        lead: cycles that it has been on its way already.
        ball: Ball.
        start: the first cycle that is looked at, as `straight_run` gives it.
        limit: the last one.

    Returns:
        i, and the cycles that the player needs to there; NEVER, NEVER where i is beyond `limit`.
    """
    speed = length(ball.vx, ball.vy)
    i = start
    while i <= limit:
        bx, by = ball_ahead(c, ball, i)
        needed = max(cycles_to_point(c, body, bx, by) - lead, 0)
        if needed <= i:
            return i, needed
        left = _left_of_speed(c, c.ball_roll[i])
        i += max(int((needed - TURNS - i) / (1.0 + speed * left)), 1)
    return NEVER, NEVER


@compiled
def straight_run(c, body, lead, ball, limit):
    """Cycles before which a player does not reach the ball, even running straight without a turn.

    Beyond `limit` it is not looked for.

    The distance to a ball on a straight line is a convex function of the way it has rolled, so
    it falls by no more than it falls now; cycles in which it cannot have fallen enough are skipped.
    """
    near = straight_distance(c, body, 0)
    if _rolls_past(body, ball, c.ball_roll[limit], near + c.top_speed * (limit + lead)):
        return limit + 1
    i = 0
    while i <= limit:
        bx, by = ball_ahead(c, ball, i)
        rel_x, rel_y = bx - body.x, by - body.y
        distance = length(rel_x, rel_y)
        gap = distance - near - c.top_speed * (i + lead)
        if gap <= 0.0:
            return i
        coming = max(-(rel_x * ball.vx + rel_y * ball.vy) / distance, 0.0)
        left = _left_of_speed(c, c.ball_roll[i])
        i += max(int(gap / (c.top_speed + coming * left) + ALMOST_ONE), 1)
    return i


@compiled
def straight_distance(c, body, cycles):
    """From no farther away [m] than this a player reaches a point within N cycles.

    It is reached by who faces it, at the speed the player has, and runs at full power.
    """
    rolled = length(body.vx, body.vy) * c.player_roll[ROLL_CYCLES - 1]
    return c.kickable_distance + rolled + c.top_speed * cycles


@compiled
def _rolls_past(body, ball, roll, reach):
    """Does a ball, rolling for `roll` times its speed, stay farther than `reach` from a player?

    Without a division. Who is nearer by less than rounding can make up is not said to be passed.
    """
    rel_x, rel_y = body.x - ball.x, body.y - ball.y
    along = rel_x * ball.vx + rel_y * ball.vy
    square = ball.vx * ball.vx + ball.vy * ball.vy
    reach = reach + ROUNDING
    if along <= 0.0:  # it rolls away
        return rel_x * rel_x + rel_y * rel_y > reach * reach
    if along >= roll * square:  # it does not come so far
        rel_x, rel_y = rel_x - roll * ball.vx, rel_y - roll * ball.vy
        return rel_x * rel_x + rel_y * rel_y > reach * reach
    across = rel_x * ball.vy - rel_y * ball.vx
    return across * across > reach * reach * square


@compiled
def _left_of_speed(c, roll):
    """Share of its speed that a ball has after rolling `roll` times its first speed."""
    return 1.0 - (1.0 - c.ball_decay) * roll
