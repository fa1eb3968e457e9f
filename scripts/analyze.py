"""Tables and figures of a study's results, of a recorded match, or of a soccer server's log.

    .venv/bin/python scripts/analyze.py results/table2
    .venv/bin/python scripts/analyze.py results/table2 --threshold 8 --out results/table2-at-8
    .venv/bin/python scripts/analyze.py out/bag
    .venv/bin/python scripts/analyze.py log.kwy --threshold 9

The report is written beside the results if no other folder is named; a bag's to BAG/analysis. Of a
bag it has a line for every episode (CSV and Parquet), hold times, passes, losses and actions.
"""

import argparse
import signal
import sys
from pathlib import Path

from keepaway_sim.analysis.report import analyse
from keepaway_sim.bags.reader import is_bag
from keepaway_sim.errors import KeepawayError
from keepaway_transfer import metrics
from keepaway_transfer.errors import TransferError
from keepaway_transfer.reports.kwy import read_kwy
from keepaway_transfer.reports.report import write_report
from keepaway_transfer.studies.results import pack, read_results


def main() -> int:
    """Print the table and say where the files are."""
    arguments = _parse()
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `analyze.py BAG | head` ends quietly
    try:
        if arguments.results.suffix == ".kwy":
            print(_log_line(arguments.results, arguments.threshold or 9.0, arguments.window))
            return 0
        if is_bag(arguments.results) or arguments.results.is_file():
            return _analyse_bag(arguments.results, arguments.out, arguments.match)
        results = read_results(arguments.results)
        out = arguments.out or arguments.results
        print(write_report(results, out, threshold=arguments.threshold, curves=arguments.curves))
        pack(arguments.results, out)
    except (TransferError, KeepawayError, FileNotFoundError) as error:
        print(f"analyze: {error}", file=sys.stderr)
        return 1
    print(f"Written to {out}: table.md, figures and all they are made of, trials.parquet.")
    return 0


def _analyse_bag(bag: Path, out: Path | None, number: int | None) -> int:
    out = out or (bag if bag.is_dir() else bag.parent) / "analysis"
    print(analyse(bag, out, number))
    print(f"Written to {out}: episodes.csv and .parquet, summary.json and four figures.")
    return 0


def _log_line(path: Path, threshold: float, window: int) -> str:
    log = read_kwy(path)
    crossing = metrics.time_to_threshold(log.durations, threshold, window)
    played = f"{len(log.cycles):,} episodes of {log.num_keepers}v{log.num_takers}"
    hours = f"{metrics.hours(log.durations):.1f} simulated hours"
    goal = f"a mean of {threshold:g} s over {window:,} episodes"
    if not crossing.reached:
        return f"{played}, {hours}: never {goal}."
    return f"{played}, {hours}: {goal} at episode {crossing.episodes:,}, {crossing.hours:.2f} h."


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "results", type=Path, help="folder of scripts/study.py, a bag, or a .kwy log"
    )
    parser.add_argument("--threshold", type=float, help="mean duration [s]; default the study's")
    parser.add_argument("--window", type=int, default=metrics.WINDOW, help="episodes; for a log")
    parser.add_argument(
        "--curves", action="append", default=[], metavar="ROW", help="draw its learning curves"
    )
    parser.add_argument("--match", type=int, help="number of the match, where a bag has several")
    parser.add_argument("--out", type=Path, help="another folder for the report")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
