"""What a weights file holds, in words and pictures that a person can read.

An action's value is a sum over state variables, so what was learned can be drawn variable by
variable without leaving anything out (`draw_values`); and where on the field which action comes
out best is shown on scenes in which one taker is put everywhere in turn (`draw_preferences`).
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from keepaway_agent.actions import Role
from keepaway_agent.learning.cmac import NUM_TILINGS, action_values, state_cells
from keepaway_agent.learning.features import (
    ORDERINGS,
    keeper_state,
    nearest_to_ball,
    rank_players,
    taker_state,
)
from keepaway_agent.learning.weights import LearnedWeights

if TYPE_CHECKING:  # half of what describing in words would import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINE_COLOURS: Final = ("#e69f00", "#0072b2", "#009e73", "#cc79a7", "#d55e00", "#56b4e9", "#444444")
"""Okabe and Ito's, which colour-blind people can tell apart; the first is the first action's."""
TAKER_DISTANCE: Final = 5.0  # [m] of the scene's takers from the ball's holder
TAKER_SPREAD: Final = math.radians(30.0)  # between two of them, as K1 sees them
PALEST: Final = 0.3  # share of an action's colour where it is hardly better than the next
UNTRAINED: Final = (0.93, 0.93, 0.93)
PLACES: Final = 61  # places along a side at which the moving taker is put


class Preferences(NamedTuple):
    """Which action is valued most at each of some places."""

    action: np.ndarray  # (num_y, num_x) int, of the greatest value; -1 where all are equal
    margin: np.ndarray  # (num_y, num_x) [cycles] how much better than the second


def contributions(weights: LearnedWeights) -> np.ndarray:
    """What each state variable adds to each action's value, (num_actions, num_features, num_cells).

    The last axis counts fine cells: cell c begins c / 32 tile widths above the variable's low end.
    """
    flat = weights.values.reshape(*weights.values.shape[:2], -1)
    sums = np.cumsum(np.concatenate([np.zeros((*flat.shape[:2], 1)), flat], axis=2), axis=2)
    return np.asarray(sums[:, :, NUM_TILINGS:] - sums[:, :, :-NUM_TILINGS])


def describe(weights: LearnedWeights) -> str:
    """A weights file in words."""
    learner, tiling = weights.sarsa, weights.tiling
    ordered = {"ball": "to the ball", "k1": "to K1"}[weights.ordering]
    lines = [
        f"{weights.player or 'unnamed'}, a {weights.role.name.lower()} in {weights.task} on"
        f" {weights.field_length:g} m x {weights.field_width:g} m",
        f"learned from {weights.episodes:,} episodes, {weights.hours:.1f} simulated hours",
        f"alpha {learner.alpha:g}, gamma {learner.gamma:g}, lambda {learner.lambda_:g},"
        f" epsilon {learner.epsilon:g}",
        f"seed {weights.seed}, code {weights.code_version or 'unknown'},"
        f" made by {weights.created_by or 'unknown'}",
        f"players ranked by distance {ordered}; {NUM_TILINGS} tilings of {tiling.num_tiles} tiles",
        "",
        "What each variable adds to each action's value, least to greatest [cycles]:",
        _row("variable", "tile", "trained", *weights.action_names),
    ]
    added = contributions(weights)
    for i, (name, width) in enumerate(zip(tiling.feature_names, tiling.widths, strict=True)):
        trained = np.count_nonzero(weights.values[:, i]) / weights.values[:, i].size
        spans = [f"{each.min():.1f} to {each.max():.1f}" for each in added[:, i]]
        lines.append(_row(name, _with_unit(width, name), f"{trained:.0%}", *spans))
    return "\n".join(lines)


def draw_values(weights: LearnedWeights) -> Figure:
    """What each state variable adds to each action's value, a panel for each variable."""
    from matplotlib.figure import Figure

    tiling, added = weights.tiling, contributions(weights)
    columns = 4
    rows = math.ceil(tiling.num_features / columns)
    figure = Figure(figsize=(3.2 * columns, 2.2 * rows + 0.6), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).flat
    for i, axes in enumerate(panels):
        if i >= tiling.num_features:
            axes.set_axis_off()
            continue
        name = tiling.feature_names[i]
        factor = math.degrees(1.0) if _is_angle(name) else 1.0
        low, high, width = tiling.lows[i], tiling.highs[i], tiling.widths[i]
        x = low + np.arange(added.shape[2]) * width / NUM_TILINGS
        shown = x <= high
        curves = added[:, i, shown]
        for action, colour in zip(range(len(curves)), itertools.cycle(LINE_COLOURS), strict=False):
            hides_one = (curves[:action] == curves[action]).all(axis=1).any()
            style = "--" if hides_one else "-"  # after rho, two actions have the same weights
            axes.plot(factor * x[shown], curves[action], style, color=colour, linewidth=1.2)
        axes.set_xlabel(f"{name} [{'deg' if _is_angle(name) else 'm'}]")
        axes.grid(alpha=0.3)
    figure.supylabel("adds to the action's value [cycles]")
    _legend(figure, weights)
    return figure


def draw_preferences(weights: LearnedWeights) -> Figure:
    """Which action is valued most as one taker moves: over the field, and across the pass to K2."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 5.2), layout="constrained")
    field, lane = figure.subplots(1, 2)
    half_length, half_width = weights.field_length / 2, weights.field_width / 2
    x, y = (
        np.linspace(-half_length, half_length, PLACES),
        np.linspace(-half_width, half_width, PLACES),
    )
    _draw_map(field, weights, x, y, preferences(weights, *np.meshgrid(x, y)))
    _draw_players(field, weights)
    field.set(xlabel="x [m]", ylabel="y [m]", title=f"where {_mover(weights)} stands")
    field.set_aspect("equal")
    distances, angles = np.linspace(0.5, 15.0, PLACES), np.linspace(0.0, 90.0, PLACES)
    taker_x, taker_y = _around_k1(weights, *np.meshgrid(distances, angles))
    _draw_map(lane, weights, distances, angles, preferences(weights, taker_x, taker_y))
    lane.set(
        xlabel=f"distance of {_mover(weights)} from K1 [m]",
        ylabel="its angle from the pass lane to K2 [deg]",
        title="near and in the pass lane",
    )
    decider = "K1" if weights.role == Role.KEEPER else "the taker"
    figure.supxlabel(
        f"Colour: what {decider} prefers with {_mover(weights)} there; the paler, the less decided;"
        " grey: never learned. Circles: keepers; T: the other takers, which stay.",
        fontsize=9,
    )
    _legend(figure, weights)
    return figure


def save(figure: Figure, path: Path, made_by: str = "") -> None:
    """Write a picture; its metadata say what made it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130, metadata={"Description": made_by})


def scene(weights: LearnedWeights) -> np.ndarray:
    """A typical moment, (num_players + 1, 2) [m]: K1 holds the ball in a corner of the field.

    Keepers stand on a ring, the first with the ball and the second nearest to it; takers come at
    the ball from the centre, side by side. The moving taker is the first of them.
    """
    n, m = weights.num_keepers, weights.num_takers
    size = np.array([weights.field_length, weights.field_width])
    corner = -0.75 * math.pi
    ring = [corner + 2 * math.pi / n * (k - 0.25 * (k > 0)) for k in range(n)]
    keepers = [0.38 * size * (math.cos(a), math.sin(a)) for a in ring]
    coming = [corner + math.pi + TAKER_SPREAD * (j - (m - 1) / 2) for j in range(m)]
    takers = [keepers[0] + TAKER_DISTANCE * np.array((math.cos(a), math.sin(a))) for a in coming]
    lane = keepers[1] - keepers[0]
    ball = keepers[0] + 0.6 * lane / np.linalg.norm(lane)
    return np.array([*keepers, *takers, ball])


def preferences(weights: LearnedWeights, taker_x: np.ndarray, taker_y: np.ndarray) -> Preferences:
    """What is valued most when the first taker of the scene stands at these places [m]."""
    position, values = scene(weights), np.zeros((*taker_x.shape, len(weights.action_names)))
    for at in np.ndindex(taker_x.shape):
        position[weights.num_keepers] = taker_x[at], taker_y[at]
        values[at] = values_in(weights, position)
    ranked = np.sort(values, axis=-1)
    margin = ranked[..., -1] - ranked[..., -2]
    return Preferences(np.where(margin > 0, values.argmax(axis=-1), -1), margin)


def values_in(weights: LearnedWeights, position: np.ndarray) -> np.ndarray:
    """The value of every action (num_actions,) when all stand at these places.

    The player who decides is the keeper nearest to the ball, or the first taker.
    """
    n, num_players = weights.num_keepers, weights.num_keepers + weights.num_takers
    order = np.zeros(num_players, dtype=np.int64)
    state, values = np.zeros(weights.tiling.num_features), np.zeros(len(weights.action_names))
    keeps = weights.role == Role.KEEPER
    k1, t1 = nearest_to_ball(position, 0, n), -1 if keeps else n
    rank_players(position, n, k1, t1, ORDERINGS[weights.ordering if keeps else "ball"], order)
    (keeper_state if keeps else taker_state)(position, order, n, state)
    flat = weights.values.reshape(*weights.values.shape[:2], -1)
    action_values(flat, state_cells(state, weights.tiling), values)
    return values


def _around_k1(
    weights: LearnedWeights, distance: np.ndarray, angle: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Places at a distance [m] from K1 and an angle [deg] from the lane to K2."""
    position = scene(weights)
    lane = position[1] - position[0]
    heading = math.atan2(lane[1], lane[0]) + np.radians(angle)
    return position[0, 0] + distance * np.cos(heading), position[0, 1] + distance * np.sin(heading)


def _draw_map(
    axes: Axes, weights: LearnedWeights, x: np.ndarray, y: np.ndarray, shown: Preferences
) -> None:
    """Each place in the colour of its action, the paler the smaller the margin."""
    from matplotlib.colors import to_rgb

    own = itertools.islice(itertools.cycle(LINE_COLOURS), len(weights.action_names))
    colours = np.array([*map(to_rgb, own), UNTRAINED])  # the last is for -1
    strong = np.quantile(shown.margin, 0.8) or 1.0
    depth = np.clip(PALEST + (1.0 - PALEST) * shown.margin / strong, 0.0, 1.0)[..., None]
    pixels = 1.0 - depth * (1.0 - colours[shown.action])
    pixels[shown.action < 0] = UNTRAINED
    extent = (x[0], x[-1], y[0], y[-1])
    axes.imshow(pixels, origin="lower", extent=extent, aspect="auto", interpolation="nearest")


def _draw_players(axes: Axes, weights: LearnedWeights) -> None:
    position, n = scene(weights), weights.num_keepers
    for rank, (x, y) in enumerate(position[:n], start=1):
        axes.plot(x, y, "o", markersize=14, color="white", markeredgecolor="black")
        axes.annotate(f"K{rank}", (x, y), ha="center", va="center", fontsize=8)
    for x, y in position[n + 1 : -1]:
        axes.plot(x, y, "^", markersize=13, color="white", markeredgecolor="black")
        axes.annotate("T", (x, y), ha="center", va="center", fontsize=8)
    axes.plot(*position[-1], "o", markersize=5, color="white", markeredgecolor="black")


def _legend(figure: Figure, weights: LearnedWeights) -> None:
    from matplotlib.patches import Patch

    names = zip(weights.action_names, itertools.cycle(LINE_COLOURS), strict=False)
    handles = [Patch(color=colour, label=name) for name, colour in names]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), frameon=False)


def _mover(weights: LearnedWeights) -> str:
    return "a taker" if weights.role == Role.KEEPER else "the taker"


def _is_angle(name: str) -> bool:
    return "ang_" in name


def _with_unit(value: float, name: str) -> str:
    return f"{math.degrees(value):g} deg" if _is_angle(name) else f"{value:g} m"


def _row(name: str, *cells: str) -> str:
    return f"{name:<14}{cells[0]:>8}{cells[1]:>9}" + "".join(f"{cell:>18}" for cell in cells[2:])
