"""Two learned teams against each other: PettingZoo's turns, a small network for each team.

    .venv/bin/python src/keepaway_agent/examples/self_play.py --hours 4

All keepers share one network and all takers another; each learns from its own choices, while the
other team learns too. Afterwards each team plays against the hand-coded one and against the other,
beside two hand-coded teams on the same seeds.
"""

import argparse
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from figures import keep
from intervals import bootstrap
from planner import Args as HandCoded
from planner import play
from small_network import QNetworks

from keepaway_agent.environments import KeepawayAECEnv, keepaway_v0

CYCLES_PER_HOUR = 36_000
SECONDS_PER_CYCLE = 0.1
FIRST_SEED = 10_000  # of the episodes afterwards
ALL = np.ones(1, dtype=np.bool_)


@dataclass(frozen=True)
class Args:
    """What is played; every field is an option."""

    task: str = "3v2"  # keepers v takers
    hours: float = 4.0  # simulated, of learning
    episodes: int = 60  # of every pair afterwards
    longest: float = 120.0  # [s] then one of these is cut off: takers may have learned to keep away
    gamma: float = 0.99  # discount per cycle
    epsilon_from: float = 0.3  # share of random choices at first
    epsilon_to: float = 0.02  # and in the end
    seed: int = 0
    out: str = "out/self_play"  # folder for the figure and the durations


class Choice(NamedTuple):
    """What an agent saw and chose last, and when."""

    state: np.ndarray
    action: np.ndarray
    cycle: int


class Team:
    """The learner of all agents of a team."""

    def __init__(self, env: KeepawayAECEnv, name: str, args: Args) -> None:
        """Know nothing."""
        self._scale = env.observation_space(name).high
        self._args = args
        rng = np.random.default_rng([args.seed, len(self._scale)])
        self._networks = QNetworks(1, len(self._scale), int(env.action_space(name).n), rng)
        self._last: dict[str, Choice] = {}

    def choose(self, agent: str, seen: np.ndarray, epsilon: float) -> int:
        """A choice, which is not learned from."""
        return int(self._networks.choose((seen / self._scale)[None], epsilon)[0])

    def learn(self, agent: str, last: tuple[Any, ...], epsilon: float) -> int | None:
        """Learn from the agent's last choice, and make the next; at an episode's end none."""
        seen, reward, terminated, _, info = last
        state, choice = (seen / self._scale)[None], self._last.pop(agent, None)
        if choice is not None:
            after = np.array([self._args.gamma ** (info["cycle"] - choice.cycle)])
            paid = np.sign(reward) * SECONDS_PER_CYCLE * (1 - after) / (1 - self._args.gamma)
            discount = 0.0 if terminated else after
            self._networks.learn(
                ALL, choice.state, choice.action, paid, np.array([discount]).ravel(), state
            )
        if terminated:
            return None
        action = self._networks.choose(state, epsilon)
        self._last[agent] = Choice(state, action, info["cycle"])
        return int(action[0])


def learn(args: Args) -> tuple[dict[str, Team], np.ndarray]:
    """Both teams at once; the teams, and (num_episodes,) durations [cycles]."""
    env = keepaway_v0.turn_based_env(teams="both", task=args.task)
    teams = {role: Team(env, f"{role}_1", args) for role in ("keeper", "taker")}
    durations: list[int] = []
    played, end = 0, args.hours * CYCLES_PER_HOUR
    env.reset(seed=args.seed)
    while played < end:
        epsilon = args.epsilon_from + played / end * (args.epsilon_to - args.epsilon_from)
        cycle = 0
        for agent in env.agent_iter():
            last = env.last()
            env.step(teams[agent.partition("_")[0]].learn(agent, last, epsilon))
            cycle = last[4]["cycle"]
        durations.append(cycle)
        played += cycle
        env.reset()
    return teams, np.array(durations)


def evaluate(args: Args, teams: dict[str, Team]) -> np.ndarray:
    """(num_episodes,) durations [s]; a team that is not among `teams` is hand-coded."""
    who = "both" if len(teams) == 2 else f"{next(iter(teams))}s"
    longest = round(args.longest / SECONDS_PER_CYCLE)
    env = keepaway_v0.turn_based_env(teams=who, task=args.task, max_cycles=longest)
    durations = []
    for episode in range(args.episodes):
        env.reset(seed=FIRST_SEED + episode)
        cycle = 0
        for agent in env.agent_iter():
            seen, _, terminated, truncated, info = env.last()
            team = teams[agent.partition("_")[0]]
            env.step(None if terminated or truncated else team.choose(agent, seen, 0.0))
            cycle = info["cycle"]
        durations.append(min(cycle * SECONDS_PER_CYCLE, args.longest))
    return np.array(durations)


def draw(durations: np.ndarray, pairs: dict[str, np.ndarray], args: Args, path: Path) -> None:
    """Durations as both teams learn, and what each has learned."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
    hours = np.cumsum(durations) / CYCLES_PER_HOUR
    parts = np.minimum((hours / args.hours * 20).astype(int), 19)
    means = [SECONDS_PER_CYCLE * durations[parts == k].mean() for k in range(20)]
    left.plot((np.arange(20) + 0.5) * args.hours / 20, means, marker=".")
    left.set(xlabel="simulated hours of self-play", ylabel="episode duration (s)", ylim=(0, None))
    left.set_title(f"{args.task}: both teams learn")
    for place, each in enumerate(pairs.values()):
        low, high = bootstrap(each)
        right.errorbar(
            [each.mean()], [place], xerr=[[each.mean() - low], [high - each.mean()]], fmt="o"
        )
    right.set_yticks(range(len(pairs)), [name.replace(" v ", "\nv ") for name in pairs])
    right.set(xlim=(0, None), ylim=(len(pairs) - 0.4, -0.6), xlabel="episode duration (s)")
    right.set_title(f"afterwards, {args.episodes} episodes each; 95 % intervals")
    left.grid(alpha=0.3)
    right.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Learn, play every pair, draw."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    for field in fields(Args):
        name = "--" + field.name.replace("_", "-")
        parser.add_argument(name, type=type(field.default), default=field.default)
    args = Args(**vars(parser.parse_args()))
    out = Path(args.out)
    out.mkdir(parents=True, exist_ok=True)
    teams, durations = learn(args)
    print(f"learned in {len(durations):,} episodes")
    rules = HandCoded(args.task, args.episodes, longest=args.longest, seed=FIRST_SEED)
    pairs = {
        "hand-coded keepers v hand-coded takers": play(rules, planned=False),
        "learned keepers v hand-coded takers": evaluate(args, {"keeper": teams["keeper"]}),
        "learned keepers v learned takers": evaluate(args, teams),
        "hand-coded keepers v learned takers": evaluate(args, {"taker": teams["taker"]}),
    }
    for name, each in pairs.items():
        low, high = bootstrap(each)
        print(f"{name}: {each.mean():.1f} s (95 %: {low:.1f} to {high:.1f})")
    keep(out, "self_play", settings=asdict(args), durations=pairs, episodes=len(durations))
    draw(durations, pairs, args, out / "self_play.png")
    print(f"drew {out / 'self_play.png'}")


if __name__ == "__main__":
    main()
