"""Kicks: passes, holding the ball, freezing it."""

from __future__ import annotations

import math

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.geometry import clip, length, wrap
from keepaway_sim.world.phantoms import age_of, num_opponents, opponent, place_of, yaw_of
from keepaway_sim.world.physics import kick_acceleration, kick_rate, limited
from keepaway_sim.world.skills.running import turn_body_to
from keepaway_sim.world.state import KICK, NONE, Command

QUARTER = 0.25 * math.pi
HOLD_RANGE = 5.0  # [m] a nearer opponent is shielded from
AT_SPOT = 0.3  # [m] the ball lies well for holding
GOAL_X = 52.5  # [m] P: who holds the ball turns toward the opponents' goal on a whole pitch
STAYS_SHARE = 0.85  # [1] of the kickable distance, in which the ball must stay
FREEZE_SHARE = 0.8
OVER_POWER = 1.05  # [1] of full power that a pass may lack
OVER_POWER_PRESSED = 1.30  # with an opponent within PRESSED_RANGE of the ball
PRESSED_RANGE = 2.0  # [m]


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
    c, belief = w.constants, w.belief
    ball = w.ball
    x, y = belief.position[f, p, ball]
    vx, vy = belief.velocity[f, p, ball]
    if command.kind == KICK:
        _, power, angle = command
        px, py = belief.position[f, p, p]
        ax, ay = kick_acceleration(c, power, angle, x - px, y - py, belief.body[f, p, p])
        vx, vy = limited(vx + ax, vy + ay, c.ball_speed_max)
    return x + vx, y + vy


@compiled
def hold_ball(w, f, p, distance):
    """Keep the ball on the side away from the nearest opponent (P: holdBall).

    Args:
        distance: share of the kickable margin between body and ball.
    """
    c, belief = w.constants, w.belief
    ball = w.ball
    px, py = belief.position[f, p, p]
    bx, by = belief.position[f, p, ball]
    yaw = belief.body[f, p, p]
    nearest, away = closest_opponent_to(w, f, p, bx, by)
    angle = 0.0
    if nearest >= 0 and away < HOLD_RANGE:
        ox, oy = place_of(w, f, p, nearest)
        from_opponent = math.atan2(py - oy, px - ox)
        heads_left = wrap(yaw_of(w, f, p, nearest) - from_opponent) > 0.0
        angle = wrap(from_opponent + (-QUARTER if heads_left else QUARTER) - yaw)
    # P compares with the spot at `angle` in field axes, not body axes; kept as it is there.
    spot = length(bx - px - distance * math.cos(angle), by - py - distance * math.sin(angle))
    if spot < AT_SPOT:
        chosen = turn_body_to(w, f, p, GOAL_X if p < c.num_keepers else -GOAL_X, 0.0, 1)
        next_x, next_y = ball_after(w, f, p, Command(NONE, 0.0, 0.0))
        vx, vy = belief.velocity[f, p, p]
        stays = length(next_x - px - vx, next_y - py - vy)
        if stays < STAYS_SHARE * c.kickable_distance:
            return chosen
    return kick_close(w, f, p, angle, distance)


@compiled
def _rate(w, f, p):
    c, belief = w.constants, w.belief
    ball = w.ball
    px, py = belief.position[f, p, p]
    bx, by = belief.position[f, p, ball]
    return kick_rate(c, bx - px, by - py, belief.body[f, p, p])


@compiled
def kick_close(w, f, p, angle, distance):
    """Kick the ball to a spot beside the body (P: kickBallCloseToBody).

    Args:
        angle: of the spot, relative to the body [rad].
        distance: share of the kickable margin between body and ball.
    """
    c, belief = w.constants, w.belief
    ball = w.ball
    px, py = belief.position[f, p, p]
    ux, uy = belief.velocity[f, p, p]
    bx, by = belief.position[f, p, ball]
    vx, vy = belief.velocity[f, p, ball]
    yaw = belief.body[f, p, p]
    reach = c.touch_distance + c.kickable_margin * distance
    want_x = px + ux + reach * math.cos(yaw + angle) - bx - vx
    want_y = py + uy + reach * math.sin(yaw + angle) - by - vy
    power = length(want_x, want_y) / _rate(w, f, p)
    if power > 100.0 and length(vx, vy) > 0.1:
        return freeze_ball(w, f, p)
    return Command(KICK, min(power, 100.0), wrap(math.atan2(want_y, want_x) - yaw))


@compiled
def freeze_ball(w, f, p):
    """Stop the ball where it is, or bring it back within reach (P: freezeBall)."""
    c, belief = w.constants, w.belief
    ball = w.ball
    px, py = belief.position[f, p, p]
    ux, uy = belief.velocity[f, p, p]
    bx, by = belief.position[f, p, ball]
    vx, vy = belief.velocity[f, p, ball]
    power = min(length(vx, vy) / _rate(w, f, p), 100.0)
    angle = wrap(math.atan2(vy, vx) + math.pi - belief.body[f, p, p])
    kick = Command(KICK, power, angle)
    next_x, next_y = ball_after(w, f, p, kick)
    if length(next_x - px - ux, next_y - py - uy) < FREEZE_SHARE * c.kickable_distance:
        return kick
    rel_x, rel_y = bx - px - ux, by - py - uy
    rest = length(rel_x, rel_y)
    reach = min(SAFE_REACH * c.kickable_distance, rest - 0.1)
    direction = math.atan2(rel_y, rel_x)
    to_x = px + ux + reach * math.cos(direction)
    to_y = py + uy + reach * math.sin(direction)
    return accelerate_ball(w, f, p, to_x - bx, to_y - by)


SAFE_REACH = 0.7  # [1] of the kickable distance, where a frozen ball is brought back to


@compiled
def accelerate_ball(w, f, p, want_x, want_y):
    """Give the ball a velocity, or at least its direction (P: accelerateBallToVelocity)."""
    c, belief = w.constants, w.belief
    ball = w.ball
    vx, vy = belief.velocity[f, p, ball]
    yaw = belief.body[f, p, p]
    rate = _rate(w, f, p)
    ax, ay = want_x - vx, want_y - vy
    size = length(ax, ay)
    if size < c.ball_accel_max and size / rate <= 100.0:
        return Command(KICK, size / rate, wrap(math.atan2(ay, ax) - yaw))
    direction = math.atan2(want_y, want_x)
    across = -math.sin(direction) * vx + math.cos(direction) * vy
    angle = direction - math.asin(clip(across / (100.0 * rate), -1.0, 1.0))
    return Command(KICK, 100.0, wrap(angle - yaw))


@compiled
def pass_speed(c, distance, end_speed):
    """First speed of a ball that covers `distance` and then has `end_speed` (whole cycles)."""
    growth = 1.0 / c.ball_decay
    steps = math.log(1.0 - distance / end_speed * (1.0 - growth)) / math.log(growth)
    return end_speed * growth ** round(steps)


@compiled
def kick_to(w, f, p, x, y, end_speed):
    """Kick the ball so that it passes a point with `end_speed`, set it up first if it must be.

    P: kickTo.
    """
    c, belief = w.constants, w.belief
    ball = w.ball
    px, py = belief.position[f, p, p]
    ux, uy = belief.velocity[f, p, p]
    bx, by = belief.position[f, p, ball]
    vx, vy = belief.velocity[f, p, ball]
    direction = math.atan2(y - by, x - bx)
    speed = pass_speed(c, length(x - bx, y - by), end_speed)
    cosine, sine = math.cos(direction), math.sin(direction)
    if length(px + ux - bx - speed * cosine, py + uy - by - speed * sine) < c.touch_distance:
        along = abs(cosine * (px - bx) + sine * (py - by))  # the kick would hit the own body
        speed = along - c.touch_distance if speed < along else along + c.touch_distance
    rate = _rate(w, f, p)
    if speed > c.ball_speed_max:
        return _kick_unreachable(w, f, p, direction, speed, rate)
    power = length(speed * cosine - vx, speed * sine - vy) / rate
    pressed = closest_opponent_to(w, f, p, bx, by)[1] < PRESSED_RANGE
    if power <= 100.0 * (OVER_POWER_PRESSED if pressed else OVER_POWER):
        return accelerate_ball(w, f, p, speed * cosine, speed * sine)
    return kick_close(w, f, p, 0.0, c.setup_distance)


@compiled
def _kick_unreachable(w, f, p, direction, speed, rate):
    """A kick harder than the ball can fly: kick if nearly full speed, else set it up."""
    c, belief = w.constants, w.belief
    ball = w.ball
    vx, vy = belief.velocity[f, p, ball]
    across = -math.sin(direction) * vx + math.cos(direction) * vy
    angle = direction - math.asin(clip(across / (100.0 * rate), -1.0, 1.0))
    reached = length(vx + 100.0 * rate * math.cos(angle), vy + 100.0 * rate * math.sin(angle))
    if reached > c.when_to_kick * c.ball_accel_max:
        return accelerate_ball(w, f, p, speed * math.cos(direction), speed * math.sin(direction))
    if rate > c.when_to_kick * c.kick_power_rate:
        return freeze_ball(w, f, p)
    return kick_close(w, f, p, 0.0, c.setup_distance)
