"""Measurements of the real soccer server, as cells to compare with."""

from __future__ import annotations

import importlib.resources
import json
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

SESSIONS: Final = {"2005": "E05", "v19": "D19"}
"""Our profiles, and their names in the reference."""


POLICIES: Final = ("random", "hold", "hand")
TASKS: Final = ("3v2", "4v3")
GOALS: Final = {"random": 0.08, "hold": 0.08, "hand": 0.15}
"""How far our mean may be off at 360 degrees."""


GOALS_NARROW: Final = {"random": 0.10, "hold": 0.10, "hand": 0.20}
"""The same at 90 degrees."""


GOAL_BETWEEN: Final = 0.10  # the same from the mean of two sessions of the real server
GOAL_OUT: Final = 0.10  # how far the share of episodes that end out of bounds may be off


@dataclass(frozen=True)
class Cell:
    """One measurement of the reference, in seconds."""

    profile: str
    visible_angle: int  # [deg]
    task: str
    policy: str
    mean: float
    sem: float
    std: float | None = None
    out: float | None = None  # share that ended out of bounds
    n: int | None = None  # episodes
    second: float | None = None  # mean of a second session of the same

    @property
    def goal(self) -> float:
        """The share by which our mean may be off."""
        return (GOALS if self.visible_angle == 360 else GOALS_NARROW)[self.policy]

    def is_near(self, mean: float) -> bool:
        """Is a mean duration [s] as near to the reference as it should be?

        Within the goal, or two standard errors; where there were two sessions, between them or
        near their mean: one session differs from another by more than its standard error.
        """
        if self.second is not None:
            low, high = sorted((self.mean, self.second))
            middle = 0.5 * (low + high)
            return low <= mean <= high or abs(mean / middle - 1.0) <= GOAL_BETWEEN
        return abs(mean - self.mean) <= max(self.goal * self.mean, 2.0 * self.sem)


def reference(name: str) -> dict[str, Any]:
    """A file of the reference measurements, `hold_times` or `process_statistics`."""
    folder = importlib.resources.files("keepaway_sim") / "reference"
    data: dict[str, Any] = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    return data


def reference_cells() -> list[Cell]:
    """All measurements of hold times."""
    times = reference("hold_times")
    second = times["E05"]["second_session"]
    return [
        Cell(
            profile,
            angle,
            task,
            policy,
            **numbers,
            second=second[task][policy]["mean"] if (name, angle) == ("E05", 360) else None,
        )
        for profile, name in SESSIONS.items()
        for angle in (360, 90)
        for task, policies in times[name].get(f"visible_angle_{angle}", {}).items()
        for policy, numbers in policies.items()
    ]


def reference_curves(profile: str) -> list[np.ndarray]:
    """Learning curves of the reference on 3v2: means of successive blocks of BLOCK episodes [s]."""
    curves = reference("hold_times")[SESSIONS[profile]]["learning_3v2_per_200_episodes"]
    return [np.array(curve) for curve in (curves if isinstance(curves[0], list) else [curves])]


def reference_processes(cell: Cell) -> dict[str, Any] | None:
    """`episodes`, `cycles` of each and mean `statistics` of recorded play; None: not recorded."""
    if cell.visible_angle != 360:
        return None
    return recorded(cell.profile, cell.task, cell.policy)


def recorded(profile: str, task: str, policy: str) -> dict[str, Any] | None:
    """`reference_processes` by names, where `policy` may be `learned` as well."""
    tasks = reference("process_statistics")["recorded"].get(SESSIONS[profile], {})
    found: dict[str, Any] | None = tasks.get(task, {}).get(policy)
    return found
