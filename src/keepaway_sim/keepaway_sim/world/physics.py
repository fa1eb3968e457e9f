"""Movement, kicks and collisions of the soccer server.

Order of one cycle (S: stadium.cpp `step`): commands set accelerations and turns, velocities follow
(`dash_acceleration`, `turned_yaw`, `kick_acceleration`, `moved_velocity`), discs move by them
(where some `may_touch`, pymunk moves them and finds those that do: `Bodies.move`), and `separate`
pushes overlapping discs apart and reverses them by the server's rule.

Positions and velocities are kept on a grid of 2**-30 m. A field's place in the shared space is a
multiple of a power of two, so adding it is exact and a field behaves to the last bit alike
wherever it lies, and whether pymunk moves it or not.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.geometry import TWO_PI, clip, length, wrap
from keepaway_sim.world.streams import draw
from keepaway_sim.world.trigonometry import bearing, unit

GRID = 2.0**30  # [1/m] positions and velocities are whole multiples of 1/GRID
OVERLAP = 1e-6  # [m] discs closer than touching by less than this do not collide
SWEEPS = 10  # S: stadium.cpp, how often overlapping discs are pushed apart a cycle
BOUNCE = -0.1  # S: stadium.cpp, velocity factor of what collided


@compiled
def on_grid(value):
    """The nearest multiple of 2**-30 m."""
    return round(value * GRID) / GRID


@compiled
def dash_acceleration(c, power, yaw):
    """Acceleration (x, y) [m/cycle^2] of a dash with `power` along the body (S: leg.cpp)."""
    effective = clip(power, c.min_dash_power, 100.0) * c.dash_power_rate
    ux, uy = unit(yaw)
    return effective * ux, effective * uy


@compiled
def turned_yaw(c, yaw, moment, speed, noise):
    """Body direction after a turn command (S: player.cpp `turn`).

    Args:
        moment: requested turn [rad]; a moving player turns by moment / (1 + inertia * speed).
        speed: the player's speed [m/cycle].
        noise: uniform in [-1, 1).
    """
    moment = clip(moment, -math.pi, math.pi)
    return wrap(yaw + (1.0 + c.player_rand * noise) * moment / (1.0 + c.inertia_moment * speed))


@compiled
def kick_rate(c, rel_x, rel_y, yaw):
    """Acceleration of the ball per unit of kick power (S: player.cpp `kick`).

    Args:
        rel_x, rel_y: ball relative to the player [m], field axes.
        yaw: the player's body direction [rad].
    """
    direction_share = abs(wrap(bearing(rel_x, rel_y) - yaw)) / math.pi
    distance_share = (length(rel_x, rel_y) - c.touch_distance) / c.kickable_margin
    return c.kick_power_rate * (1.0 - 0.25 * direction_share - 0.25 * distance_share)


@compiled
def kick_acceleration(c, power, direction, rel_x, rel_y, yaw):
    """Acceleration (x, y) of the ball by a kick without noise; `direction` relative to yaw."""
    size = clip(power, 0.0, 100.0) * kick_rate(c, rel_x, rel_y, yaw)
    ux, uy = unit(yaw + direction)
    return size * ux, size * uy


@compiled
def kick_noise_radius(c, power, rel_x, rel_y, yaw, ball_speed):
    """Largest kick noise [m/cycle^2]: grows with power, bad placement and ball speed (S 12.0)."""
    direction_share = abs(wrap(bearing(rel_x, rel_y) - yaw)) / math.pi
    distance_share = (length(rel_x, rel_y) - c.touch_distance) / c.kickable_margin
    position_rate = 0.5 + 0.25 * (direction_share + distance_share)
    speed_rate = 0.5 + 0.5 * ball_speed / (c.ball_speed_max * c.ball_decay)
    return c.kick_rand * clip(power, 0.0, 100.0) / 100.0 * (position_rate + speed_rate)


@compiled
def limited(x, y, largest):
    """The vector, no longer than `largest`."""
    size = length(x, y)
    if size > largest:
        return x * largest / size, y * largest / size
    return x, y


class Limits(NamedTuple):
    """How an object may move."""

    accel: float  # [m/cycle^2] at most
    speed: float  # [m/cycle] at most
    rand: float  # [1] of its speed: how far noise may reach


@compiled
def moved_velocity(vx, vy, ax, ay, limits, draws, stream):
    """Velocity with which an object moves this cycle (S: object.cpp `_inc`).

    Acceleration and speed are limited, then noise polar(U(0, rand * speed), U(-pi, pi)) is
    added; two uniforms are read, none where nothing moves or rand is 0.
    """
    ax, ay = limited(ax, ay, limits.accel)
    vx, vy = limited(vx + ax, vy + ay, limits.speed)
    if limits.rand > 0.0 and (vx != 0.0 or vy != 0.0):
        radius = limits.rand * length(vx, vy) * draw(draws, stream)
        ux, uy = unit(TWO_PI * draw(draws, stream))
        vx += radius * ux
        vy += radius * uy
    return on_grid(vx), on_grid(vy)


@compiled
def may_touch(position, velocity, radius):
    """Do any two discs overlap when each has moved by its velocity?

    Args:
        position, velocity: (num_objects, 2) of one field.
        radius: (num_objects,) [m].
    """
    for i in range(len(radius)):
        x, y = position[i, 0] + velocity[i, 0], position[i, 1] + velocity[i, 1]
        for j in range(i + 1, len(radius)):
            dx = position[j, 0] + velocity[j, 0] - x
            dy = position[j, 1] + velocity[j, 1] - y
            touching = radius[i] + radius[j]
            if dx * dx + dy * dy < touching * touching:
                return True
    return False


@compiled
def separate(position, velocity, radius, scratch):
    """Push overlapping discs of one field apart and reverse them, in place (S: stadium.cpp).

    Each overlapping pair is moved symmetrically about its midpoint to touching; a disc in
    several pairs goes to the mean of its places; up to ten sweeps. What collided keeps a tenth
    of its velocity, reversed.

    Args:
        position, velocity: (num_objects, 2) of one field.
        radius: (num_objects,) [m].
        scratch: Scratch.
    """
    collided = scratch.collided
    collided[:] = False
    for _ in range(SWEEPS):
        scratch.pushed_to[:] = 0.0
        scratch.num_pushes[:] = 0.0
        for i in range(len(radius)):
            for j in range(i + 1, len(radius)):
                _push_apart(position, radius, i, j, scratch)
        if not _take_places(position, scratch):
            break
    for k in range(len(radius)):
        if collided[k]:
            velocity[k, 0] = on_grid(BOUNCE * velocity[k, 0])
            velocity[k, 1] = on_grid(BOUNCE * velocity[k, 1])


@compiled
def _push_apart(position, radius, i, j, scratch):
    """Add to the pushes of two discs where they would have to go; nothing if they are apart."""
    dx = position[j, 0] - position[i, 0]
    dy = position[j, 1] - position[i, 1]
    touching = radius[i] + radius[j]
    distance = length(dx, dy)
    if distance >= touching - OVERLAP:
        return
    if distance > 0.0:
        dx, dy = dx / distance, dy / distance
    else:
        dx, dy = 1.0, 0.0
    middle_x = 0.5 * (position[i, 0] + position[j, 0])
    middle_y = 0.5 * (position[i, 1] + position[j, 1])
    for k, side in ((i, -0.5), (j, 0.5)):
        scratch.pushed_to[k, 0] += middle_x + side * touching * dx
        scratch.pushed_to[k, 1] += middle_y + side * touching * dy
        scratch.num_pushes[k] += 1.0


@compiled
def _take_places(position, scratch):
    """Put every pushed disc on the mean of its places. Was there any?"""
    pushed = False
    for k in range(len(position)):
        count = scratch.num_pushes[k]
        if count > 0.0:
            pushed = True
            scratch.collided[k] = True
            position[k, 0] = on_grid(scratch.pushed_to[k, 0] / count)
            position[k, 1] = on_grid(scratch.pushed_to[k, 1] / count)
    return pushed
