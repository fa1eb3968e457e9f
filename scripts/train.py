"""Train players in one program, without ROS: the same rules and results, many times faster.

    .venv/bin/python scripts/train.py --task 3v2 --episodes 8000 --save-weights out/3v2
    .venv/bin/python scripts/train.py --task 4v3 --trials 20 --episodes 5000 --save-weights out/4v3
    .venv/bin/python scripts/train.py --policy hand --episodes 2000 --json
    .venv/bin/python scripts/train.py --policy greedy --load-weights out/3v2 --episodes 2000
    .venv/bin/python scripts/train.py --taker-policy learn --policy hand --save-weights out/takers
    .venv/bin/python scripts/train.py --episodes 8000 --record out/bag --record-episodes 0-9,7999

Ctrl-C, `kill` and a closed terminal stop it with all finished trials saved; the same command goes
on from there. With --json the last line of the output is one JSON object. --record makes a bag,
like a match's, of the first trial.
"""

import argparse
import contextlib
import json
import logging
import os
import shlex
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from keepaway_agent.errors import AgentError
from keepaway_agent.learning.weights import HOURS_PER_CYCLE
from keepaway_agent.training.folder import TrainingFolder
from keepaway_agent.training.training import RECORDED_TRIAL, Training
from keepaway_agent.training.trial import Progress
from keepaway_agent.training.trial_recorder import TrialRecorder
from keepaway_agent.training.workers import NUM_FIELDS, play_trials
from keepaway_sim.cli.interrupts import Interruption, Stopped
from keepaway_sim.cli.options import add_options, chosen, numbers_in
from keepaway_sim.cli.progress import ProgressBar
from keepaway_sim.errors import KeepawayError
from keepaway_sim.match.scores import Score, summary
from keepaway_sim.task import Outcome
from keepaway_sim.world.config import CYCLE_TIME

LAST = 1000
"""Episodes at the end of a trial whose mean shows how good it has become."""

Episodes = dict[int, tuple[np.ndarray, np.ndarray]]  # durations [cycles], outcomes by trial


def main() -> int:
    """Train, say how it went; a refusal is one line."""
    arguments = parse()
    logging.basicConfig(format="train: %(message)s", handlers=[TqdmHandler()])
    try:
        with Interruption() as interruption:
            return run(arguments, interruption)
    except Stopped as stopped:  # in the beginning or in the end
        return stopped.code


class TqdmHandler(logging.Handler):
    """Writes above the progress bar."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line."""
        tqdm.write(self.format(record), file=sys.stderr)


def run(arguments: argparse.Namespace, interruption: Interruption) -> int:
    """Train what is missing; the exit code."""
    try:
        training = chosen(Training, arguments)
        command = shlex.join(["scripts/train.py", *sys.argv[1:]])
        folder = (
            TrainingFolder(arguments.save_weights, training, command, arguments.any_code)
            if arguments.save_weights
            else None
        )
        numbers = range(arguments.trials)
        episodes: Episodes = {k: folder.episodes(k) for k in folder.done} if folder else {}
        missing = [k for k in numbers if k not in episodes]
        recorder = recorder_of(training, missing, command, arguments)
        with folder.lock() if folder else contextlib.nullcontext():
            rate, code = train(
                training, missing, arguments, folder, episodes, recorder, interruption
            )
    except (AgentError, KeepawayError, OSError) as error:
        print(f"train: {error}", file=sys.stderr)
        return 1
    asked = {k: episodes[k] for k in range(arguments.trials) if k in episodes}
    report(training, asked, rate, folder, arguments)
    if code:
        ways_on = "the same command continues from here" if folder else "nothing was to be saved"
        print(f"train: stopped; {ways_on}", file=sys.stderr)
    return code


def recorder_of(
    training: Training, missing: list[int], command: str, arguments: argparse.Namespace
) -> TrialRecorder | None:
    """What records the first trial, if that is asked for.

    Raises:
        AgentError: the trial is there already, so it is not played again.
        KeepawayError: numbers that are none.
    """
    if not arguments.record:
        return None
    if RECORDED_TRIAL not in missing:
        raise AgentError(
            f"--record {arguments.record}: trial {RECORDED_TRIAL} is in {arguments.save_weights}"
            " already and is not played again; name another folder for the weights"
        )
    wanted = numbers_in(arguments.record_episodes) if arguments.record_episodes else None
    return training.recorder(arguments.record, wanted, command)


def train(
    training: Training,
    numbers: list[int],
    arguments: argparse.Namespace,
    folder: TrainingFolder | None,
    episodes: Episodes,
    recorder: TrialRecorder | None,
    interruption: Interruption,
) -> tuple[float | None, int]:
    """Play the trials that are missing; a signal ends it early.

    Returns:
        Cycles a second once it runs, or None if nothing was played, and the exit code.
    """
    meter, played, code = Meter(len(numbers)), Progress(), 0
    by_time = training.hours > 0  # then that is what ends a trial, most likely
    total = max(1, round(60 * training.hours)) if by_time else training.episodes
    unit = "simulated minutes" if by_time else "episodes"
    with ProgressBar("train", len(numbers) * total, unit) as bar:

        def watch(progress: Progress) -> None:
            meter.read(progress)
            minutes = round(60 * progress.cycles * HOURS_PER_CYCLE)
            bar.show(minutes if by_time else progress.episodes, str(meter))

        try:
            spread = arguments.processes, arguments.fields
            for result in play_trials(training, numbers, *spread, watch, recorder):
                if folder:
                    with interruption.shield():
                        folder.save(result)
                episodes[result.trial.label] = result.durations, result.outcomes
                played.cycles += int(result.durations.sum())
            meter.read(played)
        except Stopped as stopped:
            code = stopped.code
    return meter.rate if numbers else None, code


class Meter:
    """What a person wants to see of the progress."""

    def __init__(self, trials: int) -> None:
        self.trials = trials
        self._progress = Progress()
        self._readings = [(time.perf_counter(), 0)]  # time and cycles: start, first, last

    def read(self, progress: Progress) -> None:
        """Take a reading."""
        self._progress = progress
        self._readings = [*self._readings[:2], (time.perf_counter(), progress.cycles)]

    @property
    def rate(self) -> float | None:
        """Cycles a second since the first reading, so that compiling and starting do not count."""
        if len(self._readings) < 2:
            return None
        (begun, before), (now, cycles) = self._readings[-2:]
        return (cycles - before) / (now - begun)

    def __str__(self) -> str:
        done = self._progress
        mean = done.cycles / max(1, done.episodes) * CYCLE_TIME
        return (
            f"{done.trials}/{self.trials} trials, {done.cycles * HOURS_PER_CYCLE:.1f} simulated"
            f" hours, mean {mean:.1f} s, {self.rate or 0:,.0f} cycles/s"
        )


def report(
    training: Training,
    episodes: Episodes,
    rate: float | None,
    folder: TrainingFolder | None,
    arguments: argparse.Namespace,
) -> None:
    """Print how the episodes went."""
    scores = [
        Score(float(cycles) * CYCLE_TIME, Outcome(outcome))
        for durations, outcomes in episodes.values()
        for cycles, outcome in zip(durations, outcomes, strict=True)
    ]
    ends = [each[-LAST:].mean() * CYCLE_TIME for each, _ in episodes.values() if len(each)]
    numbers: dict[str, Any] = {
        "task": training.task,
        **summary(scores),
        "last_episodes": min([LAST, *(len(each) for each, _ in episodes.values())]),
        "last_mean_duration_s": float(np.mean(ends)) if ends else None,
        "trials": len(episodes),
        "simulated_hours": sum(score.duration for score in scores) / 3600,
        "cycles_per_second": rate,
        "seed": training.seed,
        "policy": training.policy,
        "taker_policy": training.taker_policy,
        "weights_sha256": folder.weights_hash(episodes) if folder else None,
    }
    if len(episodes) > 1 or "learn" in (training.policy, training.taker_policy):
        numbers["sem_duration_s"] = error_of_trials(episodes)
    if arguments.json:
        print(json.dumps(numbers, allow_nan=False))
    elif scores:
        print(in_words(training, numbers))


def error_of_trials(episodes: Episodes) -> float | None:
    """Standard error [s] of the mean duration; None if there is but one trial.

    Episodes of one learner depend on each other, so its trial counts once.
    """
    means = [durations.mean() * CYCLE_TIME for durations, _ in episodes.values()]
    if len(means) < 2:
        return None
    return float(np.std(means, ddof=1) / np.sqrt(len(means)))


def in_words(training: Training, numbers: dict[str, Any]) -> str:
    """What `report` prints for a person."""
    error, trials, rate = (numbers[k] for k in ("sem_duration_s", "trials", "cycles_per_second"))
    of = f"of {trials} trials" if trials > 1 else "of the episodes"
    spread = " (one trial: no error is known)" if error is None else f" +- {error:.2f} s ({of})"
    sha256 = numbers["weights_sha256"]
    return (
        f"{training.task}, {training.policy} keepers, {training.taker_policy} takers:"
        f" {numbers['episodes']:,} episodes in {trials} trials,"
        f" {numbers['simulated_hours']:.1f} simulated hours\n"
        f"mean hold time {numbers['mean_duration_s']:.2f} s{spread},"
        f" last {numbers['last_episodes']:,} episodes of a trial"
        f" {numbers['last_mean_duration_s']:.2f} s,"
        f" out of bounds {numbers['out_of_bounds_share']:.0%}"
        + (f"\n{rate:,.0f} cycles a second" if rate else "")
        + (f"\nweights' SHA-256 {sha256}" if sha256 else "")
    )


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trials", type=int, default=1, help="each from the start (default 1)")
    parser.add_argument("--save-weights", type=Path, metavar="DIR", help="folder of the results")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="to spread over")
    parser.add_argument("--fields", type=int, default=NUM_FIELDS, help="side by side in a process")
    parser.add_argument("--record", type=Path, metavar="BAG", help="of the first trial")
    parser.add_argument("--record-episodes", metavar="NUMBERS", help="only these, like 0-9,500")
    parser.add_argument(
        "--any-code", action="store_true", help="resume though the code has changed"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object on the last line")
    add_options(parser, Training)
    arguments = parser.parse_args()
    for name in ("trials", "processes", "fields"):
        if getattr(arguments, name) < 1:
            parser.error(f"--{name} {getattr(arguments, name)}: give 1 or more")
    return arguments


if __name__ == "__main__":
    sys.exit(main())
