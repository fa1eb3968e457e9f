"""A requested high-level action becomes this cycle's dash, turn or kick.

Every skill reads the acting player's own belief only (`vision.Perceptions` and `vision.Memory`),
never the truth. A command is (kind, power, angle): a dash has a power, a turn an angle (the
moment to send, radians), a kick both (angle relative to the body).

Source: P BasicPlayer.cc and KeepawayPlayer.cc. Simplified: `meet_closely` leaves out colliding
with the ball on purpose.
"""

from __future__ import annotations

import math

from keepaway_sim.task import Action
from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import NEVER
from keepaway_sim.world.geometry import TWO_PI, clip, cone_contains, length, wrap
from keepaway_sim.world.physics import kick_acceleration, kick_rate, limited
from keepaway_sim.world.sight import DASH, KICK, NONE, TURN, same_team, turn_neck
from keepaway_sim.world.skills.prediction import (
    LOOK_AHEAD,
    dash_power,
    heading_to_go,
    meeting_cycles,
    turn_moment,
)

_HOLD = int(Action.HOLD_BALL)
_PASS = int(Action.PASS_BALL)
_OPEN = int(Action.GET_OPEN)
_MARK = int(Action.MARK_KEEPER)

QUARTER = 0.25 * math.pi
HOLD_RANGE = 5.0  # [m] a nearer opponent is shielded from
AT_SPOT = 0.3  # [m] the ball lies well for holding
STAYS_SHARE = 0.85  # [1] of the kickable distance, in which the ball must stay
FREEZE_SHARE = 0.8
OVER_POWER = 1.05  # [1] of full power that a pass may lack
OVER_POWER_PRESSED = 1.30  # with an opponent within PRESSED_RANGE of the ball
PRESSED_RANGE = 2.0  # [m]
CLOSE_RANGE = 3.0  # [m] an opponent so near makes a player take the ball at once
FACING = math.radians(25.0)  # [rad] faces its direction of play well enough
AT_REST = 0.01  # [m/cycle] a slower player did not move
MARK_NEAR = 2.0  # [m] at the marking place: stand sideways
MARK_SIDEWAYS = math.radians(80.0)
MARK_LEAD = 1.0  # [m] P: a marked player is expected so far toward the marker's goal


@compiled
def command(c, s, m, f, p, action, target):
    """This cycle's command of player p for a requested action.

    Args:
        action, target: as requested; a keeper that cannot kick goes to the ball instead of
            holding or passing.

    Returns:
        (kind, power, angle); also turns the neck, by the belief `s`, where vision is limited.
    """
    ball = c.num_keepers + c.num_takers
    if s.age[f, p, ball] > c.ball_lost_age:
        return _whole(c, search(c, s, m, f, p))
    if action == _HOLD and s.ball_kickable[f, p]:
        return _whole(c, hold_ball(c, s, f, p, c.hold_distance))
    if action == _PASS and s.ball_kickable[f, p]:
        x, y = s.position[f, p, target]
        return _whole(c, kick_to(c, s, f, p, x, y, c.pass_end_speed))
    if action == _OPEN:
        chosen = _patient(c, s, m, f, p, get_open(c, s, m, f, p))
        _look_at(c, s, f, p, 0.0, 0.0, chosen)
    elif action == _MARK:
        chosen = _patient(c, s, m, f, p, mark_keeper(c, s, f, p, target))
        _look_at(c, s, f, p, s.position[f, p, ball, 0], s.position[f, p, ball, 1], chosen)
    else:
        chosen = _patient(c, s, m, f, p, go_to_ball(c, s, m, f, p))
        _look_at(c, s, f, p, s.position[f, p, ball, 0], s.position[f, p, ball, 1], chosen)
    return _whole(c, chosen)


@compiled
def _patient(c, s, m, f, p, chosen):
    """The chosen command, or a turn to the ball after too many backward dashes in vain.

    S since 17.0.0 takes a backward dash for none; P does not know, and some of its players would
    dash on for ever behind a ball that is held beside them.
    """
    ball = c.num_keepers + c.num_takers
    vx, vy = s.velocity[f, p, p]
    in_vain = chosen[0] == DASH and chosen[1] < 0.0 and length(vx, vy) < AT_REST
    m.vain_dashes[f, p] = m.vain_dashes[f, p] + 1 if in_vain else 0
    if m.vain_dashes[f, p] <= c.patience:
        return chosen
    return turn_body_to(c, s, f, p, s.position[f, p, ball, 0], s.position[f, p, ball, 1], 1)


@compiled
def _whole(c, chosen):
    """Commands are sent as whole numbers (degrees), cut toward zero (P: SoccerTypes.cc)."""
    kind, power, angle = chosen
    if c.whole_commands:
        power = float(int(power))
        angle = math.radians(float(int(math.degrees(angle))))
    return kind, power, angle


@compiled
def _look_at(c, s, f, p, x, y, chosen):
    if c.visible_angle < TWO_PI - 1e-9:
        turn_neck(c, s, f, p, x, y, expected_turn(c, s, f, p, chosen[0], chosen[2]))


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
def closest_opponent_to(c, s, f, p, x, y):
    """(player, distance) of the known opponent nearest to a point; (-1, inf) without one."""
    nearest, best = -1, math.inf
    for j in range(c.num_keepers + c.num_takers):
        if same_team(c, p, j) or s.age[f, p, j] > c.player_lost_age:
            continue
        away = length(s.position[f, p, j, 0] - x, s.position[f, p, j, 1] - y)
        if away < best:
            nearest, best = j, away
    return nearest, best


@compiled
def direction_of_play(c, p):
    """Keepers play toward +x, takers toward -x (the server's left and right team)."""
    return 0.0 if p < c.num_keepers else math.pi


@compiled
def ball_after(c, s, f, p, kind, power, angle):
    """Believed place of the ball after this cycle's own command."""
    ball = c.num_keepers + c.num_takers
    x, y = s.position[f, p, ball]
    vx, vy = s.velocity[f, p, ball]
    if kind == KICK:
        px, py = s.position[f, p, p]
        ax, ay = kick_acceleration(c, power, angle, x - px, y - py, s.body[f, p, p])
        vx, vy = limited(vx + ax, vy + ay, c.ball_speed_max)
    return x + vx, y + vy


@compiled
def hold_ball(c, s, f, p, distance):
    """Keep the ball on the side away from the nearest opponent (P: holdBall).

    Args:
        distance: share of the kickable margin between body and ball.
    """
    ball = c.num_keepers + c.num_takers
    px, py = s.position[f, p, p]
    bx, by = s.position[f, p, ball]
    yaw = s.body[f, p, p]
    opponent, away = closest_opponent_to(c, s, f, p, bx, by)
    angle = 0.0
    if opponent >= 0 and away < HOLD_RANGE:
        ox, oy = s.position[f, p, opponent]
        from_opponent = math.atan2(py - oy, px - ox)
        heads_left = wrap(s.body[f, p, opponent] - from_opponent) > 0.0
        angle = wrap(from_opponent + (-QUARTER if heads_left else QUARTER) - yaw)
    # P compares with the spot at `angle` in field axes, not body axes; kept as it is there.
    spot = length(bx - px - distance * math.cos(angle), by - py - distance * math.sin(angle))
    if spot < AT_SPOT:
        chosen = turn_body_along(c, s, f, p, direction_of_play(c, p))
        next_x, next_y = ball_after(c, s, f, p, NONE, 0.0, 0.0)
        vx, vy = s.velocity[f, p, p]
        stays = length(next_x - px - vx, next_y - py - vy)
        if stays < STAYS_SHARE * c.kickable_distance:
            return chosen
    return kick_close(c, s, f, p, angle, distance)


@compiled
def _rate(c, s, f, p):
    ball = c.num_keepers + c.num_takers
    px, py = s.position[f, p, p]
    bx, by = s.position[f, p, ball]
    return kick_rate(c, bx - px, by - py, s.body[f, p, p])


@compiled
def kick_close(c, s, f, p, angle, distance):
    """Kick the ball to a spot beside the body (P: kickBallCloseToBody).

    Args:
        angle: of the spot, relative to the body [rad].
        distance: share of the kickable margin between body and ball.
    """
    ball = c.num_keepers + c.num_takers
    px, py = s.position[f, p, p]
    ux, uy = s.velocity[f, p, p]
    bx, by = s.position[f, p, ball]
    vx, vy = s.velocity[f, p, ball]
    yaw = s.body[f, p, p]
    reach = c.touch_distance + c.kickable_margin * distance
    want_x = px + ux + reach * math.cos(yaw + angle) - bx - vx
    want_y = py + uy + reach * math.sin(yaw + angle) - by - vy
    power = length(want_x, want_y) / _rate(c, s, f, p)
    if power > 100.0 and length(vx, vy) > 0.1:
        return freeze_ball(c, s, f, p)
    return KICK, min(power, 100.0), wrap(math.atan2(want_y, want_x) - yaw)


@compiled
def freeze_ball(c, s, f, p):
    """Stop the ball where it is, or bring it back within reach (P: freezeBall)."""
    ball = c.num_keepers + c.num_takers
    px, py = s.position[f, p, p]
    ux, uy = s.velocity[f, p, p]
    bx, by = s.position[f, p, ball]
    vx, vy = s.velocity[f, p, ball]
    power = min(length(vx, vy) / _rate(c, s, f, p), 100.0)
    angle = wrap(math.atan2(vy, vx) + math.pi - s.body[f, p, p])
    next_x, next_y = ball_after(c, s, f, p, KICK, power, angle)
    if length(next_x - px - ux, next_y - py - uy) < FREEZE_SHARE * c.kickable_distance:
        return KICK, power, angle
    rel_x, rel_y = bx - px - ux, by - py - uy
    rest = length(rel_x, rel_y)
    reach = min(SAFE_REACH * c.kickable_distance, rest - 0.1)
    direction = math.atan2(rel_y, rel_x)
    to_x = px + ux + reach * math.cos(direction)
    to_y = py + uy + reach * math.sin(direction)
    return accelerate_ball(c, s, f, p, to_x - bx, to_y - by)


SAFE_REACH = 0.7  # [1] of the kickable distance, where a frozen ball is brought back to


@compiled
def accelerate_ball(c, s, f, p, want_x, want_y):
    """Give the ball a velocity, or at least its direction (P: accelerateBallToVelocity)."""
    ball = c.num_keepers + c.num_takers
    vx, vy = s.velocity[f, p, ball]
    yaw = s.body[f, p, p]
    rate = _rate(c, s, f, p)
    ax, ay = want_x - vx, want_y - vy
    size = length(ax, ay)
    if size < c.ball_accel_max and size / rate <= 100.0:
        return KICK, size / rate, wrap(math.atan2(ay, ax) - yaw)
    direction = math.atan2(want_y, want_x)
    across = -math.sin(direction) * vx + math.cos(direction) * vy
    angle = direction - math.asin(clip(across / (100.0 * rate), -1.0, 1.0))
    return KICK, 100.0, wrap(angle - yaw)


@compiled
def rank_of(c, s, f, p, keeper):
    """How many other keepers player p believes closer to itself than `keeper`."""
    own = s.position[f, p, p]
    x, y = s.position[f, p, keeper]
    away = length(x - own[0], y - own[1])
    rank = 0
    for j in range(c.num_keepers):
        if j in (p, keeper):
            continue
        other = length(s.position[f, p, j, 0] - own[0], s.position[f, p, j, 1] - own[1])
        if other < away or (other == away and j < keeper):
            rank += 1
    return rank


@compiled
def keeper_of_rank(c, s, f, p, rank):
    """The keeper that player p believes to be of this rank by distance, 0 the closest."""
    for j in range(c.num_keepers):
        if j != p and rank_of(c, s, f, p, j) == rank:
            return j
    return p


@compiled
def pass_speed(c, distance, end_speed):
    """First speed of a ball that covers `distance` and then has `end_speed` (whole cycles)."""
    growth = 1.0 / c.ball_decay
    steps = math.log(1.0 - distance / end_speed * (1.0 - growth)) / math.log(growth)
    return end_speed * growth ** round(steps)


@compiled
def kick_to(c, s, f, p, x, y, end_speed):
    """Kick the ball so that it passes a point with `end_speed`, set it up first if it must be.

    P: kickTo.
    """
    ball = c.num_keepers + c.num_takers
    px, py = s.position[f, p, p]
    ux, uy = s.velocity[f, p, p]
    bx, by = s.position[f, p, ball]
    vx, vy = s.velocity[f, p, ball]
    direction = math.atan2(y - by, x - bx)
    speed = pass_speed(c, length(x - bx, y - by), end_speed)
    cosine, sine = math.cos(direction), math.sin(direction)
    if length(px + ux - bx - speed * cosine, py + uy - by - speed * sine) < c.touch_distance:
        along = abs(cosine * (px - bx) + sine * (py - by))  # the kick would hit the own body
        speed = along - c.touch_distance if speed < along else along + c.touch_distance
    rate = _rate(c, s, f, p)
    if speed > c.ball_speed_max:
        return _kick_unreachable(c, s, f, p, direction, speed, rate)
    power = length(speed * cosine - vx, speed * sine - vy) / rate
    pressed = closest_opponent_to(c, s, f, p, bx, by)[1] < PRESSED_RANGE
    if power <= 100.0 * (OVER_POWER_PRESSED if pressed else OVER_POWER):
        return accelerate_ball(c, s, f, p, speed * cosine, speed * sine)
    return kick_close(c, s, f, p, 0.0, c.setup_distance)


@compiled
def _kick_unreachable(c, s, f, p, direction, speed, rate):
    """A kick harder than the ball can fly: kick if nearly full speed, else set it up."""
    ball = c.num_keepers + c.num_takers
    vx, vy = s.velocity[f, p, ball]
    across = -math.sin(direction) * vx + math.cos(direction) * vy
    angle = direction - math.asin(clip(across / (100.0 * rate), -1.0, 1.0))
    reached = length(vx + 100.0 * rate * math.cos(angle), vy + 100.0 * rate * math.sin(angle))
    if reached > c.when_to_kick * c.ball_accel_max:
        return accelerate_ball(c, s, f, p, speed * math.cos(direction), speed * math.sin(direction))
    if rate > c.when_to_kick * c.kick_power_rate:
        return freeze_ball(c, s, f, p)
    return kick_close(c, s, f, p, 0.0, c.setup_distance)


@compiled
def get_open(c, s, m, f, p):
    """Move to the least crowded point a pass can reach (P: getOpenForPassFromInRectangle)."""
    from_x, from_y = pass_origin(c, s, f, p)
    x, y = open_point(c, s, m, f, p, from_x, from_y)
    own = s.position[f, p, p]
    if length(x - own[0], y - own[1]) < c.open_buffer:
        ball = c.num_keepers + c.num_takers
        return turn_body_to(c, s, f, p, s.position[f, p, ball, 0], s.position[f, p, ball, 1], 1)
    return move_to(c, s, f, p, x, y, c.when_to_turn, 0.0)


@compiled
def pass_origin(c, s, f, p):
    """Where the ball is believed to be when the fastest team-mate has it."""
    ball = c.num_keepers + c.num_takers
    soonest = NEVER
    for j in range(c.num_keepers + c.num_takers):
        soonest = min(soonest, s.cycles_to_ball[f, p, j])
    roll = c.ball_roll[soonest] if soonest < NEVER else 0.0
    x, y = s.position[f, p, ball]
    vx, vy = s.velocity[f, p, ball]
    return x + roll * vx, y + roll * vy


@compiled
def open_point(c, s, m, f, p, from_x, from_y):
    """The point of a 5 x 5 grid with least congestion and no taker in the lane to it.

    Congestion is the sum over all other players of 1 / distance. The centre if every lane is
    blocked.
    """
    congestion, x, y = m.congestion, m.open_x, m.open_y
    congestion[:] = 0.0
    for j in range(c.num_keepers + c.num_takers):
        if j == p or s.age[f, p, j] > c.player_lost_age:
            continue
        px, py = s.position[f, p, j]
        for k in range(len(congestion)):
            dx, dy = px - x[k], py - y[k]
            congestion[k] += 1.0 / math.sqrt(dx * dx + dy * dy + 1e-18)
    for _ in range(len(congestion)):
        best = 0
        for k in range(1, len(congestion)):
            if congestion[k] < congestion[best]:
                best = k
        if congestion[best] == math.inf:
            break
        if not _lane_blocked(c, s, f, p, from_x, from_y, x[best], y[best]):
            return x[best], y[best]
        congestion[best] = math.inf
    return 0.0, 0.0


@compiled
def _lane_blocked(c, s, f, p, from_x, from_y, x, y):
    for j in range(c.num_keepers + c.num_takers):
        if same_team(c, p, j) or s.age[f, p, j] > c.player_lost_age:
            continue
        ox, oy = s.position[f, p, j]
        if cone_contains(ox, oy, from_x, from_y, x, y, c.cone_width):
            return True
    return False


@compiled
def go_to_ball(c, s, m, f, p):
    """Intercept the ball; a taker that has it holds it, and leaves it to a team-mate that has."""
    ball = c.num_keepers + c.num_takers
    bx, by = s.position[f, p, ball]
    if p >= c.num_keepers:
        if s.ball_kickable[f, p] and nearest_to_ball(c, s, f, p, c.num_keepers, ball) == p:
            return hold_ball(c, s, f, p, c.taker_hold_distance)
        nearest = nearest_to_ball(c, s, f, p, 0, ball)
        if nearest != p and nearest >= c.num_keepers:
            ox, oy = s.position[f, p, nearest]
            if length(ox - bx, oy - by) < c.kickable_distance:
                vx, vy = s.velocity[f, p, ball]
                return turn_body_to(c, s, f, p, bx + vx, by + vy, 1)
    return intercept(c, s, m, f, p)


@compiled
def nearest_to_ball(c, s, f, p, first, last):
    """The known player of first..last-1 believed nearest to the ball; p itself counts always."""
    ball = c.num_keepers + c.num_takers
    nearest, best = -1, math.inf
    for j in range(first, last):
        if j != p and s.age[f, p, j] > c.player_lost_age:
            continue
        dx = s.position[f, p, j, 0] - s.position[f, p, ball, 0]
        dy = s.position[f, p, j, 1] - s.position[f, p, ball, 1]
        away = dx * dx + dy * dy
        if away < best:
            nearest, best = j, away
    return nearest


@compiled
def intercept(c, s, m, f, p):
    """Go where the ball can be met first (P: intercept, predictCommandToInterceptBall)."""
    ball = c.num_keepers + c.num_takers
    x, y = s.position[f, p, p]
    vx, vy = s.velocity[f, p, p]
    ux, uy = math.cos(s.body[f, p, p]), math.sin(s.body[f, p, p])
    now = s.cycle[f]
    has_old = m.intercept_cycle[f, p] >= now - 2
    cycles, to_x, to_y = meeting_cycles(
        c,
        x,
        y,
        vx,
        vy,
        ux,
        uy,
        s.position[f, p, ball],
        s.velocity[f, p, ball],
        m.intercept_point[f, p, 0],
        m.intercept_point[f, p, 1],
        has_old,
    )
    m.intercept_cycle[f, p] = now
    m.intercept_point[f, p, 0], m.intercept_point[f, p, 1] = to_x, to_y
    if cycles < 3:
        close = meet_closely(c, s, f, p)
        if close[0] != NONE:
            return close
    roll = c.player_roll[min(cycles, LOOK_AHEAD)]
    if length(to_x - x - roll * vx, to_y - y - roll * vy) < 0.5:
        return turn_body_along(c, s, f, p, direction_of_play(c, p))
    turns, wx, wy = heading_to_go(c, x, y, vx, vy, ux, uy, to_x, to_y, cycles, c.back_dash_distance)
    if turns:
        angle = math.atan2(ux * wy - uy * wx, ux * wx + uy * wy)
        return TURN, 0.0, turn_moment(c, angle, length(vx, vy))
    return dash_to(c, s, f, p, to_x, to_y, max(cycles, 1))


@compiled
def meet_closely(c, s, f, p):
    """Command for a ball that can be met within two cycles; NONE if nothing helps.

    With an opponent near, a dash brings the ball into reach at once; otherwise the player first
    turns toward its direction of play while the ball comes (P: interceptClose).
    """
    ball = c.num_keepers + c.num_takers
    px, py = s.position[f, p, p]
    vx, vy = s.velocity[f, p, p]
    bx, by = s.position[f, p, ball]
    ux, uy = s.velocity[f, p, ball]
    power, dash_helps = _one_dash(c, s, f, p)
    if dash_helps and closest_opponent_to(c, s, f, p, px, py)[1] < CLOSE_RANGE:
        return DASH, power, 0.0
    forward = direction_of_play(c, p)
    yaw = s.body[f, p, p]
    turn = turn_body_along(c, s, f, p, forward)
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
        kind, stop, _ = dash_to(c, s, f, p, px, py, 1)
        sx = px + vx + c.dash_power_rate * stop * math.cos(yaw)
        sy = py + vy + c.dash_power_rate * stop * math.sin(yaw)
        ball_roll = c.ball_roll[2]
        if length(sx - bx - ball_roll * ux, sy - by - ball_roll * uy) < within:
            return kind, stop, 0.0
    if turn_helps:
        return turn
    if dash_helps:
        return DASH, power, 0.0
    return NONE, 0.0, 0.0


@compiled
def _one_dash(c, s, f, p):
    """(power, helps): the dash after which the ball lies in front of the body and in reach.

    The player's line of movement is cut with a circle around the next place of the ball; of the
    two points the one further in its direction of play is taken, then the other.
    """
    ball = c.num_keepers + c.num_takers
    px, py = s.position[f, p, p]
    vx, vy = s.velocity[f, p, p]
    yaw = s.body[f, p, p]
    cosine, sine = math.cos(yaw), math.sin(yaw)
    bx = s.position[f, p, ball, 0] + s.velocity[f, p, ball, 0]
    by = s.position[f, p, ball, 1] + s.velocity[f, p, ball, 1]
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


@compiled
def mark_keeper(c, s, f, p, keeper):
    """Stand between a keeper and the ball, sideways when there (P: mark, MARK_BALL)."""
    ball = c.num_keepers + c.num_takers
    px, py = s.position[f, p, p]
    kx, ky = s.position[f, p, keeper]
    bx, by = s.position[f, p, ball]
    lead_x = kx + MARK_LEAD
    direction = math.atan2(by - ky, bx - lead_x)
    x = lead_x + c.mark_distance * math.cos(direction)
    y = ky + c.mark_distance * math.sin(direction)
    if length(x - px, y - py) >= MARK_NEAR:
        return move_to(c, s, f, p, x, y, c.mark_turn_angle, c.mark_back_distance)
    to_keeper = math.atan2(ky - py, kx - px)
    to_ball = math.atan2(by - py, bx - px)
    left = wrap(to_ball - to_keeper) >= 0.0
    return turn_body_along(c, s, f, p, to_keeper + (MARK_SIDEWAYS if left else -MARK_SIDEWAYS))
