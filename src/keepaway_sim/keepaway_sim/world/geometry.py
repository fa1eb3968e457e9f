"""Plane geometry and geometric series for compiled code. Angles in radians, lengths in metres."""

from __future__ import annotations

import math

from keepaway_sim.world.compiled import compiled

TWO_PI = 2.0 * math.pi


@compiled
def wrap(angle):
    """The same angle in [-pi, pi].

    >>> round(wrap(3.5 * math.pi) / math.pi, 12)
    -0.5
    """
    return angle - TWO_PI * round(angle / TWO_PI)


@compiled
def length(x, y):
    """Length of a vector (faster than hypot, whose care for huge numbers no field needs)."""
    return math.sqrt(x * x + y * y)


@compiled
def rotated(x, y, cosine, sine):
    """A vector turned by the angle of this cosine and sine."""
    return cosine * x - sine * y, sine * x + cosine * y


@compiled
def clip(value, low, high):
    """`value`, but no less than `low` and no more than `high`."""
    return low if value < low else (high if value > high else value)


@compiled
def quantize(value, step):
    """`value` rounded to the nearest multiple of `step`; unchanged where step is 0."""
    return value if step == 0.0 else round(value / step) * step


@compiled
def cone_contains(x, y, start_x, start_y, end_x, end_y, width):
    """Is (x, y) in the cone from start to end that is `width` wide (half) at distance 1?

    The cone ends at `end`, and a point further from start than `end` is outside
    (P: WorldModel::getNrInSetInCone).
    """
    axis_x, axis_y = end_x - start_x, end_y - start_y
    point_x, point_y = x - start_x, y - start_y
    square = axis_x * axis_x + axis_y * axis_y
    along = axis_x * point_x + axis_y * point_y
    across = axis_x * point_y - axis_y * point_x
    near = (along < square) & (point_x * point_x + point_y * point_y < square)
    return (along > 0.0) & near & (abs(across) < width * along)
