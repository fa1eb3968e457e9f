"""What happened in a recorded match: a row for every episode, passes, losses, actions; and figures.

A bag is read once, chunk by chunk, and the rows are written as they are made: memory does not grow
with the bag but by a few numbers an episode.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from keepaway_sim.bags.match_bag import EpisodeSummary, MatchBag, episode_summaries
from keepaway_sim.bags.writer import Batch
from keepaway_sim.task import Action, Outcome, Task

ROWS_AT_ONCE = 5000  # episodes that are written together
COLOURS = {Outcome.TAKEN_AWAY: "#d55e00", Outcome.OUT_OF_BOUNDS: "#8a5fb0"}
BLUE = "#0072b2"
ACTION_COLOURS = (BLUE, "#56b4e9", "#009e73", "#e69f00", "#cc79a7")
WITH_BALL = (Action.HOLD_BALL, Action.PASS_BALL)


class EpisodeRow(NamedTuple):
    """One episode of the table."""

    number: int
    start_s: float  # simulated time of the kick-off
    cycles: int
    duration_s: float
    outcome: str  # "taken_away", "out_of_bounds" or "aborted"
    lost_by: str  # the keeper that had the ball last, or empty
    lost_x: float  # where the ball was at the end [m]
    lost_y: float
    passes: int  # that arrived at another keeper
    decisions: int  # of keepers with the ball: holds and passes asked for
    holds: int  # those of them that were holds
    held_cycles: int  # with the ball within a keeper's reach


SCHEMA = pa.schema(
    [
        (name, {int: pa.int64(), float: pa.float64(), str: pa.string()}[kind])
        for name, kind in {
            "number": int, "start_s": float, "cycles": int, "duration_s": float, "outcome": str,
            "lost_by": str, "lost_x": float, "lost_y": float, "passes": int, "decisions": int,
            "holds": int, "held_cycles": int,
        }.items()
    ]
)  # fmt: skip


@dataclass
class Tally:
    """What a match's table does not say by episode.

    Attributes:
        passes: (num_keepers, num_keepers), from whom to whom the ball went.
        actions: (num_players, num_actions) requests.
        losses: where the ball was at the end of episodes, x and y [m] and the outcome.
        durations: of the episodes [s].
    """

    passes: np.ndarray
    actions: np.ndarray
    losses: list[tuple[float, float, int]]
    durations: list[float]


class _Partial:
    """What is known so far of an episode that goes on."""

    __slots__ = ("ball", "decisions", "held", "holds", "passes")

    def __init__(self) -> None:
        self.passes = self.decisions = self.holds = self.held = 0
        self.ball = (float("nan"), float("nan"))


class Analyst:
    """Reads a bag once, giving a row for every finished episode; the rest is in `tally`.

    Attributes:
        bag: the match.
        tally: filled while `rows` is consumed.
    """

    def __init__(self, bag: MatchBag) -> None:
        """Begin with nothing counted."""
        task, physics = bag.task, bag.config.physics
        self.bag = bag
        self.tally = Tally(
            passes=np.zeros((task.num_keepers, task.num_keepers), dtype=np.int64),
            actions=np.zeros((task.num_players, len(Action)), dtype=np.int64),
            losses=[],
            durations=[],
        )
        self._reach = physics.player_size + physics.ball_size + physics.kickable_margin
        self._partial: dict[int, _Partial] = {}
        self._last = (-1, -1)  # episode, and the last keeper in it that had the ball
        self._requests = {
            topic: player for player, topic in enumerate(bag.player_topics("action_request"))
        }

    def rows(self) -> Iterator[EpisodeRow]:
        """The table's rows, in order."""
        states, episodes = self.bag.topic("field_state"), self.bag.topic("episode")
        waiting: list[EpisodeSummary] = []
        newest = -1
        for batch in self.bag.reader.batches([states, episodes, *self._requests]):
            if batch.topic == episodes:
                waiting += episode_summaries(batch)
            elif batch.topic == states:
                self._add_states(batch)
                newest = int(batch.data["episode"][-1])
            else:
                self._add_requests(self._requests[batch.topic], batch)
            while waiting and waiting[0].number + 1 < newest:
                yield self._row(waiting.pop(0))
        for episode in waiting:
            yield self._row(episode)

    def _row(self, episode: EpisodeSummary) -> EpisodeRow:
        known = self._partial.pop(episode.number, None) or _Partial()
        self.tally.durations.append(episode.duration)
        self.tally.losses.append((*known.ball, int(episode.outcome)))
        by = episode.lost_by
        return EpisodeRow(
            number=episode.number,
            start_s=episode.start / 1e9,
            cycles=episode.cycles,
            duration_s=round(episode.duration, 6),
            outcome=episode.outcome.name.lower(),
            lost_by=self.bag.match["player_names"][by] if by >= 0 else "",
            lost_x=known.ball[0],
            lost_y=known.ball[1],
            passes=known.passes,
            decisions=known.decisions,
            holds=known.holds,
            held_cycles=known.held,
        )

    def _of(self, episode: int) -> _Partial:
        return self._partial.setdefault(episode, _Partial())

    def _add_states(self, batch: Batch) -> None:
        data = batch.data
        position = data["positions"].reshape(len(data), -1, 2)
        keepers = position[:, : self.bag.task.num_keepers]
        away = np.linalg.norm(keepers - position[:, -1:], axis=2)
        holder = np.where(away.min(axis=1) < self._reach, away.argmin(axis=1), -1)
        held = holder >= 0
        episode = data["episode"].astype(np.int64)
        for number, count in zip(*np.unique(episode[held], return_counts=True), strict=True):
            self._of(int(number)).held += int(count)
        self._add_passes(episode[held], holder[held])
        for row in np.flatnonzero(data["outcome"] != Outcome.IN_PLAY).tolist():
            x, y = position[row, -1].tolist()
            self._of(int(episode[row])).ball = (x, y)

    def _add_passes(self, episode: np.ndarray, holder: np.ndarray) -> None:
        """Count who had the ball after whom; rows without a holder are left out."""
        if not len(holder):
            return
        before = np.concatenate([[self._last[1]], holder[:-1]])
        same = np.concatenate([[self._last[0]], episode[:-1]]) == episode
        passed = same & (before != holder)
        np.add.at(self.tally.passes, (before[passed], holder[passed]), 1)
        numbers, counts = np.unique(episode[passed], return_counts=True)
        for number, count in zip(numbers.tolist(), counts.tolist(), strict=True):
            self._of(number).passes += count
        self._last = int(episode[-1]), int(holder[-1])

    def _add_requests(self, player: int, batch: Batch) -> None:
        action = batch.data["action"]
        self.tally.actions[player] += np.bincount(action, minlength=len(Action))[: len(Action)]
        if player >= self.bag.task.num_keepers:
            return
        for wanted in (Action.HOLD_BALL, Action.PASS_BALL):
            numbers, counts = np.unique(batch.data["episode"][action == wanted], return_counts=True)
            for number, count in zip(numbers.tolist(), counts.tolist(), strict=True):
                partial = self._of(number)
                partial.decisions += count
                partial.holds += count if wanted == Action.HOLD_BALL else 0


def analyse(path: Path | str, output: Path) -> str:
    """Write table and figures of a bag, and give a summary in words.

    Writes `episodes.csv`, `episodes.parquet`, `summary.json`, and four figures.

    Args:
        path: the bag.
        output: folder to write to.

    Raises:
        KeepawayError: no such bag.
    """
    bag = MatchBag(path)
    output.mkdir(parents=True, exist_ok=True)
    analyst = Analyst(bag)
    _write_table(analyst.rows(), output)
    tally, task = analyst.tally, bag.task
    summary = summarise(bag, tally)
    (output / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    made_by = f"{bag.match['task']}, seed {bag.match['seed']}, {bag.match['code_version']}"
    for name, figure in (
        ("hold_time", hold_time_figure(np.array(tally.durations))),
        ("passes", passes_figure(tally.passes, task)),
        ("losses", losses_figure(np.array(tally.losses).reshape(-1, 3), task)),
        ("actions", actions_figure(tally.actions, task)),
    ):
        figure.text(0.01, 0.005, made_by, fontsize=6, color="0.4")
        figure.savefig(output / f"{name}.png", dpi=150, metadata={"Description": made_by})
    return in_words(summary)


def episode_table(path: Path | str) -> pd.DataFrame:
    """The table of a bag's finished episodes, a row each (see `EpisodeRow`)."""
    rows = list(Analyst(MatchBag(path)).rows())
    return pd.DataFrame(rows, columns=list(EpisodeRow._fields))


def _write_table(rows: Iterator[EpisodeRow], output: Path) -> None:
    with ExitStack() as stack:
        parquet = stack.enter_context(pq.ParquetWriter(output / "episodes.parquet", SCHEMA))
        file = stack.enter_context((output / "episodes.csv").open("w", newline=""))
        writer = csv.writer(file)
        writer.writerow(EpisodeRow._fields)
        pending: list[EpisodeRow] = []
        for row in rows:
            writer.writerow(row)
            pending.append(row)
            if len(pending) == ROWS_AT_ONCE:
                parquet.write_table(_arrow(pending))
                pending.clear()
        parquet.write_table(_arrow(pending))


def _arrow(rows: list[EpisodeRow]) -> pa.Table:
    columns = zip(*rows, strict=True) if rows else ((),) * len(SCHEMA)
    return pa.table([list(column) for column in columns], schema=SCHEMA)


def summarise(bag: MatchBag, tally: Tally) -> dict[str, Any]:
    """A match in a few numbers."""
    durations = np.array(tally.durations)
    outcomes = np.array([outcome for *_, outcome in tally.losses], dtype=np.int64)
    count = len(durations)
    actions = {
        name: {
            action.name.lower(): int(number)
            for action, number in zip(Action, tally.actions[player], strict=True)
            if number
        }
        for player, name in enumerate(bag.match["player_names"])
    }
    return {
        "task": bag.match["task"],
        "seed": bag.match["seed"],
        "code_version": bag.match["code_version"],
        "messages": bag.reader.message_count,
        "episodes": count,
        "mean_duration_s": float(durations.mean()) if count else None,
        "sem_duration_s": float(durations.std(ddof=1) / np.sqrt(count)) if count > 1 else None,
        "out_of_bounds_share": float((outcomes == Outcome.OUT_OF_BOUNDS).mean()) if count else None,
        "passes": tally.passes.tolist(),
        "passes_per_episode": float(tally.passes.sum() / count) if count else None,
        "actions": actions,
    }


def in_words(summary: Mapping[str, Any]) -> str:
    """A summary as lines for a person."""
    if not summary["episodes"]:
        return f"{summary['task']}: no finished episode in {summary['messages']:,} messages"
    sem = summary["sem_duration_s"]
    spread = f" +- {sem:.2f}" if sem is not None else ""
    lines = [
        f"{summary['task']}: {summary['episodes']:,} episodes in {summary['messages']:,} messages",
        f"held {summary['mean_duration_s']:.2f}{spread} s on average,"
        f" {summary['out_of_bounds_share']:.0%} ended out of bounds,"
        f" {summary['passes_per_episode']:.1f} passes arrived an episode",
    ]
    with_ball = {action.name.lower() for action in WITH_BALL}
    for name, actions in summary["actions"].items():
        choices = {action: n for action, n in actions.items() if action in with_ball}
        others = {action: n for action, n in actions.items() if action not in with_ball}
        said = [_shares(choices, " with the ball"), _shares(others, "")]
        lines.append(f"{name}: {'; '.join(filter(None, said)) or 'asked for nothing'}")
    return "\n".join(lines)


def _shares(actions: Mapping[str, int], when: str) -> str:
    total = sum(actions.values())
    shares = ", ".join(f"{name} {count / total:.0%}" for name, count in actions.items())
    return shares and f"{shares} of {total:,} requests{when}"


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


def losses_figure(losses: np.ndarray, task: Task) -> Figure:
    """Where the ball was when episodes ended; (n, 3) x, y [m], outcome."""
    figure, axes = _figure("Where the ball was lost", "x (m)", "y (m)")
    figure.set_size_inches(5.6, 5.6)
    length, width = task.field_length, task.field_width
    border = Rectangle((-length / 2, -width / 2), length, width, fill=False, edgecolor="0.3")
    axes.add_patch(border)
    every, size = max(1, len(losses) // 4000), 1.5 * _dot(len(losses))
    for outcome, colour in COLOURS.items():
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
        ncols=len(COLOURS),
        fontsize=8,
        markerscale=7.0 / size,
    )
    return figure


def actions_figure(actions: np.ndarray, task: Task) -> Figure:
    """What players asked for, in shares: keepers with the ball, and everybody without it."""
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
    """The size [points] of each of so many dots."""
    return float(np.clip(40 / np.sqrt(max(count, 1)), 1.5, 5.0))


def _figure(title: str, x_label: str, y_label: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    axes = figure.add_subplot()
    axes.set_title(title, fontsize=11, loc="left")
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes
