"""Kicks: passes, holding the ball, freezing it."""

from __future__ import annotations

import math
from typing import NamedTuple

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.geometry import clip, length, wrap
from keepaway_sim.world.phantoms import age_of, num_opponents, opponent, place_of, yaw_of
from keepaway_sim.world.physics import kick_acceleration, kick_rate, limited
from keepaway_sim.world.skills.running import turn_body_to
from keepaway_sim.world.state import KICK, NONE, Command
from keepaway_sim.world.trigonometry import bearing, unit

QUARTER = 0.25 * math.pi
HOLD_RANGE = 5.0  # [m] a nearer opponent is shielded from
AT_SPOT = 0.3  # [m] the ball lies well for holding
GOAL_X = 52.5  # [m] P: who holds the ball turns toward the opponents' goal on a whole pitch
STAYS_SHARE = 0.85  # [1] of the kickable distance, in which the ball must stay
FREEZE_SHARE = 0.8
OVER_POWER = 1.05  # [1] of full power that a pass may lack
OVER_POWER_PRESSED = 1.30  # with an opponent within PRESSED_RANGE of the ball
PRESSED_RANGE = 2.0  # [m]
SAFE_REACH = 0.7  # [1] of the kickable distance, where a frozen ball is brought back to


class Stance(NamedTuple):
    """What a player that kicks believes of itself and of the ball [m, m/cycle, rad]."""

    x: float
    y: float
    vx: float
    vy: float
    yaw: float
    ball_x: float
    ball_y: float
    ball_vx: float
    ball_vy: float


@compiled
def stance(w, f, p):
    """How a player stands to the ball, as it believes."""
    belief, ball = w.belief, w.ball
    x, y = belief.position[f, p, p]
    vx, vy = belief.velocity[f, p, p]
    bx, by = belief.position[f, p, ball]
    bvx, bvy = belief.velocity[f, p, ball]
    return Stance(x, y, vx, vy, belief.body[f, p, p], bx, by, bvx, bvy)


@compiled
def closest_opponent_to(w, f, p, x, y):
    """(player, distance) of the known opponent nearest to a point; (-1, inf) without one."""
    nearest, best = -1, math.inf
    for k in range(num_opponents(w, p)):
        j = opponent(w, p, k)
        if age_of(w, f, p, j) > w.constants.player_lost_age:
            continue
        ox, oy = place_of(w, f, p, j)
        away = length(ox - x, oy - y)
        if away < best:
            nearest, best = j, away
    return nearest, best


@compiled
def ball_after(w, f, p, command):
    """Believed place of the ball after this cycle's own command."""
    c, s = w.constants, stance(w, f, p)
    vx, vy = s.ball_vx, s.ball_vy
    if command.kind == KICK:
        _, power, angle = command
        ax, ay = kick_acceleration(c, power, angle, s.ball_x - s.x, s.ball_y - s.y, s.yaw)
        vx, vy = limited(vx + ax, vy + ay, c.ball_speed_max)
    return s.ball_x + vx, s.ball_y + vy


@compiled
def hold_ball(w, f, p, distance):
    """Keep the ball on the side away from the nearest opponent (P: holdBall).

    Args:
        distance: share of the kickable margin between body and ball.
    """
    c, s = w.constants, stance(w, f, p)
    nearest, away = closest_opponent_to(w, f, p, s.ball_x, s.ball_y)
    angle = 0.0
    if nearest >= 0 and away < HOLD_RANGE:
        ox, oy = place_of(w, f, p, nearest)
        from_opponent = bearing(s.x - ox, s.y - oy)
        heads_left = wrap(yaw_of(w, f, p, nearest) - from_opponent) > 0.0
        angle = wrap(from_opponent + (-QUARTER if heads_left else QUARTER) - s.yaw)
    # P compares with the spot at `angle` in field axes, not body axes; kept as it is there.
    spot_x, spot_y = unit(angle)
    spot = length(s.ball_x - s.x - distance * spot_x, s.ball_y - s.y - distance * spot_y)
    if spot < AT_SPOT:
        chosen = turn_body_to(w, f, p, GOAL_X if p < c.num_keepers else -GOAL_X, 0.0, 1)
        next_x, next_y = ball_after(w, f, p, Command(NONE, 0.0, 0.0))
        stays = length(next_x - s.x - s.vx, next_y - s.y - s.vy)
        if stays < STAYS_SHARE * c.kickable_distance:
            return chosen
    return kick_close(w, f, p, angle, distance)


@compiled
def _rate(c, s):
    """Speed that a unit of kick power gives the ball from a stance [m/cycle]."""
    return kick_rate(c, s.ball_x - s.x, s.ball_y - s.y, s.yaw)


@compiled
def kick_close(w, f, p, angle, distance):
    """Kick the ball to a spot beside the body (P: kickBallCloseToBody).

    Args:
        angle: of the spot, relative to the body [rad].
        distance: share of the kickable margin between body and ball.
    """
    c, s = w.constants, stance(w, f, p)
    reach = c.touch_distance + c.kickable_margin * distance
    ux, uy = unit(s.yaw + angle)
    want_x = s.x + s.vx + reach * ux - s.ball_x - s.ball_vx
    want_y = s.y + s.vy + reach * uy - s.ball_y - s.ball_vy
    power = length(want_x, want_y) / _rate(c, s)
    if power > 100.0 and length(s.ball_vx, s.ball_vy) > 0.1:
        return freeze_ball(w, f, p)
    return Command(KICK, min(power, 100.0), wrap(bearing(want_x, want_y) - s.yaw))


@compiled
def freeze_ball(w, f, p):
    """Stop the ball where it is, or bring it back within reach (P: freezeBall)."""
    c, s = w.constants, stance(w, f, p)
    power = min(length(s.ball_vx, s.ball_vy) / _rate(c, s), 100.0)
    angle = wrap(bearing(s.ball_vx, s.ball_vy) + math.pi - s.yaw)
    kick = Command(KICK, power, angle)
    next_x, next_y = ball_after(w, f, p, kick)
    if length(next_x - s.x - s.vx, next_y - s.y - s.vy) < FREEZE_SHARE * c.kickable_distance:
        return kick
    rel_x, rel_y = s.ball_x - s.x - s.vx, s.ball_y - s.y - s.vy
    rest = length(rel_x, rel_y)
    reach = min(SAFE_REACH * c.kickable_distance, rest - 0.1)
    ux, uy = unit(bearing(rel_x, rel_y))
    to_x = s.x + s.vx + reach * ux
    to_y = s.y + s.vy + reach * uy
    return accelerate_ball(w, f, p, to_x - s.ball_x, to_y - s.ball_y)


@compiled
def accelerate_ball(w, f, p, want_x, want_y):
    """Give the ball a velocity, or at least its direction (P: accelerateBallToVelocity)."""
    c, s = w.constants, stance(w, f, p)
    rate = _rate(c, s)
    ax, ay = want_x - s.ball_vx, want_y - s.ball_vy
    size = length(ax, ay)
    if size < c.ball_accel_max and size / rate <= 100.0:
        return Command(KICK, size / rate, wrap(bearing(ax, ay) - s.yaw))
    angle = _full_power_angle(s, bearing(want_x, want_y), rate)
    return Command(KICK, 100.0, wrap(angle - s.yaw))


@compiled
def _full_power_angle(s, direction, rate):
    """Where to kick with full power so that the ball leaves in a direction [rad, field axes]."""
    ux, uy = unit(direction)
    across = clip((ux * s.ball_vy - uy * s.ball_vx) / (100.0 * rate), -1.0, 1.0)
    return direction - bearing(math.sqrt(1.0 - across * across), across)


@compiled
def pass_speed(c, distance, end_speed):
    """First speed of a ball that covers `distance` and then has `end_speed` (whole cycles)."""
    growth = 1.0 / c.ball_decay
    needed = 1.0 + distance / end_speed * (growth - 1.0)  # so many times as fast it must be
    grown, half = 1.0, math.sqrt(growth)
    while grown * half < needed:
        grown *= growth
    return end_speed * grown


@compiled
def kick_to(w, f, p, x, y, end_speed):
    """Kick the ball so that it passes a point with `end_speed`, set it up first if it must be.

    P: kickTo.
    """
    c, s = w.constants, stance(w, f, p)
    direction = bearing(x - s.ball_x, y - s.ball_y)
    speed = pass_speed(c, length(x - s.ball_x, y - s.ball_y), end_speed)
    cosine, sine = unit(direction)
    gap_x = s.x + s.vx - s.ball_x - speed * cosine
    gap_y = s.y + s.vy - s.ball_y - speed * sine
    if length(gap_x, gap_y) < c.touch_distance:  # the kick would hit the own body
        along = abs(cosine * (s.x - s.ball_x) + sine * (s.y - s.ball_y))
        speed = along - c.touch_distance if speed < along else along + c.touch_distance
    if speed > c.ball_speed_max:
        return _kick_unreachable(w, f, p, direction, speed)
    power = length(speed * cosine - s.ball_vx, speed * sine - s.ball_vy) / _rate(c, s)
    pressed = closest_opponent_to(w, f, p, s.ball_x, s.ball_y)[1] < PRESSED_RANGE
    if power <= 100.0 * (OVER_POWER_PRESSED if pressed else OVER_POWER):
        return accelerate_ball(w, f, p, speed * cosine, speed * sine)
    return kick_close(w, f, p, 0.0, c.setup_distance)


@compiled
def _kick_unreachable(w, f, p, direction, speed):
    """A kick harder than the ball can fly: kick if nearly full speed, else set it up."""
    c, s = w.constants, stance(w, f, p)
    rate = _rate(c, s)
    angle = _full_power_angle(s, direction, rate)
    ux, uy = unit(angle)
    reached = length(s.ball_vx + 100.0 * rate * ux, s.ball_vy + 100.0 * rate * uy)
    if reached > c.when_to_kick * c.ball_accel_max:
        ux, uy = unit(direction)
        return accelerate_ball(w, f, p, speed * ux, speed * uy)
    if rate > c.when_to_kick * c.kick_power_rate:
        return freeze_ball(w, f, p)
    return kick_close(w, f, p, 0.0, c.setup_distance)
