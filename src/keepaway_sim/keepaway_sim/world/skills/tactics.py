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
from keepaway_sim.world.geometry import TWO_PI, cone_contains, length, wrap
from keepaway_sim.world.memory import same_team
from keepaway_sim.world.sight import turn_neck
from keepaway_sim.world.skills.kicking import hold_ball, kick_to
from keepaway_sim.world.skills.meeting import intercept
from keepaway_sim.world.skills.running import (
    expected_turn,
    move_to,
    search,
    turn_body_along,
    turn_body_to,
)
from keepaway_sim.world.state import DASH

_HOLD = int(Action.HOLD_BALL)
_PASS = int(Action.PASS_BALL)
_OPEN = int(Action.GET_OPEN)
_MARK = int(Action.MARK_KEEPER)

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
