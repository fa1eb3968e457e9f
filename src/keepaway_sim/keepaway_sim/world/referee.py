"""The keepaway referee: where an episode starts and why it ends (S: referee.cpp `KeepawayRef`)."""

from __future__ import annotations

from keepaway_sim.task import Outcome
from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.geometry import length
from keepaway_sim.world.physics import on_grid
from keepaway_sim.world.streams import draw

TAKE_CYCLES = 4  # the ball is taken in the cycle after this number with a taker near
CORNER_JITTER = 3.0  # [m] players start up to so far inward from their corner
BALL_INSET = 4.0  # [m] the ball starts so far inward from the corner (-x, -y)

_IN_PLAY = int(Outcome.IN_PLAY)
_TAKEN_AWAY = int(Outcome.TAKEN_AWAY)
_OUT_OF_BOUNDS = int(Outcome.OUT_OF_BOUNDS)


@compiled
def kick_off(w, f):
    """Put players and ball of field f on their starting places.

    A random cyclic offset decides which keeper stands where: three corners, the rest near the
    centre. The takers share the corner (-x, +y). Body directions are kept, as in the server.
    """
    c, position = w.constants, w.truth.position[f]
    half_x, half_y = c.field_length / 2.0, c.field_width / 2.0
    offset = int(draw(w.random, f) * c.num_keepers)
    for k in range(c.num_keepers):
        slot = (k + offset) % c.num_keepers
        u, v = draw(w.random, f), draw(w.random, f)
        if slot < 3:
            side_x = -1.0 if slot == 0 else 1.0
            side_y = 1.0 if slot == 2 else -1.0
            x = side_x * (half_x - CORNER_JITTER * u)
            y = side_y * (half_y - CORNER_JITTER * v)
        else:
            x, y = 2.0 * u - 1.0, 2.0 * v - 1.0
        position[k, 0], position[k, 1] = on_grid(x), on_grid(y)
    for t in range(c.num_keepers, w.num_players):
        u, v = draw(w.random, f), draw(w.random, f)
        position[t, 0] = on_grid(-half_x + CORNER_JITTER * u)
        position[t, 1] = on_grid(half_y - CORNER_JITTER * v)
    position[w.ball, 0] = -half_x + BALL_INSET
    position[w.ball, 1] = -half_y + BALL_INSET
    w.truth.velocity[f, :, :] = 0.0


@compiled
def near_ball(c, position, first, last):
    """The player of first..last-1 nearest to the ball and within kicking distance; -1 if none."""
    ball = len(position) - 1
    nearest, best = -1, c.kickable_distance
    for p in range(first, last):
        distance = length(position[p, 0] - position[ball, 0], position[p, 1] - position[ball, 1])
        if distance < best:
            nearest, best = p, distance
    return nearest


@compiled
def next_take_count(count, keeper_near, taker_near):
    """The take counter after one cycle.

    A cycle with a taker near adds one, also when a keeper is near as well; a cycle with only
    keepers near clears it; a cycle with no player near leaves it.
    """
    if taker_near:
        return count + 1
    return 0 if keeper_near else count


@compiled
def outcome(c, position, take_count):
    """Outcome of the cycle just played, by the take counter as it was before it.

    Out of bounds comes first. The server looks at its counter before it counts, so that the ball
    is taken one cycle after the counter reached TAKE_CYCLES, and may still leave the field in it.
    """
    ball = len(position) - 1
    inside_x = abs(position[ball, 0]) < c.field_length / 2.0
    inside_y = abs(position[ball, 1]) < c.field_width / 2.0
    if not (inside_x and inside_y):
        return _OUT_OF_BOUNDS
    return _TAKEN_AWAY if take_count >= TAKE_CYCLES else _IN_PLAY
