"""How episodes went, in a few numbers. No ROS."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from keepaway_sim.task import Outcome


class Score(NamedTuple):
    """One finished episode."""

    duration: float  # [s]
    outcome: Outcome


def summary(scores: Sequence[Score]) -> dict[str, float | int | None]:
    """Number, mean duration, its standard error, share out of bounds; aborted ones are left out.

    >>> summary([Score(4.0, Outcome.TAKEN_AWAY), Score(6.0, Outcome.OUT_OF_BOUNDS)])
    {'episodes': 2, 'mean_duration_s': 5.0, 'sem_duration_s': 1.0, 'out_of_bounds_share': 0.5}
    """
    played = [score for score in scores if score.outcome != Outcome.ABORTED]
    num = len(played)
    mean = sum(score.duration for score in played) / num if num else None
    sem = None
    if mean is not None and num > 1:
        variance = sum((score.duration - mean) ** 2 for score in played) / (num - 1)
        sem = math.sqrt(variance / num)
    out = sum(score.outcome == Outcome.OUT_OF_BOUNDS for score in played)
    return {
        "episodes": num,
        "mean_duration_s": mean,
        "sem_duration_s": sem,
        "out_of_bounds_share": out / num if num else None,
    }
