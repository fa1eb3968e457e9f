"""A tally written for people and for programs: summary, table, figures."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow.csv import ConvertOptions, open_csv

from keepaway_sim.analysis.figures import (
    WITH_BALL,
    actions_figure,
    hold_time_figure,
    losses_figure,
    passes_figure,
    unknown_figure,
)
from keepaway_sim.analysis.tally import Analyst, EpisodeRow, Tally
from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.task import Action, Outcome, Task

TABLE_SCHEMA = pa.schema(
    [
        (name, {int: pa.int64(), float: pa.float64(), str: pa.string()}[kind])
        for name, kind in {
            "number": int, "start_s": float, "cycles": int, "duration_s": float, "outcome": str,
            "lost_by": str, "lost_x": float, "lost_y": float, "passes": int, "decisions": int,
            "holds": int, "held_cycles": int,
        }.items()
    ]
)  # fmt: skip


def analyse(path: Path | str, output: Path, number: int | None = None) -> str:
    """Write table and figures of a bag, and give a summary in words.

    Writes `episodes.csv`, `episodes.parquet`, `summary.json`, and four figures.

    Args:
        path: the bag.
        output: folder to write to.
        number: of the match, from 1 on, where the bag has several.

    Raises:
        KeepawayError: no such bag, or one that does not fit its match.
    """
    bag = MatchBag(path, number)
    analyst = Analyst(bag)
    output.mkdir(parents=True, exist_ok=True)
    _write_table(analyst.rows(), output)
    tally, task = analyst.tally, bag.task
    summary = summarise_match(bag, tally) | {"missing": analyst.gaps.report()}
    (output / "summary.json").write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n")
    made_by = f"{bag.match['task']}, seed {bag.match['seed']}, {bag.match['code_version']}"
    draw(tally, task, made_by, output)
    return in_words(summary)


def draw(tally: Tally, task: Task, made_by: str, output: Path) -> None:
    """Write the four figures; `made_by` stands in each."""
    for name, figure in (
        ("hold_time", hold_time_figure(np.array(tally.durations))),
        ("passes", passes_figure(tally.passes, task) if tally.whole else unknown_figure("Passes")),
        ("losses", losses_figure(np.array(tally.losses).reshape(-1, 3), task)),
        ("actions", actions_figure(tally.actions, task)),
    ):
        figure.text(0.01, 0.005, made_by, fontsize=6, color="0.4", parse_math=False)
        figure.savefig(output / f"{name}.png", dpi=150, metadata={"Description": made_by})


def _write_table(rows: Iterator[EpisodeRow], output: Path) -> None:
    """Write the rows as they come, then the same table as Parquet.

    From the file, because what makes Arrow's arrays of Python's lists imports pandas: a second, and
    90 MB of memory.
    """
    with (output / "episodes.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(EpisodeRow._fields)
        writer.writerows(rows)
    types = ConvertOptions(column_types=TABLE_SCHEMA)
    with (
        open_csv(output / "episodes.csv", convert_options=types) as batches,
        pq.ParquetWriter(output / "episodes.parquet", TABLE_SCHEMA) as parquet,
    ):
        for batch in batches:
            parquet.write_batch(batch)


def summarise_match(bag: MatchBag, tally: Tally) -> dict[str, Any]:
    """A match in a few numbers."""
    durations = np.array(tally.durations)
    outcomes = np.array(tally.outcomes, dtype=np.int64)
    count, whole = len(durations), tally.whole
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
        "messages": bag.message_count,
        "episodes": count,
        "mean_duration_s": float(durations.mean()) if count else None,
        "sem_duration_s": float(durations.std(ddof=1) / np.sqrt(count)) if count > 1 else None,
        "out_of_bounds_share": float((outcomes == Outcome.OUT_OF_BOUNDS).mean()) if count else None,
        "whole_episodes": whole,
        "passes": tally.passes.tolist() if whole else None,
        "passes_per_episode": float(tally.passes.sum() / whole) if whole else None,
        "actions": actions,
    }


def in_words(summary: Mapping[str, Any]) -> str:
    """A summary as lines for a person."""
    if not summary["episodes"]:
        return (
            f"{summary['task']}: no finished episode in {summary['messages']:,} messages\n"
            f"{summary['missing']}"
        )
    sem = summary["sem_duration_s"]
    # Episodes of players that learn depend on each other; a bag does not tell who learned.
    spread = f" +- {sem:.2f} (standard error, if no player learned)" if sem is not None else ""
    lines = [
        f"{summary['task']}: {summary['episodes']:,} episodes in {summary['messages']:,} messages",
        f"held {summary['mean_duration_s']:.2f} s{spread} on average,"
        f" {summary['out_of_bounds_share']:.0%} ended out of bounds,"
        f" {_passes(summary)}",
        summary["missing"],
    ]
    with_ball = {action.name.lower() for action in WITH_BALL}
    for name, actions in summary["actions"].items():
        choices = {action: n for action, n in actions.items() if action in with_ball}
        others = {action: n for action, n in actions.items() if action not in with_ball}
        said = [_shares(choices, " with the ball"), _shares(others, "")]
        lines.append(f"{name}: {'; '.join(filter(None, said)) or 'no request was recorded'}")
    return "\n".join(lines)


def _passes(summary: Mapping[str, Any]) -> str:
    whole, count = summary["whole_episodes"], summary["episodes"]
    if not whole:
        return "passes are not known: field states are missing of every episode"
    of_them = "" if whole == count else f" (in the {whole:,} that have all their field states)"
    return f"{summary['passes_per_episode']:.1f} passes arrived an episode{of_them}"


def _shares(actions: Mapping[str, int], when: str) -> str:
    total = sum(actions.values())
    shares = ", ".join(f"{name} {count / total:.0%}" for name, count in actions.items())
    return shares and f"{shares} of {total:,} requests{when}"
