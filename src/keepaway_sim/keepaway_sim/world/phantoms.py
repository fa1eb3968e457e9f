"""Opponents in whom a player with a limited view believes, though the match has no such number.

P has eleven opponents' slots whatever the match. A felt player that can be no known one is put into
the first empty one (P WorldModelUpdate.cc: mapUnknownPlayers), so it may get a number that no
opponent has, and then counts as an opponent until it is forgotten. Such a phantom has no name,
body direction or velocity. Its index follows the ball's. With a view all round no player is only
felt, and there are no slots for phantoms.
"""

from __future__ import annotations

import math

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.config import NEVER
from keepaway_sim.world.constants import OPPONENT_SLOTS

SAME_PLAYER = 7.5  # [m] P: a felt player this near to an expected one may be that one
UNKNOWN_BODY = math.radians(80.0)  # P: -1000 degrees stands for an unknown body direction


@compiled
def num_opponents(w, p):
    """How many opponents player p has room for: those of the match, then phantoms."""
    c = w.constants
    real = c.num_takers if p < c.num_keepers else c.num_keepers
    return min(real + c.phantom_slots, max(real, OPPONENT_SLOTS))


@compiled
def opponent(w, p, k):
    """The index of player p's k-th opponent; those of the match come first."""
    c = w.constants
    first, real = (c.num_keepers, c.num_takers) if p < c.num_keepers else (0, c.num_keepers)
    return first + k if k < real else w.ball + 1 + k - real


@compiled
def age_of(w, f, p, j):
    """How long ago player p perceived j, an object or a phantom [cycles]."""
    return w.belief.age[f, p, j] if j <= w.ball else w.phantoms.age[f, p, j - w.ball - 1]


@compiled
def place_of(w, f, p, j):
    """Where player p believes j, an object or a phantom [m]."""
    if j <= w.ball:
        return w.belief.position[f, p, j, 0], w.belief.position[f, p, j, 1]
    s = j - w.ball - 1
    return w.phantoms.position[f, p, s, 0], w.phantoms.position[f, p, s, 1]


@compiled
def yaw_of(w, f, p, j):
    """Player p's idea of the body direction of j, a player or a phantom [rad]."""
    return w.belief.body[f, p, j] if j < w.ball else unknown_yaw(w, p)


@compiled
def unknown_yaw(w, p):
    """What player p takes for the body direction of a player of whom it knows none [rad]."""
    return UNKNOWN_BODY if p < w.constants.num_keepers else UNKNOWN_BODY - math.pi


@compiled
def put(w, f, p, j, x, y):
    """Player p now believes j, an object or a phantom, at (x, y)."""
    if j <= w.ball:
        w.belief.position[f, p, j, 0], w.belief.position[f, p, j, 1] = x, y
    else:
        s = j - w.ball - 1
        w.phantoms.position[f, p, s, 0], w.phantoms.position[f, p, s, 1] = x, y


@compiled
def set_age(w, f, p, j, age):
    """Player p perceived j, an object or a phantom, N cycles ago."""
    if j <= w.ball:
        w.belief.age[f, p, j] = age
    else:
        w.phantoms.age[f, p, j - w.ball - 1] = age


@compiled
def feel(w, f, p, j, x, y):
    """Player p feels a player at (x, y) and takes it for j, a player or a phantom."""
    belief, memory, phantoms = w.belief, w.memory, w.phantoms
    put(w, f, p, j, x, y)
    set_age(w, f, p, j, 0)
    if j > w.ball:
        s = j - w.ball - 1
        phantoms.felt[f, p, s, 0], phantoms.felt[f, p, s, 1] = x, y
        phantoms.felt_cycle[f, p, s] = belief.cycle[f]
        return
    belief.velocity[f, p, j, 0], belief.velocity[f, p, j, 1] = 0.0, 0.0
    belief.body[f, p, j] = unknown_yaw(w, p)
    memory.seen[f, p, j, 0], memory.seen[f, p, j, 1] = x, y
    memory.seen_cycle[f, p, j] = belief.cycle[f]
    memory.motion_cycle[f, p, j] = -NEVER
    memory.nameless[f, p, j] = True


@compiled
def farthest(w, f, p, j):
    """How far j may have run since it was perceived (P: getMaxTraveledDistance) [m]."""
    return age_of(w, f, p, j) * w.constants.player_speed_max


@compiled
def grow_old(w, f, p):
    """A cycle has passed since player p perceived anybody."""
    for j in range(w.ball + 1 + w.constants.phantom_slots):
        age = age_of(w, f, p, j)
        if age < NEVER:
            set_age(w, f, p, j, age + 1)
