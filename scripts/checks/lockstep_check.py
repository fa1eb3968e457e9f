"""Check that a match of ROS nodes and the in-process trainer play the same, to the last bit.

    .venv/bin/python scripts/checks/lockstep_check.py --episodes 50
    .venv/bin/python scripts/checks/lockstep_check.py --task 4v3 --policies learn --single-process

For each policy of the keepers a match is played in lock-step, every player its own process, and a
trial by the trainer with the same seed. Every episode's cycles and outcome and all weights must be
equal. Ends with code 1 if they are not.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from keepaway_agent.learning.weights import load_weights
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import StopRule, TrainerConfig, Trial, TrialResult, trial_seed
from keepaway_sim.task import Task

MATCH = Path(__file__).resolve().parents[1] / "match.py"


def main() -> int:
    """Compare policy by policy."""
    args = parse()
    different = 0
    for policy in args.policies:
        started = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            match = play_match(args, policy, Path(folder))
            weights = read_weights(Path(folder), args.task) if policy == "learn" else None
        differences = compare(match, weights, train(args, policy))
        different += bool(differences)
        verdict = "; ".join(differences) or "identical, cycle for cycle"
        what = "episodes and weights" if policy == "learn" else "episodes"
        print(
            f"{args.task} {policy:7} {len(match['episode_cycles'])} {what}: {verdict}"
            f" ({sum(match['episode_cycles']):,} cycles, {time.monotonic() - started:.0f} s)"
        )
    return int(different > 0)


def play_match(args: argparse.Namespace, policy: str, folder: Path) -> dict[str, Any]:
    """A match of nodes, as its JSON reports it."""
    command = [sys.executable, str(MATCH), "--json", "--task", args.task, "--seed", str(args.seed)]
    command += ["--episodes", str(args.episodes), "--keeper-policy", policy]
    command += ["--taker-policy", args.taker_policy, "--save-weights", str(folder)]
    command += ["--single-process"] if args.single_process else []
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    report: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return report


def read_weights(folder: Path, task: str) -> np.ndarray:
    """What the keepers saved: (num_keepers, num_actions, ...)."""
    names = Task.parse(task).player_names[: Task.parse(task).num_keepers]
    return np.stack([load_weights(folder / f"{name}.npz").values for name in names])


def train(args: argparse.Namespace, policy: str) -> TrialResult:
    """The same by the trainer: the match is trial 0."""
    trial = Trial(
        trial_seed(args.seed, 0),
        StopRule(max_episodes=args.episodes),
        keeper_policy=policy,
        taker_policy=args.taker_policy,
    )
    return next(Trainer(TrainerConfig(Task.parse(args.task)), num_fields=1).run([trial]))


def compare(match: dict[str, Any], weights: np.ndarray | None, trial: TrialResult) -> list[str]:
    """What is not the same, in words."""
    differences = []
    for what, played, expected in (
        ("cycles", match["episode_cycles"], trial.durations.tolist()),
        ("outcomes", match["episode_outcomes"], trial.outcomes.tolist()),
    ):
        unequal = [
            n for n, pair in enumerate(zip(played, expected, strict=False)) if len({*pair}) > 1
        ]
        if played != expected:
            differences.append(f"{what} DIFFER first in episode {unequal[:1] or 'count'}")
    trained = trial.keeper_weights
    if weights is not None and trained is not None and not np.array_equal(weights, trained):
        gap = np.abs(weights - trained).max()
        differences.append(f"weights DIFFER by up to {gap:g}")
    if match["troubles"]:
        differences.append(f"answers went missing: {match['troubles']}")
    return differences


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--task", default="3v2")
    parser.add_argument("--episodes", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--policies", nargs="+", default=["random", "hand", "learn"])
    parser.add_argument("--taker-policy", default="hand")
    parser.add_argument("--single-process", action="store_true", help="all nodes in one process")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
