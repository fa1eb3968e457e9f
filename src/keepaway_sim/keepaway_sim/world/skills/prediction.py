"""Predictions of a player's own and others' movement: who reaches the ball when, and how.

Source: P WorldModelPredict.cc. Simplified: the meeting point is the first one in reach unless the
one already chosen can still be met safely (P also moves on to a safer point next to it).
"""

from __future__ import annotations

import math

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import NEVER, ROLL_CYCLES
from keepaway_sim.world.geometry import clip, length

LOOK_AHEAD = 4  # [cycles] P: a player rolls out so long before a turn is judged
SAME_POINT = 1.0  # [m] P: a new meeting point so near the old one is the old one
SAFE_SHARE = 0.7  # [1] of the kickable distance: safely in reach
STILL = 0.01  # [m/cycle] a slower ball lies still
BEYOND = 100  # [cycles] P: a ball out of reach is followed to where it is about to lie
KEEP_HORIZON = 20  # [cycles] P: so much later than the first point the old one may be met
LATELY = 3  # [cycles] P: motion seen longer ago is unknown
UNKNOWN_SPEED = 0.3  # [m/cycle] P: who has not been seen moving lately runs to the point so fast
MOVING_BALL = 0.6  # [m/cycle] P: slower balls need no old meeting point


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
def heading_to_go(c, x, y, vx, vy, ux, uy, to_x, to_y, cycles, back_distance):
    """Does a player turn before it runs to a point, and where does it face a cycle later?

    A player turns while the point lies off the line of its body, or behind it and further than
    `back_distance`; near points may also be reached backwards (P: predictCommandTurnTowards).

    Args:
        x, y, vx, vy: the player's position [m] and velocity [m/cycle].
        ux, uy: unit vector of its body direction.
        to_x, to_y, cycles: the point, and the time there is to reach it.

    Returns:
        whether it turns, and the unit vector of its body after one cycle of it.
    """
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
def _faces(c, rel_x, rel_y, vx, vy, ux, uy):
    """Does a point lie so well ahead that `heading_to_go` does not turn? Cheap, and misses some."""
    rel_x, rel_y = rel_x - vx, rel_y - vy
    ahead = ux * rel_x + uy * rel_y
    return ahead > 0.0 and abs(ux * rel_y - uy * rel_x) <= 0.9 * c.kickable_distance


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
    cosine = math.cos(most)
    if ahead >= cosine:
        return to_x, to_y
    sine = math.sqrt(1.0 - cosine * cosine)
    if ux * to_y - uy * to_x < 0.0:
        sine = -sine
    return cosine * ux - sine * uy, sine * ux + cosine * uy


@compiled
def reach_after(c, x, y, vx, vy, ux, uy, to_x, to_y, cycles):
    """Distance to a point that is left after `cycles` of going there (P: intercept loop).

    The player turns as long as it must, then runs on its line. Simplified: the speed limit of a
    player that rolls sideways while it dashes at full power is left out.
    """
    turning = True
    while cycles > 0:
        turning, ux, uy = heading_to_go(
            c, x, y, vx, vy, ux, uy, to_x, to_y, cycles, c.back_dash_distance
        )
        if not turning:
            break
        x, y = x + vx, y + vy
        vx, vy = c.player_decay * vx, c.player_decay * vy
        cycles -= 1
    rel_x, rel_y = to_x - x, to_y - y
    along, speed = ux * rel_x + uy * rel_y, ux * vx + uy * vy
    across = ux * rel_y - uy * rel_x - c.player_roll[cycles] * (ux * vy - uy * vx)
    forward, speed = (along, speed) if along >= 0.0 else (-along, -speed)
    return length(max(forward - full_run(c, speed, cycles), 0.0), across)


@compiled
def full_run(c, speed, cycles):
    """Metres made in `cycles` of dashing at full power, from a speed of `speed` ahead.

    Speeds before decay approach the top speed geometrically, so after k dashes the way made is
    top * k + (first - top) * (1 - decay**k) / (1 - decay).
    """
    roll = c.player_roll[min(cycles, ROLL_CYCLES - 1)]
    return c.top_speed * cycles + (speed + c.full_dash - c.top_speed) * roll


@compiled
def meeting_cycles(c, x, y, vx, vy, ux, uy, ball, ball_v, old_x, old_y, has_old):
    """Cycles until a player can meet the ball, and where.

    Args:
        ball, ball_v: (2,) believed position [m] and velocity [m/cycle].
        old_x, old_y, has_old: the meeting point chosen in the last cycles, if any.

    Returns:
        cycles (BEYOND if not within the horizon), x, y of the ball then.
    """
    first, first_x, first_y = NEVER, 0.0, 0.0
    kept, kept_x, kept_y, kept_off = NEVER, 0.0, 0.0, SAME_POINT
    speed = length(ball_v[0], ball_v[1])
    i = _straight_run(c, x, y, vx, vy, ball, ball_v, c.intercept_horizon)
    while i <= c.intercept_horizon:
        roll = c.ball_roll[i]
        bx, by = ball[0] + roll * ball_v[0], ball[1] + roll * ball_v[1]
        off = length(bx - old_x, by - old_y) if has_old else math.inf
        moving = speed * _left_of_speed(c, roll) > MOVING_BALL
        candidate = moving and off < kept_off
        skip = 1
        if first == NEVER or candidate:
            left = _left_after(c, x, y, vx, vy, ux, uy, bx, by, i)
            if first == NEVER and left < c.kickable_distance:
                first, first_x, first_y = i, bx, by
            if candidate and left < SAFE_SHARE * c.kickable_distance:
                kept, kept_x, kept_y, kept_off = i, bx, by, off
            if first == NEVER:
                skip = max(int((left - c.kickable_distance) / (1.0 + speed)), 1)
        if first != NEVER and (not has_old or not moving or i >= first + KEEP_HORIZON):
            break
        i += skip
    if kept != NEVER:
        return kept, kept_x, kept_y
    if first != NEVER:
        return first, first_x, first_y
    roll = c.ball_roll[BEYOND]
    return BEYOND, ball[0] + roll * ball_v[0], ball[1] + roll * ball_v[1]


@compiled
def _left_after(c, x, y, vx, vy, ux, uy, to_x, to_y, cycles):
    """`reach_after`, but only a lower bound where the point is out of question."""
    roll = c.player_roll[min(cycles, LOOK_AHEAD)]
    rest = length(to_x - x - roll * vx, to_y - y - roll * vy)
    if rest / c.player_speed_max > cycles + c.kickable_distance:
        return rest - cycles * c.player_speed_max
    return reach_after(c, x, y, vx, vy, ux, uy, to_x, to_y, cycles)


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
def cycles_to_point(c, x, y, vx, vy, ux, uy, to_x, to_y):
    """Cycles a player needs to bring a point within kicking distance (turns included).

    A player whose heading is unknown (ux = uy = 0) is believed to run there (P).
    """
    cycles = 0
    for _ in range(5):
        rel_x, rel_y = to_x - x, to_y - y
        distance = length(rel_x, rel_y)
        if distance < c.kickable_distance:
            return cycles
        if ux == 0.0 and uy == 0.0:
            return run_cycles(c, distance, UNKNOWN_SPEED)
        if _faces(c, rel_x, rel_y, vx, vy, ux, uy):
            break
        turns, ux, uy = heading_to_go(c, x, y, vx, vy, ux, uy, to_x, to_y, 1, c.back_dash_distance)
        if not turns:
            break
        x, y = x + vx, y + vy
        vx, vy = c.player_decay * vx, c.player_decay * vy
        cycles += 1
    return cycles + run_cycles(c, length(to_x - x, to_y - y), ux * vx + uy * vy)


@compiled
def cycles_to_ball(c, x, y, vx, vy, ux, uy, ball, ball_v, limit):
    """Cycles a player needs to reach the moving ball; NEVER if that takes more than `limit`.

    The first cycle i in which the ball's place i cycles ahead can be reached within i cycles
    (P: getFastestInSetTo). Cycles are skipped in which it cannot be.
    """
    speed = length(ball_v[0], ball_v[1])
    if speed < STILL:
        needed = cycles_to_point(c, x, y, vx, vy, ux, uy, ball[0], ball[1])
        return needed if needed <= limit else NEVER
    i = _straight_run(c, x, y, vx, vy, ball, ball_v, limit)
    while i <= limit:
        roll = c.ball_roll[i]
        bx, by = ball[0] + roll * ball_v[0], ball[1] + roll * ball_v[1]
        needed = cycles_to_point(c, x, y, vx, vy, ux, uy, bx, by)
        if needed <= i:
            return needed
        i += max(int((needed - i) / (1.0 + speed * _left_of_speed(c, roll))), 1)
    return NEVER


@compiled
def _straight_run(c, x, y, vx, vy, ball, ball_v, limit):
    """Cycles before which nobody reaches the ball, even running straight without a turn.

    Beyond `limit` it is not looked for.

    The distance to a ball on a straight line is a convex function of the way it has rolled, so
    it falls by no more than it falls now; cycles in which it cannot have fallen enough are skipped.
    """
    lead = c.kickable_distance + length(vx, vy) * c.player_roll[ROLL_CYCLES - 1]
    i = 0
    while i <= limit:
        roll = c.ball_roll[i]
        rel_x, rel_y = ball[0] + roll * ball_v[0] - x, ball[1] + roll * ball_v[1] - y
        distance = length(rel_x, rel_y)
        gap = distance - lead - c.top_speed * i
        if gap <= 0.0:
            return i
        coming = max(-(rel_x * ball_v[0] + rel_y * ball_v[1]) / distance, 0.0)
        i += max(int(gap / (c.top_speed + coming * _left_of_speed(c, roll))), 1)
    return i


@compiled
def _left_of_speed(c, roll):
    """Share of its speed that a ball has after rolling `roll` times its first speed."""
    return 1.0 - (1.0 - c.ball_decay) * roll
