"""Run a study: the paper's Table 2 and the other experiments, or one of your own.

    .venv/bin/python scripts/study.py tiny --out results/tiny
    .venv/bin/python scripts/study.py table2 --workers 2 --out results/table2
    .venv/bin/python scripts/study.py table2 --workers 2 --out results/table2 --resume
    .venv/bin/python scripts/study.py mine.toml --scheduler tcp://cluster:8786 --out results/mine
    .venv/bin/python scripts/study.py mine.toml --known results/table2 --out results/mine

Ctrl-C, `kill` and a closed terminal stop it; --resume continues it, whatever stopped it. Rows that
start like those of --known results are not played again, but for one trial of each, which must come
out the same. scripts/analyze.py makes the report.
"""

import argparse
import logging
import os
import shlex
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

import attrs

from keepaway_agent.errors import AgentError
from keepaway_sim.cli.interrupts import Interruption, Stopped
from keepaway_sim.cli.progress import ProgressBar
from keepaway_sim.errors import KeepawayError
from keepaway_sim.version import code_version
from keepaway_transfer.errors import StudyError
from keepaway_transfer.studies.batch import play_batch
from keepaway_transfer.studies.experiment import StudyProgress, run
from keepaway_transfer.studies.known import check_known, known_trials, to_play_again
from keepaway_transfer.studies.processes import WorkerExecutor
from keepaway_transfer.studies.results import ResultsFolder, open_results, pack, read_results
from keepaway_transfer.studies.study import Study, load_study


def main() -> int:
    """Run what is left of the study; a refusal is one line."""
    arguments = _parse()
    logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
    try:
        study = load_study(arguments.study)
        if arguments.trials:
            study = attrs.evolve(study, trials=arguments.trials)
        with Interruption() as interruption:
            return _run(study, arguments, interruption)
    except Stopped as stopped:
        print(f"study: stopped; continue with --resume --out {arguments.out}", file=sys.stderr)
        return stopped.code
    except (AgentError, KeepawayError, OSError) as error:
        print(f"study: {error}", file=sys.stderr)
        return 1


def _run(study: Study, arguments: argparse.Namespace, interruption: Interruption) -> int:
    with (
        open_results(
            arguments.out,
            study,
            command=shlex.join(["scripts/study.py", *sys.argv[1:]]),
            code_version=code_version(),
            resume=arguments.resume,
            any_code=arguments.any_code,
        ) as results,
        _executor(arguments) as executor,
    ):
        _take_known(study, arguments.known, results, executor, interruption)
        progress = StudyProgress(study, results.done)
        with ProgressBar(
            "study", progress.trials, "trials", done=progress.done, period=0, estimates=False
        ) as bar:
            bar.show(progress.done, str(progress))
            for trials in run(
                study, results, executor, play_batch, arguments.batch, interruption.shield
            ):
                progress.add(trials)
                bar.show(progress.done, str(progress))
    pack(arguments.out)
    print(f"{progress.done} trials in {arguments.out}; report: scripts/analyze.py {arguments.out}")
    return 0


def _take_known(
    study: Study,
    folders: Sequence[Path],
    results: ResultsFolder,
    executor: Executor,
    interruption: Interruption,
) -> None:
    """Take trials over from other results, once the first of each row came out the same here."""
    known = known_trials(study, [read_results(folder) for folder in folders])
    left = {key: record for key, record in known.items() if key not in results.done}
    if not left:
        return
    again = to_play_again(left)
    print(f"study: {len(left)} trials are known; playing {len(again)} of them again", flush=True)
    check_known(study, executor.submit(play_batch, study, again).result(), known)
    with interruption.shield():
        results.take_over(left.values())


@contextmanager
def _executor(arguments: argparse.Namespace) -> Iterator[Executor]:
    """Processes of this machine, or the workers of a Dask scheduler."""
    if arguments.scheduler:
        from distributed import Client, KilledWorker  # only a cluster needs it

        with Client(arguments.scheduler) as client, client.get_executor() as executor:
            try:
                yield executor
            except KilledWorker as error:
                raise StudyError(
                    f"the cluster's workers were lost again and again: {error}"
                ) from error
    else:
        with WorkerExecutor(arguments.workers) as executor:
            yield executor


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("study", help="a study of the package, or the path of a TOML file")
    parser.add_argument("--out", type=Path, required=True, help="folder of the results")
    parser.add_argument(
        "--known", type=Path, nargs="+", default=(), metavar="FOLDER",
        help="results whose equal trials are taken over",
    )  # fmt: skip
    parser.add_argument("--trials", type=int, help="trials a row; default the study's")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--scheduler", help="address of a Dask scheduler, instead of processes")
    parser.add_argument("--batch", type=int, default=50, help="trials played together")
    parser.add_argument("--resume", action="store_true", help="continue with existing results")
    parser.add_argument("--any-code", action="store_true", help="also if the code has changed")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
