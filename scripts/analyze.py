"""Tables and figures of a study's results, of trainings, of a recorded match, or of a server's log.

    .venv/bin/python scripts/analyze.py results/table2
    .venv/bin/python scripts/analyze.py results/table2 --threshold 8 --out results/table2-at-8
    .venv/bin/python scripts/analyze.py results/table2 --beside results/variants_1000
    .venv/bin/python scripts/analyze.py src/keepaway_transfer/results --page
    .venv/bin/python scripts/analyze.py out/4v3_scratch out/4v3_transfer
    .venv/bin/python scripts/analyze.py out/bag
    .venv/bin/python scripts/analyze.py first.kwy second.kwy --threshold 9

The report is written beside the results if no other folder is named; a bag's to BAG/analysis, that
of trainings of one task, their learning curves in one figure, to the first of them. Of a bag it has
a line for every episode (CSV and Parquet), hold times, passes, losses and actions. With --beside it
says by how much two studies' rows from scratch differ; --page makes the report of every study in a
folder, and the page of what they show.
"""

from __future__ import annotations

import argparse
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from keepaway_agent.errors import AgentError
from keepaway_sim.bags.reader import is_bag
from keepaway_sim.errors import KeepawayError
from keepaway_transfer import metrics
from keepaway_transfer.errors import LogError, TransferError

if TYPE_CHECKING:
    from keepaway_transfer.reports.kwy import KeepawayLog

TRAINING_FILE = "training.json"  # of scripts/train.py; its reader takes a second to import
PAGE = Path("src/keepaway_transfer/docs/results.md")


def main() -> int:
    """Print the table and say where the files are."""
    arguments = _parse()
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `analyze.py BAG | head` ends quietly
    try:
        if all(path.suffix == ".kwy" for path in arguments.results):
            print(_logs_line(arguments.results, arguments.threshold or 9.0, arguments.window))
            return 0
        if all((path / TRAINING_FILE).is_file() for path in arguments.results):
            return _analyse_trainings(arguments.results, arguments.out)
        if len(arguments.results) > 1:
            raise KeepawayError(
                "name one study or bag, or several trainings, or several .kwy logs of one training"
            )
        path = arguments.results[0]
        if is_bag(path) or path.is_file():
            return _analyse_bag(path, arguments.out, arguments.match)
        return _analyse_study(path, arguments)
    except (AgentError, TransferError, KeepawayError, FileNotFoundError) as error:
        print(f"analyze: {error}", file=sys.stderr)
        return 1


def _analyse_bag(bag: Path, out: Path | None, number: int | None) -> int:
    from keepaway_sim.analysis.report import analyse

    out = out or (bag if bag.is_dir() else bag.parent) / "analysis"
    print(analyse(bag, out, number))
    print(f"Written to {out}: episodes.csv and .parquet, summary.json and four figures.")
    return 0


def _analyse_trainings(folders: list[Path], out: Path | None) -> int:
    from keepaway_transfer.reports.trainings import write_trainings

    out = out or folders[0]
    print(write_trainings(folders, out))
    print(f"Written to {out}: learning_curves.png.")
    return 0


def _analyse_study(folder: Path, arguments: argparse.Namespace) -> int:
    # Here, because a bag needs no statistics: importing them takes seconds and 100 MB.
    from keepaway_transfer.reports.report import write_report
    from keepaway_transfer.studies.results import pack, read_results

    if arguments.beside:
        print(_scratch_line(folder, arguments.beside))
        return 0
    if arguments.page:
        return _write_page(folder, arguments.page)
    results, out = read_results(folder), arguments.out or folder
    print(write_report(results, out, threshold=arguments.threshold, curves=arguments.curves))
    if arguments.threshold is None:
        pack(folder, out)
    print(f"Written to {out}: table.md and figures.")
    return 0


def _write_page(folder: Path, page: Path) -> int:
    from keepaway_transfer.reports import plotting
    from keepaway_transfer.reports.evidence import read_evidence
    from keepaway_transfer.reports.page import page as page_of
    from keepaway_transfer.reports.page_figures import page_figures
    from keepaway_transfer.reports.report import write_report

    studies = read_evidence(folder)
    for name, one in studies.items():
        write_report(one.results, folder / name)
    figures = page.with_suffix("")
    figures.mkdir(parents=True, exist_ok=True)
    for name, figure in page_figures(studies).items():
        plotting.save_figure(figure, figures / f"{name}.png", "scripts/analyze.py --page")
    page.write_text(page_of(studies), encoding="utf-8")
    print(f"Written: the reports of {', '.join(studies)}, {page} and {figures}.")
    return 0


def _scratch_line(first: Path, second: Path) -> str:
    from keepaway_transfer.reports.evidence import Evidence, scratch_difference
    from keepaway_transfer.studies.results import read_results

    one, other = (Evidence(read_results(folder)) for folder in (first, second))
    found = scratch_difference(one, other)
    if found is None:
        return f"The rows from scratch of {first} and {second} are the same trials."
    return (
        f"From scratch {first} takes {found.difference:+.2f} h of {one.study.target} against"
        f" {second} (95 % {found.low:.2f} to {found.high:.2f}; p = {found.p_value:.2g}, Welch)."
    )


def _logs_line(paths: list[Path], threshold: float, window: int) -> str:
    """What the logs of one training tell, taken together in their order."""
    from keepaway_transfer.reports.kwy import read_kwy

    logs = [read_kwy(path) for path in paths]
    first = logs[0]
    for path, log in zip(paths, logs, strict=True):
        if _match_of(log) != _match_of(first):
            raise LogError(f"{path} is of another task or field than {paths[0]}")
    durations = np.concatenate([log.durations for log in logs])
    out = np.concatenate([log.out_of_bounds for log in logs])
    task = f"{first.num_keepers}v{first.num_takers}"
    length, width = first.field_size
    if not len(durations):
        return f"no episode of {task} on {length:g} x {width:g} m."
    crossing = metrics.time_to_threshold(durations, threshold, window)
    played = f"{len(durations):,} episodes of {task} on {length:g} x {width:g} m"
    hours = f"{metrics.hours(durations):.1f} simulated hours"
    ended = f"held {durations.mean():.2f} s on average, {out.mean():.0%} ended out of bounds"
    goal = f"a mean of {threshold:g} s over {window:,} episodes"
    when = f"at episode {crossing.episodes:,}, {crossing.hours:.2f} h" if crossing.reached else ""
    return f"{played}, {hours}: {ended}; {goal} {when or 'was never reached'}."


def _match_of(log: KeepawayLog) -> tuple[object, ...]:
    return log.num_keepers, log.num_takers, log.field_size


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "results",
        type=Path,
        nargs="+",
        help="folder of scripts/study.py, folders of scripts/train.py, a bag, or .kwy logs of one"
        " training in their order",
    )
    parser.add_argument("--threshold", type=float, help="mean duration [s]; default the study's")
    parser.add_argument("--window", type=int, default=metrics.WINDOW, help="episodes; for a log")
    parser.add_argument(
        "--curves", action="append", default=[], metavar="ROW", help="draw its learning curves"
    )
    parser.add_argument("--match", type=int, help="number of the match, where a bag has several")
    parser.add_argument("--out", type=Path, help="another folder for the report")
    parser.add_argument("--beside", type=Path, metavar="FOLDER", help="of another study")
    parser.add_argument(
        "--page", type=Path, nargs="?", const=PAGE, metavar="FILE", help=f"default {PAGE}"
    )
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
