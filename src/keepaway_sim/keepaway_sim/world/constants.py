"""All constants of a task and its configuration, packed for compiled functions."""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from keepaway_sim.settings import flat, settings_of
from keepaway_sim.task import Task
from keepaway_sim.world.config import (
    ROLL_CYCLES,
    SIGHT_CELLS,
    SIGHT_FARTHEST,
    SIGHT_NEAREST,
    SIGHT_STEP,
    Config,
    Physics,
    Skills,
    Vision,
)
from keepaway_sim.world.passing import record

_GROUPS = (Task, Physics, Vision, Skills)
_DERIVED = (
    "kickable_distance",  # [m] between centres
    "touch_distance",  # [m] between centres
    "full_dash",  # [m/cycle^2] acceleration at full power
    "top_speed",  # [m/cycle] of a player who keeps dashing
    "ball_roll",  # (ROLL_CYCLES,) see `_roll_table`
    "player_roll",
    "sight_edge",  # [m] where reported distances change, see `_sight_tables`
    "sight_value",  # [m] the reported distance below each edge
    "sight_first",  # the first edge beyond each whole multiple of 1 / SIGHT_CELLS m
    "direction_cosine",  # of every direction that is seen, from -pi to pi
    "direction_sine",
    "phantom_slots",  # beside the smaller team's own, see `phantoms`
    "open_x",  # (OPEN_LANES,) float32 [m] the NUM_OPEN points where a keeper may get open
    "open_y",
)
OPPONENT_SLOTS = 11  # P: MAX_OPPONENTS
OPEN_POINTS = 5  # P: a side of the grid of points where a keeper may get open
NUM_OPEN = OPEN_POINTS**2
OPEN_LANES = 32  # the same, up to a multiple of what one instruction serves


# Made once, under its own name in this module: numba's cache on disk must find it again.
Constants: Any = record(
    namedtuple(
        "Constants",
        [name.removesuffix("_deg") for kind in _GROUPS for name in settings_of(kind)]
        + list(_DERIVED),
    )
)


def pack(task: Task, config: Config) -> Any:
    """All constants as one named tuple that compiled functions take (angles in radians)."""
    values: dict[str, Any] = {}
    for group in (task, config.physics, config.vision, config.skills):
        values |= flat(group)
    for name in [name for name in values if name.endswith("_deg")]:
        values[name.removesuffix("_deg")] = math.radians(values.pop(name))
    physics = config.physics
    values["touch_distance"] = physics.player_size + physics.ball_size
    values["kickable_distance"] = values["touch_distance"] + physics.kickable_margin
    values["full_dash"] = 100.0 * physics.dash_power_rate
    values["top_speed"] = min(
        values["full_dash"] / (1.0 - physics.player_decay), physics.player_speed_max
    )
    values |= _sight_tables(config.vision.quantize_step)
    values |= _direction_tables(values["direction_step"])
    values["ball_roll"] = _roll_table(physics.ball_decay)
    values["player_roll"] = _roll_table(physics.player_decay)
    values["phantom_slots"] = _phantom_slots(task, config.vision)
    values |= _open_points(task, values["open_border"])
    return Constants(**values)


def _phantom_slots(task: Task, vision: Vision) -> int:
    """How many opponents a player may believe in beyond those of the match, see `phantoms`."""
    smaller = min(task.num_keepers, task.num_takers)
    return 0 if vision.visible_angle_deg >= 360.0 else max(OPPONENT_SLOTS - smaller, 0)


def _open_points(task: Task, border: float) -> dict[str, np.ndarray]:
    """The grid of points where a keeper may get open, `border` of a side away from the edge."""
    share = np.linspace(-0.5, 0.5, OPEN_POINTS) * (1.0 - 2.0 * border)
    x, y = np.meshgrid(task.field_length * share, -task.field_width * share, indexing="ij")
    rest = OPEN_LANES - NUM_OPEN
    return {
        name: np.pad(points.ravel().astype(np.float32), (0, rest))
        for name, points in (("open_x", x), ("open_y", y))
    }


def _roll_table(decay: float) -> np.ndarray:
    """(ROLL_CYCLES,) distance over first speed of what rolls for 0, 1, .. cycles."""
    left = np.cumprod(np.append(1.0, np.full(ROLL_CYCLES - 1, decay)))  # of its speed
    return (1.0 - left) / (1.0 - decay)


def _sight_tables(step: float) -> dict[str, np.ndarray]:
    """Tables of the distances that players see.

    S visualsenderplayer.cpp `calcQuantDist`: the logarithm is rounded to `step`, then what comes
    of it to 0.1 m. So the reported distance changes where logarithms lie half a step between.
    """
    step = step or 1.0  # exact distances need no tables
    first, last = math.log(SIGHT_NEAREST) // step, math.log(SIGHT_FARTHEST) // step
    steps = np.arange(first, last + 1) * step
    edge = np.append(_rounded(np.exp(steps[:-1] + 0.5 * step)), math.inf)
    cells = np.arange(int(SIGHT_FARTHEST * SIGHT_CELLS)) / SIGHT_CELLS
    return {
        "sight_edge": edge,
        "sight_value": np.round(np.exp(steps) / SIGHT_STEP) * SIGHT_STEP,
        "sight_first": np.searchsorted(edge, cells, side="right"),
    }


def _direction_tables(step: float) -> dict[str, np.ndarray]:
    """Cosines and sines of the directions that players see, multiples of `step` [rad]."""
    most = math.ceil(math.pi / step) if step > 0.0 else 0
    direction = step * np.arange(-most, most + 1)
    return {
        "direction_cosine": _rounded(np.cos(direction)),
        "direction_sine": _rounded(np.sin(direction)),
    }


def _rounded(values: np.ndarray) -> np.ndarray:
    """To 2**-40: numpy's functions differ in their last bits from one processor to another."""
    return np.round(values * 2.0**40) / 2.0**40
