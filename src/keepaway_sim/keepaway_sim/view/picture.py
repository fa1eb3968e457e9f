"""A picture of one moment of a match."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle, Wedge

from keepaway_sim.bags.match_bag import Track
from keepaway_sim.task import Action, Outcome, Role, Task
from keepaway_sim.view.palette import CHALK, GRASS, INK, TEAM_COLOURS
from keepaway_sim.world.config import NEVER, Physics


def picture(
    track: Track, row: int, task: Task, visible_angle: float = 2 * math.pi, player: int = -1
) -> Figure:
    """One moment from above: players, where they look, the ball and its trail, who passes to whom.

    Args:
        track: the episode.
        row: which of its cycles.
        task: who plays, on what field.
        visible_angle: of the players' views [rad].
        player: whose belief is drawn as hollow marks; -1: none.
    """
    figure = Figure(figsize=(6.4, 6.4 * task.field_width / task.field_length), dpi=150)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    _draw_field(axes, task)
    _draw_trail(axes, track.position[max(0, row - 25) : row + 1, -1])
    for k in range(task.num_players):
        _draw_intent(axes, track, row, k, task)
    for k, name in enumerate(task.player_names):
        role = task.role(k)
        face = track.yaw[row, k] + track.neck[row, k]
        if visible_angle < 2 * math.pi - 1e-6:
            _draw_view(axes, track.position[row, k], face, visible_angle, TEAM_COLOURS[role])
        label = f"{'K' if role == Role.KEEPER else 'T'}{name.split('_')[1]}"
        _draw_player(axes, track.position[row, k], track.yaw[row, k], TEAM_COLOURS[role], label)
    if player >= 0:
        _draw_belief(axes, track, row, player, task)
    axes.add_patch(Circle(track.position[row, -1], 0.3, fc="white", ec=INK, lw=1.2, zorder=6))
    axes.set_title(_caption(track, row), y=0.965, color="white", fontsize=11, weight="bold")
    return figure


def _draw_field(axes: Axes, task: Task) -> None:
    length, width = task.field_length, task.field_width
    axes.set_xlim(-length / 2 - 1.6, length / 2 + 1.6)
    axes.set_ylim(-width / 2 - 1.6, width / 2 + 1.6)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.add_patch(Rectangle((-length, -width), 2 * length, 2 * width, fc=GRASS, zorder=0))
    border = Rectangle((-length / 2, -width / 2), length, width, fill=False, ec=CHALK, lw=2)
    axes.add_patch(border)


def _draw_trail(axes: Axes, ball: np.ndarray) -> None:
    for age in range(1, len(ball)):
        x, y = ball[-age - 1 : len(ball) - age + 1].T
        axes.plot(x, y, color="white", lw=2, alpha=0.75 * (1 - age / 26), zorder=2)


def _draw_intent(axes: Axes, track: Track, row: int, player: int, task: Task) -> None:
    action = track.requested[row, player]
    target = track.requested_target[row, player]
    if action < 0:
        action, target = track.action[row, player], track.target[row, player]
    if action not in (Action.PASS_BALL, Action.MARK_KEEPER):
        return
    ends = track.position[row, [player, target]].T
    style = "--" if action == Action.PASS_BALL else ":"
    axes.plot(*ends, style, color=TEAM_COLOURS[task.role(player)], lw=1.6, zorder=2)


def _draw_view(axes: Axes, at: np.ndarray, face: float, angle: float, colour: str) -> None:
    half = math.degrees(angle) / 2
    middle = math.degrees(face)
    axes.add_patch(
        Wedge((at[0], at[1]), 60.0, middle - half, middle + half, fc=colour, alpha=0.1, zorder=1)
    )


def _draw_player(axes: Axes, at: np.ndarray, yaw: float, colour: str, label: str) -> None:
    radius = 2 * Physics().player_size
    x, y = at
    axes.add_patch(Circle((x, y), radius, fc=colour, ec=INK, lw=1.2, zorder=4))
    ahead = (x + radius * math.cos(yaw), y + radius * math.sin(yaw))
    axes.plot((x, ahead[0]), (y, ahead[1]), color=INK, lw=2, zorder=5)
    axes.annotate(
        label, (x, y - 1.1), color="white", ha="center", va="top", fontsize=9, weight="bold"
    )


def _draw_belief(axes: Axes, track: Track, row: int, player: int, task: Task) -> None:
    for k in range(task.num_players + 1):
        if k == player or track.age[row, player, k] >= NEVER:
            continue
        thought = track.believed[row, player, k]
        colour = "white" if k == task.num_players else TEAM_COLOURS[task.role(k)]
        axes.plot(*np.stack([track.position[row, k], thought]).T, ":", color=colour, lw=1, zorder=3)
        axes.add_patch(Circle(thought, 0.62, fill=False, ec=colour, lw=1.6, zorder=5))


def _caption(track: Track, row: int) -> str:
    seconds = (track.time[row] - track.time[0]) / 1e9
    outcome = Outcome(int(track.outcome[row]))
    words = "" if outcome == Outcome.IN_PLAY else f", {outcome.name.lower().replace('_', ' ')}"
    return f"{seconds:.1f} s{words}"
