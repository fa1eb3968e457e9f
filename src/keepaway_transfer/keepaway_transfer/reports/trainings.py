"""Trainings side by side: how long keepers held the ball, and their learning curves."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from keepaway_agent.training.folder import TrainingRecord, read_training
from keepaway_sim.world.config import CYCLE_TIME
from keepaway_transfer import metrics
from keepaway_transfer.errors import LogError
from keepaway_transfer.metrics import Floats
from keepaway_transfer.reports import plotting, statistics

POINTS = 200  # of a curve
SHOWN_TRIALS = 5
FEWEST_EPISODES = 20  # that a mean is over

Trials = Sequence[Floats]
"""The durations [s] of every trial's episodes, in playing order."""


def write_trainings(folders: Sequence[Path], out: Path) -> str:
    """Draw the learning curves of trainings into a folder.

    Args:
        folders: of scripts/train.py, all of one task.
        out: folder of `learning_curves.png`; made if it does not exist.

    Returns:
        a table, a line a training.

    Raises:
        AgentError: a folder that is no training's.
        LogError: trainings of several tasks, or one without a finished trial.
    """
    records = {str(folder): read_training(folder) for folder in folders}
    tasks = {record.settings.task for record in records.values()}
    if len(tasks) > 1:
        raise LogError(f"trainings of {' and '.join(sorted(tasks))}: name those of one task")
    trials = {name: _trials(name, record) for name, record in records.items()}
    window = window_of(trials)
    made_by = "; ".join(f"{record.command}, {record.code_version}" for record in records.values())
    figure = curves(trials, window, title=f"{tasks.pop()}, mean of {window:,} episodes")
    out.mkdir(parents=True, exist_ok=True)
    plotting.save_figure(figure, out / "learning_curves.png", made_by)
    return table(trials, window)


def table(trials: Mapping[str, Trials], window: int) -> str:
    """What keepers held at first and in the end, by trial."""
    first = metrics.FIRST_EPISODES
    lines = [
        f"| training | trials | episodes | hours | first {first} episodes (s)"
        f" | last {window:,} episodes (s) |",
        "|---|---|---|---|---|---|",
    ]
    for name, each in trials.items():
        episodes = sum(map(len, each))
        begun = _with_error([metrics.initial_performance(one) for one in each])
        ended = _with_error([metrics.asymptotic_performance(one, window) for one in each])
        hours = sum(map(metrics.hours, each))
        lines.append(f"| {name} | {len(each)} | {episodes:,} | {hours:.1f} | {begun} | {ended} |")
    return "\n".join(lines)


def curves(
    trials: Mapping[str, Trials], window: int, *, title: str, threshold: float | None = None
) -> Figure:
    """Learning curves of groups of trials over simulated hours; the first is the grey one.

    Args:
        trials: by what they are called.
        window: episodes that a point is the mean of.
        title: above the axes.
        threshold: a line across [s].
    """
    longest = max(metrics.hours(one) for each in trials.values() for one in each)
    hours = np.linspace(0, longest, POINTS + 1)[1:]
    groups = {name: _group(each, hours, window) for name, each in trials.items()}
    return plotting.learning_curves(hours, groups, threshold, title)


def window_of(trials: Mapping[str, Trials]) -> int:
    """Episodes to average over: the paper's, or a fifth of what the shortest trial has."""
    shortest = min(len(one) for each in trials.values() for one in each)
    return min(metrics.WINDOW, max(FEWEST_EPISODES, shortest // 5))


def _group(trials: Trials, hours: Floats, window: int) -> plotting.CurveGroup:
    each = np.array([metrics.learning_curve(one, hours, window, FEWEST_EPISODES) for one in trials])
    return plotting.CurveGroup(each[:SHOWN_TRIALS], statistics.mean_curve(each))


def _trials(name: str, record: TrainingRecord) -> Trials:
    found = [durations * CYCLE_TIME for durations, _ in record.episodes.values() if len(durations)]
    if not found:
        raise LogError(f"{name}: no trial of this training is finished")
    return found


def _with_error(values: Sequence[float]) -> str:
    mean, error = statistics.mean_and_error(values)
    return f"{mean:.2f}" + (f" +- {error:.2f}" if error is not None else "")
