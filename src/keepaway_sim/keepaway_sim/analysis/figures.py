"""Figures of a tally: hold times, passes, losses, actions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from keepaway_sim.task import Action, Outcome, Task

OUTCOME_COLOURS = {Outcome.TAKEN_AWAY: "#d55e00", Outcome.OUT_OF_BOUNDS: "#8a5fb0"}
BLUE = "#0072b2"
ACTION_COLOURS = (BLUE, "#56b4e9", "#009e73", "#e69f00", "#cc79a7")
WITH_BALL = (Action.HOLD_BALL, Action.PASS_BALL)


def hold_time_figure(durations: np.ndarray) -> Figure:
    """Durations by episode and their moving mean."""
    figure, axes = _figure("Hold time", "episode", "duration (s)")
    if not len(durations):
        return figure
    window = max(1, min(1000, len(durations) // 10))
    shown = max(1, len(durations) // 5000)
    number = np.arange(len(durations))
    axes.plot(number[::shown], durations[::shown], ".", color="0.65", markersize=_dot(len(number)))
    sums = np.cumsum(np.concatenate([[0.0], durations]))
    start = np.maximum(number + 1 - window, 0)
    mean = (sums[number + 1] - sums[start]) / (number + 1 - start)
    axes.plot(number, mean, color=BLUE, linewidth=1.8, label=f"mean of the last {window}")
    axes.set_ylim(0, float(np.quantile(durations, 0.995)) * 1.1 + 0.1)
    axes.legend(frameon=False, loc="upper left")
    return figure


def passes_figure(passes: np.ndarray, task: Task) -> Figure:
    """Who passed to whom: a square with a number for each pair."""
    figure, axes = _figure("Passes that arrived", "to", "from")
    names = task.player_names[: task.num_keepers]
    axes.imshow(passes, cmap="Blues", vmin=0)
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    strongest = max(1, int(passes.max()))
    for (row, column), number in np.ndenumerate(passes):
        if row != column:
            colour = "white" if number > 0.6 * strongest else "black"
            axes.text(column, row, f"{number:,}", ha="center", va="center", color=colour)
    axes.set_xticks(range(len(names)), names)
    axes.set_yticks(range(len(names)), names)
    return figure


def unknown_figure(title: str) -> Figure:
    """No figure: the bag lacks what it would show."""
    figure, axes = _figure(title, "", "")
    axes.text(0.5, 0.5, "not known: field states are missing", ha="center", va="center")
    axes.set_axis_off()
    return figure


def losses_figure(losses: np.ndarray, task: Task) -> Figure:
    """Where the ball was when episodes ended; (n, 3) x, y [m], outcome."""
    figure, axes = _figure("Where the ball was lost", "x (m)", "y (m)")
    figure.set_size_inches(5.6, 5.6)
    length, width = task.field_length, task.field_width
    border = Rectangle((-length / 2, -width / 2), length, width, fill=False, edgecolor="0.3")
    axes.add_patch(border)
    every, size = max(1, len(losses) // 4000), 1.5 * _dot(len(losses))
    for outcome, colour in OUTCOME_COLOURS.items():
        of_kind = losses[losses[:, 2] == outcome]
        label = f"{outcome.name.lower().replace('_', ' ')} ({len(of_kind):,})"
        x, y = of_kind[::every, :2].T
        axes.plot(x, y, ".", color=colour, markersize=size, alpha=0.6, label=label)
    axes.set_aspect("equal")
    axes.set_xlim(-length / 2 - 2, length / 2 + 2)
    axes.set_ylim(-width / 2 - 2, width / 2 + 2)
    figure.legend(
        frameon=False,
        loc="outside lower center",
        ncols=len(OUTCOME_COLOURS),
        fontsize=8,
        markerscale=7.0 / size,
    )
    return figure


def actions_figure(actions: np.ndarray, task: Task) -> Figure:
    """What players asked for, in shares: keepers with the ball, and every player without it."""
    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    _draw_shares(left, actions, WITH_BALL, "With the ball", task)
    _draw_shares(right, actions, [a for a in Action if a not in WITH_BALL], "Without it", task)
    left.invert_yaxis()
    figure.legend(frameon=False, loc="outside lower center", ncols=len(Action), fontsize=8)
    return figure


def _draw_shares(
    axes: Axes, actions: np.ndarray, chosen: Sequence[Action], title: str, task: Task
) -> None:
    """Bars of the shares of some actions among each other, and how many there were."""
    names, counts = task.player_names, actions[:, list(chosen)]
    totals = counts.sum(axis=1)
    begin = np.zeros(len(counts))
    for action, count in zip(chosen, counts.T, strict=True):
        if count.any():
            share, label = count / np.maximum(totals, 1), action.name.lower().replace("_", " ")
            colour = ACTION_COLOURS[action]
            axes.barh(names, share, left=begin, label=label, height=0.7, color=colour)
            begin = begin + share
    for place, total in enumerate(totals.tolist()):
        axes.text(1.02, place, f"{total:,}" if total else "", va="center", fontsize=7, color="0.35")
    axes.set_title(title, fontsize=11, loc="left")
    axes.set_xlabel("share of requests; beside: how many")
    axes.set_xlim(0, 1)
    axes.set_yticks(range(len(names)), names)
    axes.spines[["top", "right"]].set_visible(False)


def _dot(count: int) -> float:
    """The size [points] of each dot, of this number of dots."""
    return float(np.clip(40 / np.sqrt(max(count, 1)), 1.5, 5.0))


def _figure(title: str, x_label: str, y_label: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    axes = figure.add_subplot()
    axes.set_title(title, fontsize=11, loc="left")
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes
