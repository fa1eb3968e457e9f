"""Measure cycles a CPU second of every environment class beside the trainer, in one run.

    .venv/bin/python scripts/checks/environment_speed.py --write

Keepers of 3v2 choose at random; or they always hold, and then vectors and trainer play the very
same episodes. All are measured in turns, again and again, so that a busy machine slows all of them
alike; times are CPU times of this process.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import trainer_speed
from environment_page import keep, made_here, speed

from keepaway_agent.environments import (
    KeepawayAECEnv,
    KeepawayParallelEnv,
    KeeperEnv,
    KeeperVectorEnv,
)
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import TrainerConfig

Play = Callable[[int], tuple[float, int]]
"""Plays at least N cycles on each field; returns CPU seconds and the cycles of all fields."""


def trainer(num_fields: int, policy: str = "random") -> Play:
    """The trainer's own loop, without learning; the start of trials is left out."""
    own = Trainer(TrainerConfig(), num_fields)
    return lambda cycles: trainer_speed.play(own, policy, num_fields, cycles)


def timed(play: Callable[[int], int]) -> Play:
    """The time that a function takes, and the cycles that it gives."""

    def timed_play(cycles: int) -> tuple[float, int]:
        began = time.process_time()
        played = play(cycles)
        return time.process_time() - began, played

    return timed_play


def vector(num_fields: int, wait_for: str, policy: str = "random") -> Play:
    """Many fields of one World."""
    env, choices = KeeperVectorEnv(num_fields, wait_for=wait_for), _choices(num_fields, policy)
    env.reset(seed=0)

    def play(cycles: int) -> int:
        played = 0
        while played < cycles * num_fields:
            _, _, ended, _, infos = env.step(next(choices))
            played += int(infos["cycle"][ended].sum())
        return played

    return timed(play)


def _choices(num_fields: int, policy: str) -> Iterator[np.ndarray]:
    """Choices for every field; random ones are drawn many at a time, as the trainer's are."""
    rng = np.random.default_rng(0)
    while True:
        yield from rng.integers(3 if policy == "random" else 1, size=(500, num_fields))


def single() -> Play:
    """One field, from choice to choice."""
    env, rng = KeeperEnv(), np.random.default_rng(0)

    def play(cycles: int) -> int:
        played = 0
        while played < cycles:
            over, info = not env.reset(seed=played)[1], dict[str, Any]()
            while not over:
                _, _, over, _, info = env.step(int(rng.integers(3)))
            played += info["cycle"]
        return played

    return timed(play)


def turns(teams: str) -> Play:
    """One field, turn by turn."""
    env, rng = KeepawayAECEnv(teams), np.random.default_rng(0)

    def play(cycles: int) -> int:
        played = 0
        while played < cycles:
            env.reset(seed=played)
            cycle = 0
            for _ in env.agent_iter():
                over, info = env.last()[2], env.last()[4]
                env.step(None if over else int(rng.integers(3)))
                cycle = info["cycle"]
            played += cycle
        return played

    return timed(play)


def parallel() -> Play:
    """One field, cycle by cycle."""
    env, rng = KeepawayParallelEnv(), np.random.default_rng(0)

    def play(cycles: int) -> int:
        played = 0
        while played < cycles:
            env.reset(seed=played)
            while env.agents:
                env.step({name: int(rng.integers(3)) for name in env.agents})
                played += 1
        return played

    return timed(play)


def _many(num_fields: int, policy: str) -> dict[str, Callable[[], Play]]:
    return {
        "trainer": lambda: trainer(num_fields, policy),
        "`KeeperVectorEnv`": lambda: vector(num_fields, "all", policy),
        '`KeeperVectorEnv`, `wait_for="any"`': lambda: vector(num_fields, "any", policy),
    }


GROUPS: dict[str, dict[str, Callable[[], Play]]] = {
    "128 fields": _many(128, "random"),
    "16 fields": _many(16, "random"),
    "128 fields, always hold": _many(128, "hold"),
    "16 fields, always hold": _many(16, "hold"),
    "1 field": {
        "trainer": lambda: trainer(1),
        "`KeeperEnv`": single,
        "`KeepawayAECEnv`": lambda: turns("keepers"),
        "`KeepawayAECEnv`, both teams": lambda: turns("both"),
        "`KeepawayParallelEnv`": parallel,
    },
}


def measure(group: dict[str, Callable[[], Play]], cycles: int, rounds: int) -> dict[str, float]:
    """Cycles a CPU second of each, the first first; warmed up before."""
    plays = {name: make() for name, make in group.items()}
    spent, played = dict.fromkeys(plays, 0.0), dict.fromkeys(plays, 0)
    for count in range(rounds + 1):
        for name, play in plays.items():
            seconds, done = play(cycles)
            if count:
                spent[name] += seconds
                played[name] += done
    return {name: played[name] / spent[name] for name in plays}


def main() -> int:
    """Print the table, or write it into the page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cycles", type=int, default=500, help="a field and turn (default 500)")
    parser.add_argument("--rounds", type=int, default=5, help="turns of each (default 5)")
    parser.add_argument("--write", action="store_true", help="write it into environments.md")
    args = parser.parse_args()
    speeds = {}
    for fields, group in GROUPS.items():
        cycles = args.cycles * max(1, 64 // int(fields.split()[0]))  # few fields play longer
        speeds[fields] = measure(group, cycles, args.rounds)
    figures = {"cycles_a_cpu_second": speeds}
    print(speed(figures))
    if args.write:
        keep({"speed": made_here() | figures})
    return 0


if __name__ == "__main__":
    sys.exit(main())
