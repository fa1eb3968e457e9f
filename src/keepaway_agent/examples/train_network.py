"""Train a neural network on the Gymnasium environment, and Sarsa with a CMAC beside it.

    .venv/bin/python src/keepaway_agent/examples/train_network.py --hours 10 --trials 5

One page, after CleanRL's: settings, the loop, a figure. Field k is trial k: it has a network of
its own, and plays what trial k of `scripts/train.py` plays with the same seed. All keepers of a
trial share what they learn, with the network as with the CMAC.
"""

import argparse
import time
from dataclasses import dataclass, fields
from pathlib import Path

import matplotlib as mpl
import numpy as np
from small_network import QNetworks

from keepaway_agent.environments.gym import KeeperVectorEnv
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import StopRule, TrainerConfig, Trial, trial_seed
from keepaway_sim.task import Task

CYCLES_PER_HOUR = 36_000
SECONDS_PER_CYCLE = 0.1


@dataclass(frozen=True)
class Args:
    """What is trained; every field is an option."""

    task: str = "3v2"  # keepers v takers
    hours: float = 10.0  # simulated, of every trial
    trials: int = 5  # side by side
    seed: int = 0  # of every random number
    gamma: float = 0.99  # discount per cycle
    epsilon_from: float = 0.3  # share of random choices at first
    epsilon_to: float = 0.01  # and in the end
    epsilon_hours: float = 5.0  # simulated, from the one to the other
    out: str = "out/network"  # folder for the figure and the durations


Durations = list[np.ndarray]
"""For every trial the cycles of its episodes, in order."""


def train_network(args: Args) -> Durations:
    """Learn by Q-learning with a network for every trial."""
    env = KeeperVectorEnv(args.trials, task=args.task)
    scale = env.single_observation_space.high
    rng = np.random.default_rng(args.seed)
    networks = QNetworks(args.trials, len(scale), int(env.single_action_space.n), rng)
    durations: list[list[int]] = [[] for _ in range(args.trials)]
    played = np.zeros(args.trials)  # cycles of finished episodes
    observations, _ = env.reset(seed=args.seed)
    states, in_play = observations / scale, np.ones(args.trials, dtype=np.bool_)
    while played.min() < args.hours * CYCLES_PER_HOUR:
        progress = min(1.0, played.min() / (args.epsilon_hours * CYCLES_PER_HOUR))
        epsilon = args.epsilon_from + progress * (args.epsilon_to - args.epsilon_from)
        actions = networks.choose(states, epsilon)
        observations, _, ended, _, infos = env.step(actions)
        after = args.gamma ** infos["cycles"]
        paid = SECONDS_PER_CYCLE * (1 - after) / (1 - args.gamma)
        next_states = observations / scale
        networks.learn(in_play, states, actions, paid, np.where(ended, 0.0, after), next_states)
        states, in_play = next_states, ~ended
        for trial in np.flatnonzero(ended):
            durations[trial].append(int(infos["cycle"][trial]))
            played[trial] += infos["cycle"][trial]
    return [np.array(each) for each in durations]


def train_sarsa(args: Args) -> Durations:
    """Learn by Sarsa with a CMAC, as the project's own keepers do."""
    config = TrainerConfig(Task.parse(args.task), shared=True)
    stop = StopRule(max_cycles=round(args.hours * CYCLES_PER_HOUR))
    trials = [Trial(trial_seed(args.seed, k), stop, label=k) for k in range(args.trials)]
    results = Trainer(config, args.trials).run(trials)
    done = {result.trial.label: result.durations for result in results}
    return [done[k] for k in range(args.trials)]


def curve(durations: Durations, hours: float, num_points: int = 20) -> np.ndarray:
    """(num_trials, num_points) mean episode duration [s] in equal parts of the training."""
    curves = []
    for each in durations:
        ends = np.cumsum(each) / CYCLES_PER_HOUR
        part = np.minimum((ends / hours * num_points).astype(int), num_points)
        means = [each[part == k].mean() for k in range(num_points)]
        curves.append(SECONDS_PER_CYCLE * np.array(means))
    return np.array(curves)


def draw(curves: dict[str, np.ndarray], args: Args, path: Path) -> None:
    """Means of the trials with the standard errors of these means."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.2), layout="constrained")
    for name, values in curves.items():
        num_trials, num_points = values.shape
        hours = (np.arange(num_points) + 0.5) * args.hours / num_points
        mean, sem = values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(num_trials)
        (line,) = axes.plot(hours, mean, label=name)
        axes.fill_between(hours, mean - sem, mean + sem, alpha=0.2, color=line.get_color())
    axes.set(
        xlabel="training time (simulated hours)",
        ylabel="episode duration (s)",
        title=f"{args.task}, {args.trials} trials, seed {args.seed}; bands: standard error",
        ylim=(0, None),
    )
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left")
    figure.savefig(path, dpi=110)


def main() -> None:
    """Train both, draw both."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    for field in fields(Args):
        name = "--" + field.name.replace("_", "-")
        parser.add_argument(name, type=type(field.default), default=field.default)
    args = Args(**vars(parser.parse_args()))
    out = Path(args.out)
    out.mkdir(parents=True, exist_ok=True)
    curves = {}
    for name, train in (("Sarsa, CMAC", train_sarsa), ("Q-learning, network", train_network)):
        began = time.process_time()
        durations = train(args)
        curves[name] = curve(durations, args.hours)
        last = curves[name][:, -2:].mean(axis=1)
        print(
            f"{name}: {sum(map(len, durations)):,} episodes, at the end {last.mean():.2f} s"
            f" +- {last.std(ddof=1) / np.sqrt(args.trials):.2f},"
            f" {time.process_time() - began:.0f} s of CPU time"
        )
    np.save(out / "curves.npy", np.stack(list(curves.values())))
    draw(curves, args, out / "learning_curves.png")
    print(f"drew {out / 'learning_curves.png'}")


if __name__ == "__main__":
    main()
