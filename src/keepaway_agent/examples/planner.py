"""A keeper that plans: one step of lookahead by rollouts from a snapshot, beside the hand-coded.

    .venv/bin/python src/keepaway_agent/examples/planner.py --episodes 30

With a taker near, each choice is tried `rollouts` times from a snapshot of the present, with luck
of its own; the hand-coded keepers play on from there for `horizon` cycles. The choice after which
the ball stays in play longest on average is made (Tesauro & Galperin 1996). The planner looks at
the true state of the world, which no player knows: it is a mark to aim at, not a player.
"""

import argparse
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import matplotlib as mpl
import numpy as np
from figures import keep
from intervals import bootstrap

from keepaway_agent.environments.gym import KeeperEnv, KeeperVectorEnv

SECONDS_PER_CYCLE = 0.1


@dataclass(frozen=True)
class Args:
    """What is planned; every field is an option."""

    task: str = "3v2"  # keepers v takers
    episodes: int = 30  # of each, on the same seeds
    rollouts: int = 12  # of every choice
    horizon: int = 40  # cycles
    near: float = 6.0  # [m] further takers are no reason to think
    longest: float = 120.0  # [s] then an episode is cut off
    seed: int = 0
    out: str = "out/planner"  # folder for the figure and the durations


def hand_coded(observations: np.ndarray, num_keepers: int) -> np.ndarray:
    """UT Austin's hand-coded keeper for (num_fields, num_variables) observations."""
    n = num_keepers
    min_distances, min_angles = observations[:, 2 - 2 * n : 1 - n], observations[:, 1 - n :]
    scores = np.insert(4.0 * min_distances + np.degrees(min_angles), 0, 90.0, axis=1)
    return np.where(observations[:, n] > 5.0, 0, scores.argmax(axis=1))


class Planner:
    """Tries every choice out before it makes one."""

    def __init__(self, args: Args, num_keepers: int) -> None:
        """Lay out a field for every rollout of every choice."""
        self._args, self._num_keepers = args, num_keepers
        self._first = np.repeat(np.arange(num_keepers), args.rollouts)
        self._fields = KeeperVectorEnv(len(self._first), task=args.task, wait_for="any")
        self._rng = np.random.default_rng(args.seed)

    def choose(self, env: KeeperEnv, seen: np.ndarray) -> int:
        """A choice: by plan where a taker is near, else to hold."""
        if seen[self._num_keepers] > self._args.near:
            return 0
        luck = self._rng.integers(2**63, size=self._args.rollouts).tolist()  # the same for each
        states = [env.get_state()] * len(self._first)
        _, infos = self._fields.set_state(states, luck * self._num_keepers)
        ends = self._play_out(infos["cycle"] + self._args.horizon)
        return int(ends.reshape(self._num_keepers, -1).mean(axis=1).argmax())

    def _play_out(self, horizon: np.ndarray) -> np.ndarray:
        """(num_fields,) cycles at which the ball went out of play, those of `horizon` at most."""
        ends, alive, actions = horizon.copy(), np.ones(len(horizon), dtype=np.bool_), self._first
        while alive.any():
            observations, _, ended, _, infos = self._fields.step(actions)
            ends[alive & ended] = np.minimum(infos["cycle"], horizon)[alive & ended]
            alive &= ~ended & (infos["cycle"] < horizon)
            actions = hand_coded(observations, self._num_keepers)
        return ends


def play(args: Args, planned: bool) -> np.ndarray:
    """(num_episodes,) durations [s], cut off at `longest`."""
    env = KeeperEnv(task=args.task)
    n = int(env.action_space.n)
    planner = Planner(args, n) if planned else None
    durations = []
    for episode in range(args.episodes):
        seen, info = env.reset(seed=args.seed + episode)
        ended = False
        while not ended and info["cycle"] * SECONDS_PER_CYCLE < args.longest:
            choice = planner.choose(env, seen) if planner else int(hand_coded(seen[None], n)[0])
            seen, _, ended, _, info = env.step(choice)
        durations.append(min(info["cycle"] * SECONDS_PER_CYCLE, args.longest))
    return np.array(durations)


def draw(results: dict[str, np.ndarray], args: Args, path: Path) -> None:
    """How many episodes last how long."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.2), layout="constrained")
    for name, durations in results.items():
        low, high = bootstrap(durations)
        ends = np.concatenate([[0.0], np.sort(durations)])
        share = 1 - np.arange(len(ends)) / len(durations)
        axes.step(
            ends,
            share,
            where="post",
            label=f"{name}: {durations.mean():.0f} s ({low:.0f} to {high:.0f})",
        )
    axes.set(
        xlabel="time since kick-off (s)",
        ylabel="share of episodes still in play",
        title=f"{args.task}, {args.episodes} episodes each, cut off at {args.longest:g} s;"
        " means with 95 % intervals",
        xlim=(0, args.longest),
        ylim=(0, 1),
    )
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=110)


def main() -> None:
    """Play both, draw both."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    for field in fields(Args):
        name = "--" + field.name
        parser.add_argument(name, type=type(field.default), default=field.default)
    args = Args(**vars(parser.parse_args()))
    out = Path(args.out)
    out.mkdir(parents=True, exist_ok=True)
    results = {"hand-coded": play(args, planned=False), "planned": play(args, planned=True)}
    for name, durations in results.items():
        low, high = bootstrap(durations)
        print(f"{name}: {durations.mean():.1f} s (95 %: {low:.1f} to {high:.1f})")
    keep(out, "planner", settings=asdict(args), durations=results)
    draw(results, args, out / "planner.png")
    print(f"drew {out / 'planner.png'}")


if __name__ == "__main__":
    main()
