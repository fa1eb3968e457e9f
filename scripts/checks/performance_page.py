"""Keep the figures of `benchmark.py` as JSON beside the performance page, and write its tables.

A test holds the page to what is kept.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "src/keepaway_sim/docs/performance.md"
KEPT = PAGE.with_suffix(".json")
BEGIN, END = "<!-- figures: begin -->\n", "<!-- figures: end -->"

Runs = Sequence[Mapping[str, float]]


class Row(NamedTuple):
    """A line of the page's table."""

    text: str
    figure: str
    form: str = "{:.1f} us"
    base: str = ""  # the figure that it is told as a multiple of


FLOOR, ROS_FLOOR = "floor_us", "ros_floor_cps"
TABLES = {
    "One process, CPU time of a field-cycle (0.1 s of one field), 128 fields side by side": (
        Row("bare pymunk: set, step and get the same bodies (the floor)", FLOOR, "{:.2f} us"),
        Row("World, hand-coded 3v2", "world_3v2_us", base=FLOOR),
        Row("World with learning 3v2", "learn_3v2_us", base=FLOOR),
        Row("ditto, 32 fields", "learn_3v2_32_fields_us", base="learn_3v2_us"),
        Row("ditto, 256 fields", "learn_3v2_256_fields_us", base="learn_3v2_us"),
        Row("World with learning 4v3", "learn_4v3_us", base=FLOOR),
        Row("World with learning 5v4", "learn_5v4_us", base=FLOOR),
        Row("of learning 3v2: what players perceive", "3v2_perception_us", base="learn_3v2_us"),
        Row("their commands", "3v2_commands_us", base="learn_3v2_us"),
        Row("decisions and learning", "3v2_decisions_us", base="learn_3v2_us"),
        Row("pymunk", "3v2_pymunk_us", base="learn_3v2_us"),
        Row("random numbers", "3v2_random_us", base="learn_3v2_us"),
        Row("Python", "3v2_rest_us", base="learn_3v2_us"),
        Row("vector environment, random choices, share of the trainer's", "vector_share", "{:.2f}"),
        Row("two processes against one", "two_process_speedup", "{:.2f}"),
        Row("peak memory", "peak_rss_mb", "{:.0f} MB"),
    ),
    "Starting, by the wall's clock": (
        Row("a first training, compiled from nothing", "compile_cold_s", "{:.0f} s"),
        Row("from machine code on disk", "compile_warm_s", "{:.1f} s"),
        Row("`match.py --episodes 1` to its first cycle", "first_cycle_s", "{:.1f} s"),
    ),
    "Studies": (
        Row(
            "4v3 from scratch, hours of play a minute and worker", "study_hours_a_minute", "{:.0f}"
        ),
    ),
    "Over ROS, by the wall's clock, 3v2, six processes": (
        Row("ping-pong of a match's messages", ROS_FLOOR, "{:,.0f} cycles/s"),
        Row(
            "ditto, all of it sent to one more process, too, that reads nothing",
            "ros_overheard_cps",
            "{:,.0f} cycles/s",
            ROS_FLOOR,
        ),
        Row("a match of learning keepers", "ros_match_cps", "{:,.0f} cycles/s", ROS_FLOOR),
        Row("recorded by the simulator", "ros_bag_cps", "{:,.0f} cycles/s", "ros_match_cps"),
        Row("recorded by the recorder", "ros_recorded_cps", "{:,.0f} cycles/s", "ros_match_cps"),
        Row("all in one process", "ros_single_process_cps", "{:,.0f} cycles/s", "ros_match_cps"),
    ),
}


def keep(runs: Runs, command: str, version: str) -> None:
    """Keep the figures of some runs, and write the page from them."""
    kept = {
        "command": command,
        "code_version": version,
        "cores": os.cpu_count(),
        "processor": processor(),
        "runs": [{name: round(value, 4) for name, value in run.items()} for run in runs],
    }
    KEPT.write_text(json.dumps(kept, indent=1, allow_nan=False) + "\n")
    PAGE.write_text(written(PAGE.read_text(), kept))


def processor() -> str:
    """What kind of processor this is."""
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def written(text: str, kept: Mapping[str, Any]) -> str:
    """The page with its figures written anew."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    count = len(kept["runs"])
    made = (
        f"`{kept['command']}`, version {kept['code_version']}, {kept['cores']} cores of an"
        f" {kept['processor']}: medians of {count} run{'s' * (count > 1)}, in brackets the lowest"
        " and the highest."
    )
    return "".join([before, BEGIN, made, "\n\n", *tables(kept["runs"]), END, after])


def tables(runs: Runs) -> Iterable[str]:
    """All tables that some run has a figure for."""
    for title, rows in TABLES.items():
        lines = [line(row, runs) for row in rows if any(row.figure in run for run in runs)]
        if lines:
            head = f"| {title} | | |\n|---|---|---|\n"
            yield head + "\n".join(lines) + "\n\n"


def line(row: Row, runs: Runs) -> str:
    """A line: the median, the range, and how many times its base it is in the same run."""
    values = [run[row.figure] for run in runs if row.figure in run]
    middle, low, high = (row.form.format(f(values)) for f in (np.median, min, max))
    extent = f" ({low} to {high})" if low != high else ""
    share = ""
    if row.base:
        ratios = [run[row.figure] / run[row.base] for run in runs if row.figure in run]
        base = {FLOOR: "x the floor", ROS_FLOOR: "of the ping-pong"}.get(row.base, "")
        share = f"{np.median(ratios):.2f} {base or 'of ' + NAMES[row.base]}"
    return f"| {row.text} | {middle}{extent} | {share} |"


NAMES = {"learn_3v2_us": "learning 3v2, 128 fields", "ros_match_cps": "the match"}
