"""Who reaches the ball first, as one player believes (P: createInterceptFeatures)."""

from __future__ import annotations

import math
from typing import NamedTuple

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import NEVER
from keepaway_sim.world.geometry import length
from keepaway_sim.world.phantoms import age_of, num_opponents, opponent
from keepaway_sim.world.skills.prediction import (
    UNKNOWN_SPEED,
    Ball,
    Body,
    ball_ahead,
    ball_of,
    cycles_to_point,
    reach_ball,
    straight_distance,
    straight_run,
)
from keepaway_sim.world.trigonometry import unit

LATELY = 3  # [cycles] P: motion seen longer ago is unknown
SOON = 4  # [cycles] the player nearest to the ball's place then is searched first
UNSEEN_LEAD = 2  # [cycles] P: the start of an opponent not seen moving lately


@compiled
def as_last_seen(w, f, p, j):
    """Player j as player p saw it last, and how many cycles it has had since then.

    P predictNrCyclesToPoint: a player who may be first at the ball is taken to have run for it ever
    since; a player not seen moving lately runs straight, and an opponent has a start.
    """
    body, lead, faces = _last_place(w, f, p, j)
    return _with_heading(w, f, p, j, body, faces), lead


@compiled
def _last_place(w, f, p, j):
    """`as_last_seen` without the heading, and whether player p knows that."""
    belief, memory, now = w.belief, w.memory, w.belief.cycle[f]
    if j == p:
        x, y = belief.position[f, p, p]
        vx, vy = belief.velocity[f, p, p]
        return Body(x, y, vx, vy, 0.0, 0.0), 0, True
    x, y, vx, vy = memory.seen[f, p, j]
    lead = now - memory.motion_cycle[f, p, j]
    moves = lead <= LATELY
    if not moves:
        keeps, seeks = p < w.constants.num_keepers, j >= w.constants.num_keepers
        lead = UNSEEN_LEAD if keeps == seeks else 0
        vx, vy = UNKNOWN_SPEED, 0.0
    lead = min(lead, now - memory.seen_cycle[f, p, j])
    return Body(x, y, vx, vy, 0.0, 0.0), lead, moves


@compiled
def _with_heading(w, f, p, j, body, faces):
    """The Body with player j's heading; apart, for a sine costs as much as ruling a player out."""
    if not faces:
        return body
    x, y, vx, vy, _, _ = body
    ux, uy = unit(w.belief.body[f, p, j])
    return Body(x, y, vx, vy, ux, uy)


@compiled
def _is_known(w, f, p, j):
    return j == p or w.belief.age[f, p, j] <= w.constants.player_lost_age


@compiled
def _nearest(w, f, p, first, last, x, y):
    """Which known player of first..last-1 was last seen nearest to a point; -1: none is known."""
    nearest, best = -1, math.inf
    for j in range(first, last):
        if _is_known(w, f, p, j):
            body, _, _ = _last_place(w, f, p, j)
            away = (body.x - x) * (body.x - x) + (body.y - y) * (body.y - y)
            if away < best:
                nearest, best = j, away
    return nearest


@compiled
def fastest_to_ball(w, f, p, first, last, ball, limit):
    """Which known player of first..last-1 reaches a ball first, in player p's belief.

    The nearest player is searched first: most others are then ruled out without a search.

    Args:
        ball: Ball.
        limit: the last cycle from now that is looked at.

    Returns:
        the player (-1: none), how many cycles from now it meets the ball, how many it needs.
        Of two who arrive in the same cycle the faster needs fewer cycles, then has the lower index.
    """
    c = w.constants
    fastest, when, needed = -1, limit + 1, NEVER
    near = -1
    if limit >= 0:
        x, y = ball_ahead(c, ball, min(SOON, limit))
        near = _nearest(w, f, p, first, last, x, y)
    for k in range(first - 1, last if near >= 0 else first - 1):
        j = near if k < first else k
        if k == near or not _is_known(w, f, p, j):
            continue
        body, lead, faces = _last_place(w, f, p, j)
        until = min(when, limit)
        start = straight_run(c, body, lead, ball, until)
        if start > until:
            continue
        body = _with_heading(w, f, p, j, body, faces)
        i, cycles = reach_ball(c, body, lead, ball, start, until)
        if i < when or (i == when and (cycles < needed or (cycles == needed and j < fastest))):
            fastest, when, needed = j, i, cycles
    return fastest, when, needed


@compiled
def _first_opponent(w, f, p, ball, limit):
    """`fastest_to_ball` among all of player p's opponents, its phantoms among them."""
    c, phantoms = w.constants, w.phantoms
    first, last = _opponents(w, p)
    fastest, when, needed = fastest_to_ball(w, f, p, first, last, ball, limit)
    for s in range(c.phantom_slots):
        if phantoms.age[f, p, s] > c.player_lost_age:
            continue
        x, y = phantoms.felt[f, p, s]
        body = Body(x, y, UNKNOWN_SPEED, 0.0, 0.0, 0.0)
        lead = min(UNSEEN_LEAD, w.belief.cycle[f] - phantoms.felt_cycle[f, p, s])
        until = min(when, limit)
        start = straight_run(c, body, lead, ball, until)
        if start > until:
            continue
        i, cycles = reach_ball(c, body, lead, ball, start, until)
        if i < when or (i == when and cycles < needed):
            fastest, when, needed = w.ball + 1 + s, i, cycles
    return fastest, when, needed


@compiled
def fastest_to_point(w, f, p, first, last, x, y):
    """(player, cycles) of the known player of first..last-1 who is soonest at a point.

    Of players who are equally soon the one with the lowest index.
    """
    c = w.constants
    fastest, needed = -1, NEVER
    near = _nearest(w, f, p, first, last, x, y)
    for k in range(first - 1, last if near >= 0 else first - 1):
        j = near if k < first else k
        if k == near or not _is_known(w, f, p, j):
            continue
        body, lead, faces = _last_place(w, f, p, j)
        if straight_distance(c, body, needed + lead) < length(x - body.x, y - body.y):
            continue
        body = _with_heading(w, f, p, j, body, faces)
        cycles = max(cycles_to_point(c, body, x, y) - lead, 0)
        if cycles < needed or (cycles == needed and j < fastest):
            fastest, needed = j, cycles
    return fastest, needed


class Chase(NamedTuple):
    """Which opponent reaches the ball first, as a player worked it out, and from what."""

    player: int  # -1: none
    when: int  # [cycles] from now it meets the ball
    needed: int  # [cycles] it needs to there
    ball: Ball
    num_known: int  # how many opponents were known; -1: this was not worked out


@compiled
def fastest_opponent(w, f, p):
    """The Chase of player p's opponents."""
    ball = ball_of(w, f, p)
    player, when, needed = _first_opponent(w, f, p, ball, _horizon(w))
    return Chase(player, when, needed, ball, _num_known(w, f, p))


@compiled
def nobody_asked():
    """The Chase that was not worked out."""
    return Chase(-1, NEVER, NEVER, Ball(0.0, 0.0, 0.0, 0.0), -1)


@compiled
def fastest_keeper(w, f, p, chase):
    """The keeper who reaches the ball first, as player p believes, and the cycles it needs.

    P: where a taker is sooner at the ball, keepers ask who of them is soonest at that place.
    Takers only ask who of the keepers is first. (-1, NEVER) where none is known, or where it is
    a phantom, which no perception can name.

    Args:
        chase: Chase of this cycle; it is used if neither what is believed of the ball nor who is
            known has changed since, and nothing was seen.
    """
    n, ball = w.constants.num_keepers, ball_of(w, f, p)
    rival, sooner, its_cycles = chase.player, chase.when, chase.needed
    holds = chase.num_known == _num_known(w, f, p) and chase.ball == ball
    keeper, when, needed = -1, _horizon(w) + 1, NEVER
    if p < n:
        limit = sooner if holds and rival >= 0 else _horizon(w)
        keeper, when, needed = fastest_to_ball(w, f, p, 0, n, ball, limit)
    if not holds:
        rival, sooner, its_cycles = _first_opponent(w, f, p, ball, when - 1)
    if p >= n:
        return (rival, its_cycles) if rival < n else (-1, NEVER)
    if rival >= 0 and sooner < when:
        x, y = ball_ahead(w.constants, ball, sooner)
        return fastest_to_point(w, f, p, 0, n, x, y)
    return keeper, needed


@compiled
def _opponents(w, p):
    """First and one past the last of player p's opponents."""
    n = w.constants.num_keepers
    return (n, w.num_players) if p < n else (0, n)


@compiled
def _horizon(w):
    """The last cycle from now in which a player is searched for at the ball."""
    return 2 * w.constants.intercept_horizon - 1


@compiled
def _num_known(w, f, p):
    """How many opponents player p knows, phantoms among them."""
    count = 0
    for k in range(num_opponents(w, p)):
        if age_of(w, f, p, opponent(w, p, k)) <= w.constants.player_lost_age:
            count += 1
    return count
