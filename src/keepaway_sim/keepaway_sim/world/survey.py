"""What the server measures for every player of a field who looks (S visualsenderplayer.cpp).

All pairs of a player and an object are measured together, in short loops over rows of numbers and
without a branch, so that one instruction serves several pairs: see docs/vector_code.md.
"""

from __future__ import annotations

import math

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.geometry import TWO_PI
from keepaway_sim.world.state import SIGHT_LANES
from keepaway_sim.world.trigonometry import bearing

DIRECTION_CHANGE_STEP = math.radians(0.1)  # [rad/cycle] S: direction change is rounded to it
NEAREST = 1e-6  # [m] nothing is nearer: without a distance there is no direction
_TO_WHOLE = 1.5 * 2.0**52  # beside it a double has no room for a fraction


@compiled
def looks_now(w, f, p):
    """Does player p see something new in this cycle of its field's life?"""
    period, moment = w.constants.look_period, w.truth.time[f] + w.memory.look_phase[f, p]
    return period == 1 or moment % period != period - 1


@compiled
def survey(w, f):
    """Measure whatever may be seen by the players of field f who look now, into `w.sights`.

    Player p's pair with object o is number `first[p] + o`; its pair with itself means nothing.
    """
    num_pairs = _gather(w, f)
    rows = (num_pairs + SIGHT_LANES - 1) // SIGHT_LANES * SIGHT_LANES
    _measure_distance(w.sights, rows)
    _measure_direction(w.sights, rows, w.constants.direction_step)
    _measure_motion(w.sights, rows, w.constants.change_step)


@compiled
def _gather(w, f):
    """Each pair's relative position and velocity, and where its player faces; how many pairs."""
    position, velocity, yaw = w.truth.position[f], w.truth.velocity[f], w.truth.yaw[f]
    sights, k = w.sights, 0
    for p in range(w.num_players):
        if not looks_now(w, f, p):
            continue
        sights.first[p] = k
        x, y = position[p, 0], position[p, 1]
        vx, vy = velocity[p, 0], velocity[p, 1]
        face = yaw[p] + w.belief.neck[f, p]
        for o in range(w.ball + 1):
            sights.dx[k], sights.dy[k] = position[o, 0] - x, position[o, 1] - y
            sights.radial[k], sights.turning[k] = velocity[o, 0] - vx, velocity[o, 1] - vy
            sights.direction[k] = face
            k += 1
    return k


@compiled
def _measure_distance(sights, rows):
    """From relative positions: distances, and unit vectors in their place."""
    dx, dy, distance = sights.dx, sights.dy, sights.distance
    for k in range(rows):
        away = math.sqrt(dx[k] * dx[k] + dy[k] * dy[k])
        away = away if away > NEAREST else NEAREST
        distance[k] = away
        dx[k] = dx[k] / away
        dy[k] = dy[k] / away


@compiled
def _measure_direction(sights, rows, step):
    """From unit vectors and where the player faces, which the direction replaces."""
    dx, dy, direction, steps = sights.dx, sights.dy, sights.direction, sights.steps
    step = step if step > 0.0 else 1.0
    for k in range(rows):
        angle = bearing(dx[k], dy[k]) - direction[k]
        angle = angle - TWO_PI * whole(angle / TWO_PI)
        direction[k] = angle
        steps[k] = whole(angle / step)


@compiled
def _measure_motion(sights, rows, step):
    """From relative velocities, in their place: how distance and direction change.

    A loop reads and writes few rows: before it runs, it must find that they do not overlap.
    """
    dx, dy, distance = sights.dx, sights.dy, sights.distance
    radial, turning = sights.radial, sights.turning
    for k in range(rows):
        vx, vy = radial[k], turning[k]
        radial[k] = (vx * dx[k] + vy * dy[k]) / distance[k]
        turning[k] = (dx[k] * vy - dy[k] * vx) / distance[k]
    if step > 0.0:
        for k in range(rows):
            radial[k] = whole(radial[k] / step) * step
            turning[k] = whole(turning[k] / DIRECTION_CHANGE_STEP) * DIRECTION_CHANGE_STEP


@compiled
def whole(value):
    """`round` for a loop of many lanes: the nearest whole number, the even one of two.

    |value| must be less than 2**51.
    """
    return (value + _TO_WHOLE) - _TO_WHOLE
