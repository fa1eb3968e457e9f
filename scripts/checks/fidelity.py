"""Compare the world with measurements of the real soccer server, cell by cell.

    .venv/bin/python scripts/checks/fidelity.py
    .venv/bin/python scripts/checks/fidelity.py --out src/keepaway_sim/docs
    .venv/bin/python scripts/checks/fidelity.py --episodes 500 --only 3v2 2005 hand
    .venv/bin/python scripts/checks/fidelity.py --learning --out out/fidelity
    .venv/bin/python scripts/checks/fidelity.py --page src/keepaway_sim/docs
    .venv/bin/python scripts/checks/fidelity.py --learned --seeds 12 --page src/keepaway_sim/docs

Prints tables in Markdown: hold times, why they are what they are, and with --learning how 3v2
keepers learn from scratch. Pictures go to --out. With --json it prints one JSON object instead.
With --page the numbers are kept in a folder of documentation, and its page is written from all that
are kept there. --learned measures what 3v2 keepers do and believe early, in the middle and late
(20 simulated hours a trial).
"""

import argparse
import json
import multiprocessing
import os
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from keepaway_agent.fidelity import learned, measure, reference
from keepaway_agent.fidelity.figures import draw_band, draw_durations, draw_learning
from keepaway_agent.fidelity.measure import Measured
from keepaway_agent.fidelity.page import page
from keepaway_agent.fidelity.reference import Cell
from keepaway_agent.learning.config import LearnerConfig
from keepaway_agent.learning.describe import save
from keepaway_agent.training.training import Training
from keepaway_sim.version import code_version

LEARNING_EPISODES = 3000


def main() -> int:
    """Play, print, draw."""
    arguments = parse()
    cells = [cell for cell in reference.reference_cells() if chosen(cell, arguments.only)]
    if not cells and not arguments.learned:
        print(f"fidelity: no cell is called {' '.join(arguments.only)}", file=sys.stderr)
        return 1
    if arguments.learned:
        part = {"learned": learned_numbers(arguments.seeds, arguments.only == ["short"])}
        if not arguments.page:
            return say(part)
        name = arguments.page / "learned.png"
        save(draw_band(np.array(part["learned"]["curves_s"])), name, "scripts/checks/fidelity.py")
        return write_page(arguments.page, part)
    if arguments.learning:
        profiles = [name for name in reference.SESSIONS if any(c.profile == name for c in cells)]
        curves = learn(profiles, arguments.seeds, arguments.workers)
        text, numbers, figure, name = learning_report(curves)
    else:
        recorded = [cell for cell in cells if reference.reference_processes(cell)]
        measured = spread(measure_cell, cells, arguments.episodes, arguments.workers)
        processes = spread(describe, recorded, arguments.episodes // 8, arguments.workers)
        text, numbers = report(measured, dict(zip(recorded, processes, strict=True)))
        figure, name = draw_durations(measured), "fidelity.png"
    command = shlex.join(["scripts/checks/fidelity.py", *sys.argv[1:]])
    if arguments.page:
        save(figure, arguments.page / name, f"{command}, version {code_version()}")
        return write_page(arguments.page, numbers)
    if arguments.json:
        print(
            json.dumps(
                {"code_version": code_version(), "command": command, **numbers}, allow_nan=False
            )
        )
    else:
        print(f"{text}\n`{command}`, version {code_version()}")
    if arguments.out:
        save(figure, arguments.out / name, f"{command}, version {code_version()}")
        print(f"drawn: {arguments.out / name}", file=sys.stderr)
    return 0


def learned_numbers(trials: int, short: bool) -> dict[str, Any]:
    """Curves, behaviour and beliefs of 3v2 keepers that learn as the reference's do."""
    total, begins = (400, (0, 200)) if short else (5400, (0, 2800, 5200))
    config = LearnerConfig(ordering="k1", tile_widths="framework")
    trained = Training(task="3v2", learner=config, episodes=total, seed=measure.SEED)
    played = learned.learn_in_stages(trained, trials, begins, measure.POINT)
    stages = played.stages
    blocks = played.durations.reshape(trials, -1, measure.POINT).mean(axis=2)
    return {
        "curves_s": blocks.round(3).tolist(),
        "stages": [
            {
                "begin": stage.begin,
                "behaviour": learned.behaviour(stage),
                "hold_share_by_distance_to_T1_m": learned.hold_share_by_distance(stage.held),
            }
            for stage in stages
        ],
        "belief_errors": learned.belief_errors(stages[-1].held),
        "processes": [
            {
                "task": "3v2",
                "policy": f"learned, {total} episodes",
                "ours": measure.summarize(played.trajectories, "3v2")["statistics"],
                "reference": learned_reference(),
            }
        ],
    }


def learned_reference() -> dict[str, float]:
    """What the real server's recording of learned keepers gives."""
    recorded = reference.recorded("2005", "3v2", "learned")
    assert recorded is not None
    statistics: dict[str, float] = recorded["statistics"]
    return statistics


def write_page(folder: Path, part: dict[str, Any]) -> int:
    """Keep numbers beside those of other parts, and write the page of all."""
    path = folder / "fidelity.json"
    kept: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {"made": {}}
    command = shlex.join(["scripts/checks/fidelity.py", *sys.argv[1:]])
    kept |= part
    kept["made"] |= {name: {"command": command, "code_version": code_version()} for name in part}
    path.write_text(json.dumps(kept, indent=1, allow_nan=False) + "\n")
    (folder / "fidelity.md").write_text(page(json.loads(path.read_text())))
    print(f"written: {path}, {folder / 'fidelity.md'}", file=sys.stderr)
    return 0


def say(part: dict[str, Any]) -> int:
    """Print numbers as one JSON object."""
    print(json.dumps(part, allow_nan=False))
    return 0


def chosen(cell: Cell, words: Sequence[str]) -> bool:
    """Does a cell answer to all of these words?"""
    return {cell.profile, str(cell.visible_angle), cell.task, cell.policy} >= set(words)


def measure_cell(work: tuple[Cell, int]) -> Measured:
    """Play a cell."""
    return measure.measure(*work)


def describe(work: tuple[Cell, int]) -> dict[str, float]:
    """Process statistics of a cell's episodes."""
    cell, episodes = work
    statistics: dict[str, float] = measure.summarize(measure.record(cell, episodes), cell.task)[
        "statistics"
    ]
    return statistics


def train(work: tuple[str, int]) -> np.ndarray:
    """Learning curves of a profile."""
    return measure.learn(*work, LEARNING_EPISODES)


def learn(profiles: Sequence[str], seeds: int, workers: int) -> dict[str, np.ndarray]:
    """Learning curves of each profile, (num_seeds, num_blocks) [s]."""
    curves = in_processes(train, [(profile, seeds) for profile in profiles], workers)
    return dict(zip(profiles, curves, strict=True))


def spread(play: Callable[[Any], Any], cells: list[Cell], episodes: int, workers: int) -> list[Any]:
    """Play cells in several processes; results in the order of the cells."""
    return list(in_processes(play, [(cell, episodes) for cell in cells], workers))


def in_processes(play: Callable[[Any], Any], work: list[Any], workers: int) -> Iterator[Any]:
    """Do pieces of work in several processes, with a progress bar."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as executor:
        done = executor.map(play, work)
        yield from tqdm(done, total=len(work), disable=None, desc=play.__name__)


def report(
    measured: list[Measured], processes: dict[Cell, dict[str, float]]
) -> tuple[str, dict[str, Any]]:
    """The tables, and the same as data."""
    rows = [hold_times_row(one) for one in measured]
    text = table(
        "| profile | view | task | keepers | here | real server | ratio (95 %) | goal"
        " | std | out of bounds |",
        rows,
    )
    numbers: dict[str, Any] = {"cells": [one.to_dict() for one in measured], "processes": []}
    if processes:
        text += "\n" + process_table(processes)
    for cell, ours in processes.items():
        theirs = reference_statistics(cell)
        entry = {"task": cell.task, "policy": cell.policy, "ours": ours, "reference": theirs}
        numbers["processes"].append(entry)
    return text, numbers


def hold_times_row(one: Measured) -> list[str]:
    """A line of the table of hold times."""
    cell, ratio = one.cell, one.ratio
    verdict = "reached" if one.reached else "**missed**"
    return [
        cell.profile,
        str(cell.visible_angle),
        cell.task,
        cell.policy,
        f"{one.mean:.2f} ± {one.sem:.2f}",
        f"{cell.mean:.2f} ± {cell.sem:.2f}",
        f"{ratio.estimate:.2f} ({ratio.low:.2f} to {ratio.high:.2f})",
        f"± {cell.goal:.0%}: {verdict}",
        f"{one.std:.1f} : {cell.std or '-'}",
        f"{one.out:.2f} : {'-' if cell.out is None else cell.out}",
    ]


def process_table(processes: dict[Cell, dict[str, float]]) -> str:
    """Ours : reference, a row a statistic, a column a cell."""
    names = next(iter(processes.values()))
    rows = [
        [name.replace("_", " ")]
        + [
            f"{ours[name]:.3g} : {reference_statistics(cell)[name]:.3g}"
            for cell, ours in processes.items()
        ]
        for name in names
    ]
    header = " | ".join(f"{cell.task} {cell.policy}" for cell in processes)
    return table(f"| mean of an episode, here : real server | {header} |", rows)


def reference_statistics(cell: Cell) -> dict[str, float]:
    """What the real server's recordings of a cell give."""
    recorded = reference.reference_processes(cell)
    assert recorded is not None
    statistics: dict[str, float] = recorded["statistics"]
    return statistics


def learning_report(curves: dict[str, np.ndarray]) -> tuple[str, dict[str, Any], Any, str]:
    """Table, data, figure and its name."""
    rows, numbers = [], {}
    for profile, ours in curves.items():
        numbers[profile] = {
            "ours_s": ours.tolist(),
            "reference_s": [curve.tolist() for curve in reference.reference_curves(profile)],
        }
        mean = [f"{value:.1f}" for value in ours.mean(axis=0)]
        rows.append([profile, f"here, mean of {len(ours)}", *mean])
        for curve in reference.reference_curves(profile):
            theirs = [f"{value:.1f}" for value in curve]
            rows.append([profile, "real server", *theirs, *[""] * (len(mean) - len(theirs))])
    blocks = " | ".join(
        str(number) for number in range(measure.POINT, LEARNING_EPISODES + 1, measure.POINT)
    )
    text = table(f"| profile | mean duration (s) until episode | {blocks} |", rows)
    return text, {"learning": numbers}, draw_learning(curves), "learning.png"


def table(header: str, rows: list[list[str]]) -> str:
    """A table in Markdown."""
    rule = "|" + "---|" * (header.count("|") - 1)
    return "\n".join([header, rule, *["| " + " | ".join(row) + " |" for row in rows], ""])


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--episodes", type=int, default=2000, help="of each cell, at least")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="WORD", help="cells with these: 3v2 2005 360 hand"
    )
    parser.add_argument("--learning", action="store_true", help="learning instead of hold times")
    parser.add_argument("--learned", action="store_true", help="what learned keepers do, believe")
    parser.add_argument("--page", type=Path, metavar="DIR", help="keep numbers, write the page")
    parser.add_argument("--seeds", type=int, default=8, help="learning curves of each profile")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the picture")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    arguments = parser.parse_args()
    for name in ("episodes", "workers", "seeds"):
        if getattr(arguments, name) < 1:
            parser.error(f"--{name} {getattr(arguments, name)}: give 1 or more")
    return arguments


if __name__ == "__main__":
    sys.exit(main())
