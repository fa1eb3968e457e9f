"""Who reaches the ball first, as one player believes (P: createInterceptFeatures)."""

from __future__ import annotations

import math

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import NEVER
from keepaway_sim.world.skills.prediction import (
    UNKNOWN_SPEED,
    Body,
    ball_ahead,
    ball_of,
    body_of,
    cycles_to_point,
    reach_ball,
)

LATELY = 3  # [cycles] P: motion seen longer ago is unknown
UNSEEN_LEAD = 2  # [cycles] P: the start of an opponent who has not been seen moving lately


@compiled
def as_last_seen(w, f, p, j):
    """Player j as player p saw it last, and how many cycles it has had since then.

    P predictNrCyclesToPoint: a player who may be first at the ball is taken to have run for it ever
    since; who has not been seen moving lately runs straight, and an opponent has a start.
    """
    if j == p:
        return body_of(w, f, p, p), 0
    memory, now = w.memory, w.belief.cycle[f]
    x, y, vx, vy = memory.seen[f, p, j]
    lead = now - memory.motion_cycle[f, p, j]
    moves = lead <= LATELY
    if not moves:
        keeps, seeks = p < w.constants.num_keepers, j >= w.constants.num_keepers
        lead = UNSEEN_LEAD if keeps == seeks else 0
    lead = min(lead, now - memory.seen_cycle[f, p, j])
    if not moves:
        return Body(x, y, UNKNOWN_SPEED, 0.0, 0.0, 0.0), lead
    yaw = w.belief.body[f, p, j]
    return Body(x, y, vx, vy, math.cos(yaw), math.sin(yaw)), lead


@compiled
def fastest_to_ball(w, f, p, first, last, ball, limit):
    """Which known player of first..last-1 reaches a ball first, in player p's belief.

    Args:
        ball: Ball.
        limit: the last cycle from now that is looked at.

    Returns:
        the player (-1: nobody), how many cycles from now it meets the ball, how many it needs.
    """
    c, belief = w.constants, w.belief
    fastest, when, needed = -1, limit + 1, NEVER
    for j in range(first, last):
        if j != p and belief.age[f, p, j] > c.player_lost_age:
            continue
        body, lead = as_last_seen(w, f, p, j)
        i, cycles = reach_ball(c, body, lead, ball, min(when, limit))
        if i < when or (i == when and cycles < needed):
            fastest, when, needed = j, i, cycles
    return fastest, when, needed


@compiled
def fastest_to_point(w, f, p, first, last, x, y):
    """(player, cycles) of the known player of first..last-1 who is soonest at a point."""
    c, belief = w.constants, w.belief
    fastest, needed = -1, NEVER
    for j in range(first, last):
        if j != p and belief.age[f, p, j] > c.player_lost_age:
            continue
        body, lead = as_last_seen(w, f, p, j)
        cycles = max(cycles_to_point(c, body, x, y) - lead, 0)
        if cycles < needed:
            fastest, needed = j, cycles
    return fastest, needed


@compiled
def fastest_keeper(w, f, p):
    """The keeper who reaches the ball first, as player p believes, and the cycles it needs.

    P: where a taker is sooner at the ball, keepers ask who of them is soonest at that place.
    Takers only ask who of the keepers is first. (-1, NEVER) where nobody is known.
    """
    c, n = w.constants, w.constants.num_keepers
    ball = ball_of(w, f, p)
    keeper, when, needed = fastest_to_ball(w, f, p, 0, n, ball, 2 * c.intercept_horizon - 1)
    if p < n:
        taker, sooner, _ = fastest_to_ball(w, f, p, n, w.num_players, ball, when - 1)
        if taker >= 0:
            x, y = ball_ahead(c, ball, sooner)
            return fastest_to_point(w, f, p, 0, n, x, y)
    return keeper, needed
