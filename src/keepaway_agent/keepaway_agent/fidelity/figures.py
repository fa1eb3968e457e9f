"""Pictures of how near the world is to the real one: durations and learning curves."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from keepaway_agent.fidelity.measure import POINT, Measured
from keepaway_agent.fidelity.reference import reference_curves, reference_processes
from keepaway_sim.world.config import CYCLE_TIME

POLICY_COLOURS: Final = {"random": "#0072b2", "hold": "#d55e00", "hand": "#009e73"}
"""Okabe and Ito's, which colour-blind people can tell apart."""
COLUMNS: Final = 3
OURS, REFERENCE = "#0072b2", "#d55e00"


def draw_durations(cells: Sequence[Measured]) -> Figure:
    """Which share of episodes lasts longer than a time, a panel for each task, profile and view.

    Solid: here. Dotted: recorded episodes of the real server, where there are any. Triangles on
    the axis: mean durations, here (filled) and of the real server (open).
    """
    groups = [
        (title, list(members)) for title, members in itertools.groupby(cells, key=_panel_title)
    ]
    rows = -(-(len(groups) + 1) // COLUMNS)
    figure = Figure(figsize=(3.4 * COLUMNS, 2.7 * rows), layout="constrained")
    panels = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for axes, (title, members) in zip(panels, groups, strict=False):
        axes.set_title(title, fontsize=9)
        for measured in members:
            _draw_cell(axes, measured)
        axes.set_xscale("log")
        axes.set_xlim(1, 200)
        axes.set_ylim(-0.04, 1.02)
        axes.set_xticks([1, 3, 10, 30, 100], ["1", "3", "10", "30", "100"])
        axes.set_xlabel("duration (s)", fontsize=8)
        axes.tick_params(labelsize=8)
    for axes in panels[::COLUMNS][: -(-len(groups) // COLUMNS)]:
        axes.set_ylabel("share of episodes that last longer", fontsize=8)
    for axes in panels[len(groups) :]:
        axes.axis("off")
    panels[len(groups)].legend(handles=_legend(), loc="center", frameon=False, fontsize=8)
    return figure


def _panel_title(measured: Measured) -> str:
    cell = measured.cell
    return f"{cell.task}, profile {cell.profile}, {cell.visible_angle} degrees"


def _draw_cell(axes: Axes, measured: Measured) -> None:
    colour = POLICY_COLOURS[measured.cell.policy]
    _draw_survival(axes, measured.duration, color=colour, linewidth=1.4)
    recorded = reference_processes(measured.cell)
    if recorded:
        _draw_survival(axes, np.array(recorded["cycles"]) * CYCLE_TIME, color=colour, linestyle=":")
    axes.plot(measured.mean, -0.02, "^", color=colour, markersize=6, clip_on=False)
    axes.plot(
        measured.cell.mean, -0.02, "^", color=colour, fillstyle="none", markersize=9, clip_on=False
    )


def _draw_survival(axes: Axes, durations: np.ndarray, **style: Any) -> None:
    ordered = np.sort(durations)
    longer = 1.0 - np.arange(1, len(ordered) + 1) / len(ordered)
    axes.step(np.r_[1.0, ordered], np.r_[1.0, longer], where="post", **style)


def _legend() -> list[Line2D]:
    lines = [
        Line2D([], [], color=colour, label=policy) for policy, colour in POLICY_COLOURS.items()
    ]
    marks: dict[str, dict[str, Any]] = {
        "here": {"linestyle": "-"},
        "real server (recorded)": {"linestyle": ":"},
        "mean here": {"linestyle": "", "marker": "^"},
        "mean, real server": {"linestyle": "", "marker": "^", "fillstyle": "none"},
    }
    rest = [Line2D([], [], color="#444444", label=label, **style) for label, style in marks.items()]
    return [*lines, *rest]


def draw_learning(curves: Mapping[str, np.ndarray]) -> Figure:
    """Learning curves of 3v2 from scratch beside the reference's, a panel a profile.

    Args:
        curves: profile -> (num_seeds, num_blocks) means of successive blocks of episodes [s].
    """
    figure = Figure(figsize=(4.2 * len(curves), 3.2), layout="constrained")
    panels = figure.subplots(1, len(curves), squeeze=False, sharey=True)[0]
    for axes, (profile, ours) in zip(panels, curves.items(), strict=True):
        episodes = POINT * (np.arange(ours.shape[1]) + 1)
        axes.plot(episodes, ours.T, color=OURS, linewidth=0.7, alpha=0.45)
        label = f"here, mean of {len(ours)} seeds"
        axes.plot(episodes, ours.mean(axis=0), color=OURS, linewidth=2.2, label=label)
        for number, theirs in enumerate(reference_curves(profile)):
            axes.plot(
                POINT * (np.arange(len(theirs)) + 1), theirs, "o-", color=REFERENCE, markersize=3,
                linewidth=1.4, label="" if number else "real server, single runs",
            )  # fmt: skip
        axes.set_title(f"3v2 from scratch, profile {profile}", fontsize=9)
        axes.set_xlabel("episodes", fontsize=8)
        axes.tick_params(labelsize=8)
        axes.legend(frameon=False, fontsize=8, loc="upper left")
    panels[0].set_ylabel(f"mean duration of {POINT} episodes (s)", fontsize=8)
    panels[0].set_ylim(bottom=0)
    return figure


def draw_band(ours: np.ndarray) -> Figure:
    """Learning curves of 3v2, 2005, as a band (mean and two deviations), the real runs on top.

    Args:
        ours: (num_trials, num_blocks) means of successive blocks of episodes [s].
    """
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    axes = figure.subplots()
    episodes = POINT * (np.arange(ours.shape[1]) + 1)
    mean, spread = ours.mean(axis=0), 2.0 * ours.std(axis=0, ddof=1)
    axes.fill_between(
        episodes, mean - spread, mean + spread, color=OURS, alpha=0.2, linewidth=0,
        label="here, ± 2 sd of trials",
    )  # fmt: skip
    axes.plot(episodes, mean, color=OURS, linewidth=2.2, label=f"here, mean of {len(ours)} trials")
    for number, theirs in enumerate(reference_curves("2005")):
        axes.plot(
            POINT * (np.arange(len(theirs)) + 1), theirs, "o-", color=REFERENCE, markersize=3,
            linewidth=1.2, label="" if number else "real server, single runs",
        )  # fmt: skip
    axes.set_xlabel("episodes", fontsize=8)
    axes.set_ylabel(f"mean duration of {POINT} episodes (s)", fontsize=8)
    axes.set_ylim(bottom=0)
    axes.tick_params(labelsize=8)
    axes.legend(frameon=False, fontsize=8, loc="upper left")
    return figure
