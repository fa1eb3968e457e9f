"""A requested high-level action becomes this cycle's dash, turn or kick.

Every skill reads the acting player's own belief and memory only, never the truth. Of a `Command`
a dash uses the power, a turn the angle (the moment to send), a kick both (angle relative to the
body).

Source: P BasicPlayer.cc and KeepawayPlayer.cc. Simplified: `meet_closely` leaves out colliding
with the ball on purpose.
"""

from __future__ import annotations

import math

import numpy as np

from keepaway_sim.task import Action
from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import NEVER
from keepaway_sim.world.constants import NUM_OPEN, OPEN_LANES
from keepaway_sim.world.geometry import TWO_PI, cone_contains, length, wrap
from keepaway_sim.world.phantoms import age_of, num_opponents, opponent, place_of
from keepaway_sim.world.sight import turn_neck
from keepaway_sim.world.skills.kicking import hold_ball, kick_to
from keepaway_sim.world.skills.meeting import intercept
from keepaway_sim.world.skills.running import (
    expected_turn,
    move_to,
    place_after,
    search,
    turn_body_along,
    turn_body_to,
)
from keepaway_sim.world.state import DASH, Command
from keepaway_sim.world.trigonometry import bearing, unit

_HOLD = int(Action.HOLD_BALL)
_PASS = int(Action.PASS_BALL)
_OPEN = int(Action.GET_OPEN)
_MARK = int(Action.MARK_KEEPER)

ONE, INFINITE = np.float32(1.0), np.float32(math.inf)
NO_DISTANCE = np.float32(1e-18)  # [m^2] keeps a player on a point from an infinite congestion
AT_REST = 0.01  # [m/cycle] a slower player did not move
MARK_NEAR = 2.0  # [m] at the marking place: stand sideways
MARK_SIDEWAYS = math.radians(80.0)
MARK_LEAD = 1.0  # [m] P: a marked player is expected so far toward the marker's goal


@compiled
def command(w, f, p, action, target):
    """This cycle's command of player p for a requested action; also turns its neck.

    Who has the ball leaves its neck as it is (P: KeepawayPlayer.cc).

    Args:
        action, target: as requested; a keeper that cannot kick goes to the ball instead of
            holding or passing.

    Returns:
        Command.
    """
    c, belief = w.constants, w.belief
    ball = w.ball
    if belief.age[f, p, ball] > c.ball_lost_age:
        return _whole(c, search(w, f, p))
    if action == _HOLD and belief.ball_kickable[f, p]:
        return _whole(c, hold_ball(w, f, p, c.hold_distance))
    if action == _PASS and belief.ball_kickable[f, p]:
        x, y = belief.position[f, p, target]
        return _whole(c, kick_to(w, f, p, x, y, c.pass_end_speed))
    if action == _OPEN:
        chosen = _patient(w, f, p, get_open(w, f, p))
        _look_at(w, f, p, 0.0, 0.0, chosen)
    elif action == _MARK:
        chosen = _patient(w, f, p, mark_keeper(w, f, p, target))
        _look_at_ball(w, f, p, chosen)
    elif p >= c.num_keepers and _has_ball(w, f, p):
        chosen = _patient(w, f, p, hold_ball(w, f, p, c.taker_hold_distance))
    elif p >= c.num_keepers and _mate_has_ball(w, f, p):
        chosen = _patient(w, f, p, watch_ball(w, f, p))
        belief.neck[f, p] = 0.0
    else:
        chosen = _patient(w, f, p, intercept(w, f, p))
        _look_at_ball(w, f, p, chosen)
    return _whole(c, chosen)


@compiled
def _patient(w, f, p, chosen):
    """The chosen command, or a turn to the ball after too many backward dashes in vain.

    S since 17.0.0 takes a backward dash for none; P does not know, and some of its players would
    dash on for ever behind a ball that is held beside them.
    """
    c, belief, memory = w.constants, w.belief, w.memory
    ball = w.ball
    vx, vy = belief.velocity[f, p, p]
    in_vain = chosen.kind == DASH and chosen.power < 0.0 and length(vx, vy) < AT_REST
    memory.vain_dashes[f, p] = memory.vain_dashes[f, p] + 1 if in_vain else 0
    if memory.vain_dashes[f, p] <= c.patience:
        return chosen
    return turn_body_to(w, f, p, belief.position[f, p, ball, 0], belief.position[f, p, ball, 1], 1)


@compiled
def _whole(c, chosen):
    """Commands are sent as whole numbers (degrees), cut toward zero (P: SoccerTypes.cc)."""
    kind, power, angle = chosen
    if c.whole_commands:
        power = float(int(power))
        angle = math.radians(float(int(math.degrees(angle))))
    return Command(kind, power, angle)


@compiled
def _look_at(w, f, p, x, y, chosen):
    """Where vision is limited, look at a point from where player p will be after a command."""
    c, own = w.constants, w.belief.position[f, p, p]
    if c.visible_angle < TWO_PI - 1e-9:
        next_x, next_y = place_after(w, f, p, chosen)
        x, y = x + own[0] - next_x, y + own[1] - next_y
        turn_neck(w, f, p, x, y, expected_turn(w, f, p, chosen))


@compiled
def _look_at_ball(w, f, p, chosen):
    """Where vision is limited, look at where the ball will be (P: turnNeckToObject)."""
    x, y = w.belief.position[f, p, w.ball]
    vx, vy = w.belief.velocity[f, p, w.ball]
    _look_at(w, f, p, x + vx, y + vy, chosen)


@compiled
def rank_of(w, f, p, keeper):
    """How many other keepers player p believes closer to itself than `keeper`."""
    c, belief = w.constants, w.belief
    own = belief.position[f, p, p]
    x, y = belief.position[f, p, keeper]
    away = length(x - own[0], y - own[1])
    rank = 0
    for j in range(c.num_keepers):
        if j in (p, keeper):
            continue
        other = length(belief.position[f, p, j, 0] - own[0], belief.position[f, p, j, 1] - own[1])
        if other < away or (other == away and j < keeper):
            rank += 1
    return rank


@compiled
def keeper_of_rank(w, f, p, rank):
    """The keeper that player p believes to be of this rank by distance, 0 the closest."""
    c = w.constants
    for j in range(c.num_keepers):
        if j != p and rank_of(w, f, p, j) == rank:
            return j
    return p


@compiled
def get_open(w, f, p):
    """Move to the least crowded point a pass can reach (P: getOpenForPassFromInRectangle)."""
    c, belief = w.constants, w.belief
    from_x, from_y = pass_origin(w, f, p)
    x, y = open_point(w, f, p, from_x, from_y)
    own = belief.position[f, p, p]
    if length(x - own[0], y - own[1]) < c.open_buffer:
        ball = w.ball
        return turn_body_to(
            w, f, p, belief.position[f, p, ball, 0], belief.position[f, p, ball, 1], 1
        )
    return move_to(w, f, p, x, y, c.when_to_turn, 0.0)


@compiled
def pass_origin(w, f, p):
    """Where the ball is believed to be when the fastest team-mate has it."""
    c, belief = w.constants, w.belief
    ball = w.ball
    soonest = NEVER
    for j in range(c.num_keepers):
        soonest = min(soonest, belief.cycles_to_ball[f, p, j])
    roll = c.ball_roll[soonest] if soonest < NEVER else 0.0
    x, y = belief.position[f, p, ball]
    vx, vy = belief.velocity[f, p, ball]
    return x + roll * vx, y + roll * vy


@compiled
def open_point(w, f, p, from_x, from_y):
    """The point of a 5 x 5 grid with least congestion and no taker in the lane to it.

    Congestion is the sum over all other players of 1 / distance. The centre if every lane is
    blocked. See docs/vector_code.md.
    """
    c, congestion = w.constants, w.scratch.congestion
    congestion[:] = 0.0
    for j in range(w.ball + 1 + c.phantom_slots):
        if j not in (p, w.ball) and age_of(w, f, p, j) <= c.player_lost_age:
            _add_congestion(c, place_of(w, f, p, j), congestion)
    for k in range(num_opponents(w, p)):
        j = opponent(w, p, k)
        if age_of(w, f, p, j) <= c.player_lost_age:
            _block_lanes(c, place_of(w, f, p, j), from_x, from_y, congestion)
    best = 0
    for k in range(1, NUM_OPEN):
        if congestion[k] < congestion[best]:
            best = k
    if congestion[best] == math.inf:
        return 0.0, 0.0
    return c.open_x[best], c.open_y[best]


@compiled
def _add_congestion(c, place, congestion):
    """Add 1 / distance of a player to every point, in single precision."""
    x, y = np.float32(place[0]), np.float32(place[1])
    for k in range(OPEN_LANES):
        dx, dy = x - c.open_x[k], y - c.open_y[k]
        congestion[k] += ONE / math.sqrt(dx * dx + dy * dy + NO_DISTANCE)


@compiled
def _block_lanes(c, place, from_x, from_y, congestion):
    """No point is worth going to if a taker stands in the lane to it."""
    x, y = np.float32(place[0]), np.float32(place[1])
    from_x, from_y, width = np.float32(from_x), np.float32(from_y), np.float32(c.cone_width)
    for k in range(OPEN_LANES):
        blocked = cone_contains(x, y, from_x, from_y, c.open_x[k], c.open_y[k], width)
        congestion[k] = INFINITE if blocked else congestion[k]


@compiled
def _has_ball(w, f, p):
    """Can a taker kick the ball, and is no other taker nearer to it? Then it holds it."""
    first, ball = w.constants.num_keepers, w.ball
    return w.belief.ball_kickable[f, p] and nearest_to_ball(w, f, p, first, ball) == p


@compiled
def _mate_has_ball(w, f, p):
    """Has another taker the ball? Then it is left to it."""
    c, ball = w.constants, w.ball
    nearest = nearest_to_ball(w, f, p, 0, ball + 1 + c.phantom_slots)
    if nearest == p or not c.num_keepers <= nearest < ball:
        return False
    x, y = w.belief.position[f, p, nearest]
    bx, by = w.belief.position[f, p, ball]
    return length(x - bx, y - by) < c.kickable_distance


@compiled
def watch_ball(w, f, p):
    """Turn to where the ball will be."""
    bx, by = w.belief.position[f, p, w.ball]
    vx, vy = w.belief.velocity[f, p, w.ball]
    return turn_body_to(w, f, p, bx + vx, by + vy, 1)


@compiled
def nearest_to_ball(w, f, p, first, last):
    """Whom of first..last-1 player p knows and believes nearest to the ball; itself it knows."""
    bx, by = w.belief.position[f, p, w.ball]
    nearest, best = -1, math.inf
    for j in range(first, last):
        if j == w.ball or (j != p and age_of(w, f, p, j) > w.constants.player_lost_age):
            continue
        x, y = place_of(w, f, p, j)
        dx, dy = x - bx, y - by
        away = dx * dx + dy * dy
        if away < best:
            nearest, best = j, away
    return nearest


@compiled
def mark_keeper(w, f, p, keeper):
    """Stand between a keeper and the ball, sideways when there (P: mark, MARK_BALL)."""
    c, belief = w.constants, w.belief
    ball = w.ball
    px, py = belief.position[f, p, p]
    kx, ky = belief.position[f, p, keeper]
    bx, by = belief.position[f, p, ball]
    lead_x = kx + MARK_LEAD
    ux, uy = unit(bearing(bx - lead_x, by - ky))
    x, y = lead_x + c.mark_distance * ux, ky + c.mark_distance * uy
    if length(x - px, y - py) >= MARK_NEAR:
        return move_to(w, f, p, x, y, c.mark_turn_angle, c.mark_back_distance)
    to_keeper = bearing(kx - px, ky - py)
    to_ball = bearing(bx - px, by - py)
    left = wrap(to_ball - to_keeper) >= 0.0
    return turn_body_along(w, f, p, to_keeper + (MARK_SIDEWAYS if left else -MARK_SIDEWAYS))
