"""Three learners side by side: Sarsa with a CMAC, a small network, and JAX's with Optax.

    .venv/bin/python src/keepaway_agent/examples/train_network.py --hours 10 --trials 5

One page, after CleanRL's: settings, the loop, a figure. Field k is trial k: it has a network of
its own, and plays what trial k of `scripts/train.py` plays with the same seed. All keepers of a
trial share what they learn, with the networks as with the CMAC. Choices take different numbers of
cycles (a semi-Markov problem), so what comes after a choice counts `gamma ** cycles`.
"""

import argparse
import time
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import matplotlib as mpl
import numpy as np
from figures import keep
from intervals import half_width
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
    learners: str = "sarsa,numpy,jax"  # which of them
    out: str = "out/network"  # folder for the figure and the durations


Durations = list[np.ndarray]
"""For every trial the cycles of its episodes, in order."""


def train_network(args: Args, kind: type[QNetworks] = QNetworks) -> Durations:
    """Learn by Q-learning with a network for every trial."""
    env = KeeperVectorEnv(args.trials, task=args.task)
    scale = env.single_observation_space.high
    rng = np.random.default_rng(args.seed)
    networks = kind(args.trials, len(scale), int(env.single_action_space.n), rng)
    durations: list[list[int]] = [[] for _ in range(args.trials)]
    played = np.zeros(args.trials)  # cycles of finished episodes
    observations, infos = env.reset(seed=args.seed)
    states, chooses = observations / scale, infos["choosing"]
    while played.min() < args.hours * CYCLES_PER_HOUR:
        progress = min(1.0, played.min() / (args.epsilon_hours * CYCLES_PER_HOUR))
        epsilon = args.epsilon_from + progress * (args.epsilon_to - args.epsilon_from)
        actions = networks.choose(states, epsilon)
        observations, _, ended, _, infos = env.step(actions)
        after = args.gamma ** infos["cycles"]
        paid = SECONDS_PER_CYCLE * (1 - after) / (1 - args.gamma)
        next_states = observations / scale
        networks.learn(chooses, states, actions, paid, np.where(ended, 0.0, after), next_states)
        states, chooses = next_states, infos["choosing"]
        for trial in np.flatnonzero(ended):
            durations[trial].append(int(infos["cycle"][trial]))
            played[trial] += infos["cycle"][trial]
    return [np.array(each) for each in durations]


def train_jax(args: Args) -> Durations:
    """Learn by Q-learning with JAX and Optax; an extra, see `jax_network.py`."""
    from jax_network import JaxQNetworks

    return train_network(args, JaxQNetworks)


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
        sums, counts = (np.bincount(part, w, num_points + 1)[:-1] for w in (each, None))
        curves.append(SECONDS_PER_CYCLE * sums / np.where(counts, counts, np.nan))
    return np.array(curves)


def draw(curves: dict[str, np.ndarray], args: Args, path: Path) -> None:
    """Means of the trials, with 95 % intervals of these means (Student's t)."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.2), layout="constrained")
    for name, values in curves.items():
        num_points = values.shape[1]
        hours = (np.arange(num_points) + 0.5) * args.hours / num_points
        mean, half = values.mean(axis=0), half_width(values)
        (line,) = axes.plot(hours, mean, label=name)
        axes.fill_between(hours, mean - half, mean + half, alpha=0.2, color=line.get_color())
    axes.set(
        xlabel="training time (simulated hours)",
        ylabel="episode duration (s)",
        title=f"{args.task}, {args.trials} trials, seed {args.seed}; bands: 95 % intervals",
        ylim=(0, None),
    )
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left")
    figure.savefig(path, dpi=110)


LEARNERS = {
    "sarsa": ("Sarsa, CMAC", train_sarsa),
    "numpy": ("Q-learning, small network", train_network),
    "jax": ("Q-learning, JAX and Optax", train_jax),
}


def main() -> None:
    """Train them, draw them."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    for field in fields(Args):
        name = "--" + field.name.replace("_", "-")
        parser.add_argument(name, type=type(field.default), default=field.default)
    args = Args(**vars(parser.parse_args()))
    out = Path(args.out)
    out.mkdir(parents=True, exist_ok=True)
    for each in args.learners.split(","):
        name, train = LEARNERS[each]
        began = time.process_time()
        durations = train(args)
        values = curve(durations, args.hours)
        last = values[:, -2:].mean(axis=1)
        print(
            f"{name}: {sum(map(len, durations)):,} episodes, at the end {last.mean():.2f} s"
            f" +- {half_width(last):.2f}, {time.process_time() - began:.0f} s of CPU time"
        )
        np.save(out / f"{each}.npy", values)
    kept = {each: out / f"{each}.npy" for each in LEARNERS}  # of this run, or of earlier ones
    curves = {LEARNERS[each][0]: np.load(path) for each, path in kept.items() if path.exists()}
    keep(out, "learners", settings=asdict(args), curves=curves)
    draw(curves, args, out / "learning_curves.png")
    print(f"drew {out / 'learning_curves.png'}")


if __name__ == "__main__":
    main()
