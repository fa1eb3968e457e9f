"""Figures of numbers worked out before: nothing is estimated here.

Figures are made without a display and without pyplot's global state. Every file says in its
metadata and in a line below the axes what made it.
"""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import ArrayLike

from keepaway_transfer.metrics import Floats
from keepaway_transfer.reports.statistics import Curve, Interval, SurvivalCurve

ROW_COLOURS = ("#444444", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Okabe and Ito's, which colour-blind people can tell apart; the first is for the scratch row."""
FAINT, BAND = 0.45, 0.18  # opacity of single trials and of intervals
HOURS = "Simulated hours to threshold"
WIDE = 45  # letters of a label that leave no place for another beside it
LINE = 155  # letters of the line below the axes


class CurveGroup(NamedTuple):
    """The learning curves of one row of a study."""

    trials: Floats  # (num_shown, num_points) [s], the ones drawn alone
    mean: Curve  # over all trials of the row


def learning_curves(
    hours: Floats, groups: Mapping[str, CurveGroup], threshold: float | None, title: str
) -> Figure:
    """Figure 3 of the paper: single trials and their mean with its interval, one colour a group.

    Args:
        hours: (num_points,) simulated hours of training.
        groups: label -> curves; the first is drawn grey and dotted, as learning from scratch.
        threshold: of the mean duration, a dashed line [s]; None draws none.
        title: above the axes.
    """
    figure, axes = _figure(title, "Training time (simulated hours)", "Episode duration (s)")
    for (label, group), colour in zip(groups.items(), ROW_COLOURS, strict=False):
        style = ":" if colour == ROW_COLOURS[0] else "-"
        axes.plot(hours, group.trials.T, style, color=colour, linewidth=0.8, alpha=FAINT)
        axes.plot(hours, group.mean.estimate, color=colour, linewidth=2.2, label=label)
        axes.fill_between(
            hours, group.mean.low, group.mean.high, color=colour, alpha=BAND, linewidth=0
        )
    if threshold is not None:
        axes.axhline(threshold, color="black", linestyle="--", linewidth=0.8)
        axes.annotate(
            f"threshold {threshold:g} s", (1, threshold), xycoords=("axes fraction", "data"),
            xytext=(-4, 3), textcoords="offset points", fontsize=8, ha="right",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
        )  # fmt: skip
    axes.set_xlim(left=0)
    figure.legend(
        title="mean of all trials, 95 %; thin: single ones", title_fontsize=8, fontsize=9,
        frameon=False, loc="outside upper center", ncols=1 if max(map(len, groups)) > WIDE else 2,
    )  # fmt: skip
    return figure


def times_by_amount(
    rows: Sequence[str],
    target: Sequence[Interval],
    total: Sequence[Interval],
    scratch: Interval,
    *,
    title: str,
    amount: str,
    beside: str = "from scratch",
) -> Figure:
    """Hours to the threshold by how much of something came before.

    Args:
        rows: label of each row, in order.
        target: hours on the target task alone.
        total: hours on source and target task together.
        scratch: hours of learning from scratch, a band across.
        title: above the axes.
        amount: what the rows have more and more of, below the axes.
        beside: what the band is, if that row does not learn from scratch.
    """
    figure, axes = _figure(title, amount, HOURS)
    axes.axhspan(scratch.low, scratch.high, color=ROW_COLOURS[0], alpha=BAND, linewidth=0)
    axes.axhline(scratch.estimate, color=ROW_COLOURS[0], linestyle=":", label=beside)
    places = np.arange(len(rows))
    for label, intervals, colour, shift in _both_times(target, total):
        estimate, low, high = np.array(intervals).T
        axes.errorbar(
            places + shift, estimate, [estimate - low, high - estimate], color=colour,
            marker="o", markersize=5, capsize=3, linewidth=1.2, label=label,
        )  # fmt: skip
    axes.set_xticks(places, rows)
    axes.set_ylim(bottom=0)
    axes.legend(edgecolor="none")
    return figure


def times_by_way(
    rows: Sequence[str],
    target: Sequence[Interval],
    total: Sequence[Interval],
    scratch: Interval,
    *,
    title: str,
    beside: str = "from scratch",
) -> Figure:
    """Hours to the threshold by the way of transfer, one row under the other.

    Args:
        rows: label of each row, from the top.
        target: hours on the target task alone.
        total: hours on source and target task together.
        scratch: hours of learning from scratch, a band from top to bottom.
        title: above the axes.
        beside: what the band is, if that row does not learn from scratch.
    """
    figure, axes = _figure(title, HOURS, "", height=1.6 + 0.3 * len(rows))
    axes.axvspan(scratch.low, scratch.high, color=ROW_COLOURS[0], alpha=BAND, linewidth=0)
    axes.axvline(scratch.estimate, color=ROW_COLOURS[0], linestyle=":", label=beside)
    places = np.arange(len(rows))[::-1]
    for label, intervals, colour, shift in _both_times(target, total):
        estimate, low, high = np.array(intervals).T
        axes.errorbar(
            estimate, places - shift, xerr=[estimate - low, high - estimate], color=colour,
            marker="o", markersize=5, capsize=3, linewidth=1.2, label=label, linestyle="none",
        )  # fmt: skip
    axes.set_yticks(places, rows)
    axes.set_xlim(left=0)
    axes.legend(edgecolor="none")
    return figure


def _both_times(
    target: Sequence[Interval], total: Sequence[Interval]
) -> list[tuple[str, Sequence[Interval], str, float]]:
    """Label, times, colour and place beside the row's own of the two kinds of hours."""
    return [
        ("of the task alone", target, ROW_COLOURS[1], -0.08),
        ("with the tasks before", total, ROW_COLOURS[2], 0.08),
    ]


def share_reached(curves: Mapping[str, SurvivalCurve], limit: float, title: str) -> Figure:
    """Share of trials that reached the threshold by each hour (one less Kaplan-Meier)."""
    figure, axes = _figure(title, "Training time (simulated hours)", "Share at the threshold")
    for (label, curve), colour in zip(curves.items(), _colours(len(curves)), strict=True):
        times = np.concatenate([[0.0], curve.times, [limit]])
        share = np.concatenate([[1.0], curve.share])
        reached = 1 - np.append(share, share[-1])
        axes.step(times, reached, where="post", color=colour, linewidth=1.5, label=label)
    if all(curve.share.size and curve.share[-1] == 0 for curve in curves.values()):
        limit = min(limit, 1.05 * max(curve.times[-1] for curve in curves.values()))
    axes.set_xlim(0, limit)
    axes.set_ylim(0, 1.02)
    figure.legend(frameon=False, fontsize=8, loc="outside right upper")
    return figure


def intervals(
    labels: Sequence[str],
    estimates: Sequence[Interval],
    *,
    title: str,
    x_label: str,
    zero: bool = False,
) -> Figure:
    """Estimates with their intervals, one under the other; a point alone has no width.

    Args:
        labels: of each, from the top.
        estimates: in the same order.
        title: above the axes.
        x_label: what they are.
        zero: a line where there is no difference; else the axis begins at zero.
    """
    figure, axes = _figure(title, x_label, "")
    places = np.arange(len(labels))[::-1]
    middle, low, high = np.array(estimates).T
    axes.errorbar(
        middle, places, xerr=[middle - low, high - middle], color=ROW_COLOURS[1], marker="o",
        markersize=6, capsize=3, linewidth=1.2, linestyle="none",
    )  # fmt: skip
    axes.set_yticks(places, labels)
    axes.set_ylim(-0.6, len(labels) - 0.4)
    if zero:
        axes.axvline(0, color="black", linestyle="--", linewidth=0.8)
    else:
        axes.set_xlim(left=0)
    return figure


def durations(groups: Mapping[str, tuple[ArrayLike, ArrayLike]], title: str) -> Figure:
    """Distribution of episode durations: the share of episodes still running.

    Args:
        groups: label -> durations [s] of first episodes (dotted) and of last ones.
        title: above the axes.
    """
    figure, axes = _figure(title, "Time since kick-off (s)", "Share of episodes still running")
    for (label, (first, last)), colour in zip(groups.items(), _colours(len(groups)), strict=True):
        starts, ends = (np.sort(np.asarray(one, dtype=np.float64)) for one in (first, last))
        label = f"{label} (mean {starts.mean():.1f} s, then {ends.mean():.1f} s)"
        for ordered, style, name in ((starts, ":", None), (ends, "-", label)):
            going_on = 1 - np.arange(1, len(ordered) + 1) / len(ordered)
            axes.step(
                np.concatenate([[0.0], ordered]), np.concatenate([[1.0], going_on]), style,
                where="post", color=colour, linewidth=1.5, label=name,
            )  # fmt: skip
    axes.set_xlim(left=0)
    axes.set_ylim(0, 1.02)
    figure.legend(frameon=False, fontsize=9, loc="outside upper center")
    return figure


def save_figure(figure: Figure, path: Path | str, made_by: str) -> None:
    """Write a PNG that names what made it: study, settings, seed, version."""
    figure.text(0.01, 0.005, textwrap.fill(made_by, LINE), fontsize=6, color="0.4")
    figure.savefig(path, dpi=150, metadata={"Description": made_by})


def _figure(title: str, x_label: str, y_label: str, height: float = 4.6) -> tuple[Figure, Axes]:
    made_by = 0.23 / height  # two lines below the axes
    figure = Figure(
        figsize=(7.2, height), layout=ConstrainedLayoutEngine(rect=(0, made_by, 1, 1 - made_by))
    )
    axes = figure.add_subplot()
    axes.set_title(title, fontsize=11, loc="left")
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _colours(count: int) -> list[str]:
    """`count` colours to tell lines apart: the palette's, or a scale if it has too few."""
    if count <= len(ROW_COLOURS):
        return list(ROW_COLOURS[:count])
    return [to_hex(colour) for colour in colormaps["viridis"](np.linspace(0, 0.95, count))]
