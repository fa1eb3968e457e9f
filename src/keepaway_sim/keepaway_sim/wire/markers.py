"""Players and ball as markers for RViz and Foxglove (visualization_msgs/Marker). Needs no ROS."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from keepaway_sim.task import Role, Task
from keepaway_sim.world.config import Physics

# visualization_msgs/Marker's numbers for shapes.
_ARROW, _SPHERE, _CYLINDER, _LINE_STRIP, _TEXT = 0, 2, 3, 4, 9
_HEIGHT = 1.2  # [m] of a player
_COLOURS = {Role.KEEPER: (0.0, 0.45, 0.70), Role.TAKER: (0.84, 0.37, 0.0)}
_WHITE = (1.0, 1.0, 1.0)
_YELLOW = (1.0, 0.9, 0.1)
_NAME_BELOW = 1.1  # [m] a name stands beside its player, seen from above

Marker = dict[str, Any]


def field_markers(task: Task, position: np.ndarray, yaw: np.ndarray) -> list[Marker]:
    """The field's border, the ball, and for each player a body, a direction and a name.

    Args:
        task: who plays, and on what field.
        position: (num_players + 1, 2) [m], the ball last.
        yaw: (num_players,) body directions [rad].
    """
    markers = [_border(task), _ball(*position[-1].tolist())]
    for player, name in enumerate(task.player_names):
        x, y = position[player].tolist()
        markers += _player(player, name, task.role(player), x, y, float(yaw[player]))
    return markers


def _border(task: Task) -> Marker:
    x, y = task.field_length / 2, task.field_width / 2
    corners = [(x, y), (-x, y), (-x, -y), (x, -y), (x, y)]
    points = [{"x": a, "y": b} for a, b in corners]
    return _marker("field", 0, _LINE_STRIP, (0.1, 0.0, 0.0), _WHITE, points=points)


def _ball(x: float, y: float) -> Marker:
    """Twice its true size and above the players' heads, to be seen from above at any moment."""
    size = 4 * Physics().ball_size
    return _marker("ball", 0, _SPHERE, (size, size, size), _YELLOW, (x, y, _HEIGHT + size))


def _player(index: int, name: str, role: Role, x: float, y: float, yaw: float) -> list[Marker]:
    wide, colour = 2 * Physics().player_size, _COLOURS[role]
    beside = (x, y - _NAME_BELOW, 0.1)
    return [
        _marker("body", index, _CYLINDER, (wide, wide, _HEIGHT), colour, (x, y, _HEIGHT / 2)),
        _marker("direction", index, _ARROW, (1.0, 0.12, 0.12), colour, (x, y, _HEIGHT), yaw),
        _marker("name", index, _TEXT, (0.0, 0.0, 0.7), _WHITE, beside, text=name),
    ]


def _marker(
    namespace: str,
    number: int,
    shape: int,
    scale: tuple[float, float, float],
    colour: tuple[float, float, float],
    place: tuple[float, float, float] = (0.0, 0.0, 0.0),
    yaw: float = 0.0,
    **more: Any,
) -> Marker:
    turn = {"z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    return {
        "ns": namespace,
        "id": number,
        "type": shape,
        "pose": {"position": dict(zip("xyz", place, strict=True)), "orientation": turn},
        "scale": dict(zip("xyz", scale, strict=True)),
        "color": dict(zip("rgba", (*colour, 1.0), strict=True)),
        **more,
    }
