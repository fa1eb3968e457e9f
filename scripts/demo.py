"""The main job, end to end: learn 3v2 on ROS nodes, transfer, play 4v3, see what it gives.

    scripts/demo                            # set up first, then this
    .venv/bin/python scripts/demo.py --out out/demo

1. 3v2 keepers learn, each a ROS node of its own; the match is recorded.
2. 3v2 keepers learn for longer, in one program without ROS.
3. The transfer node carries a 3v2 keeper's weights to 4v3, by rho.
4. 4v3 keepers play on from them, again each a ROS node.
5. A small study: learning curves of 4v3 from scratch, after transfer, and from an optimistic start.

All of it takes three minutes on two quiet cores, set-up included where wheels are cached.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from keepaway_agent.errors import AgentError
from keepaway_agent.learning.weights import load_weights, save_weights
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import Progress, StopRule, TrainerConfig, Trial, trial_seed
from keepaway_sim.cli.interrupts import Interruption, Stopped
from keepaway_sim.cli.options import ros_arguments
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Task
from keepaway_sim.version import code_version
from keepaway_transfer.rho import Transfer, transferred
from keepaway_transfer.studies.processes import WorkerExecutor

SCRIPTS = Path(__file__).resolve().parent
DOMAIN = 97  # the demo's own, unless one is set: it receives no other match
THRESHOLD = 9.0  # [s] the paper's for 4v3
OPTIMISTIC = "optimistic@5"  # the control: every action worth 5 s, nothing learned before
WINDOW = 200  # episodes that a point of a learning curve is the mean of
CYCLES_PER_HOUR = 36000
PROGRESS_EVERY = 10.0  # [s]
MARK = "made_by_the_demo.txt"  # what an earlier demo made is replaced only beside this file
MADE = ("3v2_nodes", "3v2_bag", "3v2_trained", "4v3_start.npz", "4v3_starts", "4v3_nodes",
        "4v3_bag", "learned_bag", "learning_curves.png")  # fmt: skip


NEXT = (
    (
        "watch what was learned",
        "match.py --episodes 5 --keeper-policy greedy"
        " --load-weights {out}/3v2_trained --record {out}/learned_bag",
    ),
    ("", "view.py {out}/learned_bag"),
    ("see what was learned", "describe.py {out}/4v3_start.npz --draw {out}/pictures"),
    ("write an agent", "new_agent.py quick_keeper"),
    ("run the paper's study", "study.py table2 --workers 2 --out {out}/table2"),
)


class DemoError(RuntimeError):
    """A step that did not work."""


class Args(NamedTuple):
    """How much of everything."""

    out: Path = Path("out/demo")
    seed: int = 0
    episodes: int = 60
    source_hours: float = 4.0
    target_hours: float = 5.0
    trials: int = 8


HELP = {
    "out": "folder of all files; what an earlier demo made there is replaced",
    "seed": "every random number follows from it",
    "episodes": "of each recorded match",
    "source_hours": "simulated, of 3v2 training of every trial",
    "target_hours": "simulated, of 4v3 training of every trial",
    "trials": "of the small study",
}


def main() -> int:
    """Do the five steps; a refusal is one line."""
    args = parse()
    os.environ.setdefault("ROS_DOMAIN_ID", str(DOMAIN))
    try:
        with Interruption():
            begin(args.out)
            return play(args)
    except Stopped as stopped:
        print(f"demo: stopped; what it made so far is in {args.out}", file=sys.stderr)
        return stopped.code
    except (DemoError, AgentError, KeepawayError, OSError) as error:
        print(f"demo: {error}", file=sys.stderr)
        return 1


def begin(out: Path) -> None:
    """Make the demo's folder; remove what an earlier demo made there, and nothing else.

    Raises:
        DemoError: the folder holds something, and no demo's mark.
    """
    if out.is_dir() and any(out.iterdir()) and not (out / MARK).is_file():
        raise DemoError(f"{out} holds something that no demo made: name another folder (--out)")
    out.mkdir(parents=True, exist_ok=True)
    (out / MARK).write_text("scripts/demo replaces what it made in this folder.\n")
    for path in (out / name for name in MADE):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)


def play(args: Args) -> int:
    """Do the five steps; print a table and where everything is."""
    start = time.monotonic()

    def say(step: str) -> None:
        print(f"\n[{time.monotonic() - start:4.0f} s] {step}", flush=True)

    say(f"1 of 5: 3v2 keepers learn as ROS nodes for {args.episodes} episodes, recorded")
    match(args, "3v2", "learn", args.out / "3v2_nodes", args.out / "3v2_bag")
    say(
        f"2 of 5: {args.trials} x 3 keepers learn 3v2 for {args.source_hours:g} simulated hours,"
        " no ROS"
    )
    script("train.py", "--task", "3v2", "--trials", str(args.trials), "--episodes", "1000000",
           "--hours", str(args.source_hours), "--seed", str(args.seed), "--processes", "2",
           "--save-weights", str(args.out / "3v2_trained"))  # fmt: skip
    sources = sorted((args.out / "3v2_trained").glob("trial_*/keeper_1.npz"))
    say("3 of 5: the transfer node carries keeper_1 of the first trial to 4v3 by rho")
    carried = args.out / "4v3_start.npz"
    print(transfer_by_node(sources[0], carried))
    say("4 of 5: 4v3 keepers play on from it as ROS nodes, learning")
    match(args, "4v3", "learn", args.out / "4v3_nodes", args.out / "4v3_bag", carried)
    say(
        "5 of 5: 4v3 from scratch, after transfer, from an optimistic start:"
        f" {args.trials} trials each"
    )
    curves = study(args, sources)
    figure = draw(args, curves)
    say("done")
    print(table(curves))
    print(f"\nlearning curves  {figure}\nbags             {args.out}/3v2_bag, {args.out}/4v3_bag")
    print(f"weights          {args.out}/3v2_nodes, {args.out}/3v2_trained, {carried}")
    print("\nwhat next")
    for what, command in NEXT:
        print(f"  {what:24s} .venv/bin/python scripts/{command.format(out=args.out)}")
    return 0


def parse() -> Args:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    for name, default in Args._field_defaults.items():
        kind = Path if isinstance(default, Path) else type(default)
        text = f"{HELP[name]} (default {default})"
        parser.add_argument(f"--{name.replace('_', '-')}", type=kind, default=default, help=text)
    return Args(**vars(parser.parse_args()))


def script(name: str, *arguments: str) -> None:
    """Run a script of this folder; it shows its own progress."""
    with running([sys.executable, str(SCRIPTS / name), *arguments]):
        pass


@contextlib.contextmanager
def running(command: Sequence[str], **options: Any) -> Iterator[subprocess.Popen[str]]:
    """A program, until it ends; it is asked to end when the demo is.

    Raises:
        DemoError: it failed.
    """
    with subprocess.Popen(command, text=True, **options) as process:
        try:
            yield process
            process.wait()
        except BaseException:
            process.terminate()
            raise
    if process.returncode:
        raise DemoError(f"{Path(command[1]).name} ended with {process.returncode}; see above")


def match(
    args: Args, task: str, policy: str, weights: Path, bag: Path, start: Path | None = None
) -> None:
    """Play a match of ROS nodes, each a process."""
    arguments = ["--task", task, "--episodes", str(args.episodes), "--keeper-policy", policy]
    arguments += ["--seed", str(args.seed), "--save-weights", str(weights), "--record", str(bag)]
    script("match.py", *arguments, *(["--load-weights", str(start)] if start else []))


def transfer_by_node(source: Path, target: Path) -> str:
    """Start the transfer node, ask it to apply rho, and end it; what it did, in words."""
    import rclpy

    from keepaway_msgs.srv import ApplyRho

    source, target = source.resolve(), target.resolve()
    settings = ros_arguments({"weights_dir": str(target.parent)})
    command = [sys.executable, str(SCRIPTS / "transfer.py"), "node", *settings]
    with subprocess.Popen(command) as process:
        rclpy.init()
        node = rclpy.create_node("demo")
        try:
            client = node.create_client(ApplyRho, "transfer/apply")
            if not client.wait_for_service(timeout_sec=60.0):
                raise DemoError("the transfer node does not come; see above")
            request = ApplyRho.Request(
                source_path=str(source), target_task="4v3", variant="rho", target_path=str(target)
            )
            answer = client.call_async(request)
            rclpy.spin_until_future_complete(node, answer, timeout_sec=60.0)
            response = answer.result()
        finally:
            node.destroy_node()
            rclpy.shutdown()
            process.terminate()
    if response is None or not response.success:
        raise DemoError(f"the transfer node refused: {response and response.message}")
    message: str = response.message
    return message


def study(args: Args, sources: Sequence[Path]) -> dict[str, list[np.ndarray]]:
    """Episode durations [s] of every 4v3 trial, by what its keepers started from."""
    after, optimistic = [], []
    for number, source in enumerate(sources):
        keeper = load_weights(source)
        carried = transferred(keeper, Transfer("4v3"))
        save_weights(args.out / "4v3_starts" / f"trial_{number:04d}.npz", carried)
        after.append(carried.values)
        optimistic.append(transferred(keeper, Transfer("4v3", OPTIMISTIC)).values)
    starts: dict[str, Sequence[np.ndarray | None]] = {
        "from scratch": [None] * len(sources),
        "after transfer from 3v2": after,
        "from an optimistic start": optimistic,
    }
    with WorkerExecutor(2) as pool:
        waiting = {how: pool.submit(learn_4v3, args, starts[how], how) for how in starts}
        return {how: future.result() for how, future in waiting.items()}


def learn_4v3(args: Args, starts: Sequence[np.ndarray | None], label: str) -> list[np.ndarray]:
    """Durations [s] of all episodes of each trial, one trial for each start."""
    reported = time.monotonic()

    def watch(progress: Progress) -> None:
        nonlocal reported
        if time.monotonic() - reported > PROGRESS_EVERY:
            reported = time.monotonic()
            hours = progress.cycles / CYCLES_PER_HOUR
            print(f"{label}: {hours:.1f}/{args.target_hours * len(starts):g} hours", flush=True)

    stop = StopRule(max_cycles=int(args.target_hours * CYCLES_PER_HOUR))
    trials = [
        Trial(trial_seed(args.seed + 1, number), stop, keeper_weights=start, label=number)
        for number, start in enumerate(starts)
    ]
    results = Trainer(TrainerConfig(Task.parse("4v3")), len(trials)).run(trials, watch)
    in_order = sorted(results, key=lambda result: result.trial.label)
    return [result.durations / 10.0 for result in in_order]


def draw(args: Args, groups: dict[str, list[np.ndarray]]) -> Path:
    """Draw the learning curves."""
    from keepaway_transfer.reports import plotting, trainings

    title = f"4v3, mean of {WINDOW} episodes, {args.trials} trials"
    figure = trainings.curves(groups, WINDOW, title=title, threshold=THRESHOLD)
    path = args.out / "learning_curves.png"
    plotting.save_figure(figure, path, f"scripts/demo.py --seed {args.seed}, {code_version()}")
    return path


def table(groups: dict[str, list[np.ndarray]]) -> str:
    """What came out, a row each; errors are standard errors over trials."""
    # Here, because the matches and a refusal need no statistics: importing them takes seconds.
    from keepaway_transfer.reports.statistics import mean_and_error

    rows = [f"{'what':48s} {'ball held (s)':>14s} {'+- s.e.':>8s}"]
    for label, trials in groups.items():
        for part, episodes in (("first", slice(0, WINDOW)), ("last", slice(-WINDOW, None))):
            means = [durations[episodes].mean() for durations in trials]
            mean, error = mean_and_error(means)
            shown = "-" if error is None else f"{error:.2f}"
            name = f"4v3 {label}, {part} {WINDOW} episodes"
            rows.append(f"{name:48s} {mean:14.2f} {shown:>8s}")
    return "\n".join(rows)


if __name__ == "__main__":
    sys.exit(main())
