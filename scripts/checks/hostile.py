"""Call every environment class at random, with good and with hostile arguments; count what comes.

    .venv/bin/python scripts/checks/hostile.py --calls 20000

Each class is called in a process of its own. A call must give what its class documents, or be
refused with `AgentError` or `KeepawayError`. Anything else - another exception, an observation
outside its space, a process that ends - is printed with the calls before it, and the script fails.
With `--write` the counts are written into docs/environments.md.
"""

from __future__ import annotations

import argparse
import copy
import subprocess
import sys
from collections import Counter, deque
from collections.abc import Callable
from typing import Any

import numpy as np
from environment_page import keep, made_here

from keepaway_agent.environments import (
    KeepawayAECEnv,
    KeepawayParallelEnv,
    KeeperEnv,
    KeeperVectorEnv,
)
from keepaway_agent.errors import AgentError
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Task

CLASSES: dict[str, Callable[..., Any]] = {
    "KeeperEnv": KeeperEnv,
    "KeeperVectorEnv": KeeperVectorEnv,
    "KeepawayAECEnv": KeepawayAECEnv,
    "KeepawayParallelEnv": KeepawayParallelEnv,
}
HOSTILE: tuple[Any, ...] = (
    *(None, True, False, -3, -1, 0, 1, 2, 99, 10**30, 1.7, float("nan"), float("inf"), 1j),
    *("", "keeper_1", "taker_9", "a" * 1000, b"x", [], [0], [0, 1], [[0], [0, 1]], (), {}, set()),
    *({"keeper_1": 0}, {0: 0}, object(), len, Task, np.int8(1), np.uint64(2**63), np.float64(1)),
    *(np.array(1), np.array([1]), np.array([1, 2]), np.array([[0, 1]]), np.array([0.0, 1.0])),
    *(np.array([None, 1]), np.array(["a", "b"]), np.array([True, False]), np.array([0, 77])),
)
"""What no caller should give; some of it is right in some places."""
METHODS = (
    *("reset", "step", "render", "close", "observe", "state", "last", "agent_iter"),
    *("action_space", "observation_space", "get_state", "set_state", "copy"),
)
WEIGHTS = {"step": 40, "reset": 8, "close": 0.05, "copy": 0.5, "set_state": 2.0, "get_state": 2.0}
SETTINGS = (
    *("task", "taker_policy", "keeper_policy", "config", "ordering", "decision_interval"),
    *("max_cycles", "max_episode_steps", "render_mode", "teams", "num_envs", "nonsense"),
)


class Caller:
    """Calls one class at random.

    Attributes:
        counts: of calls, by name and by what came of them.
        last: the last calls, as text.
    """

    def __init__(self, make: Callable[..., Any], seed: int) -> None:
        """Nothing is called yet."""
        self._make, self._rng = make, np.random.default_rng(seed)
        self.counts: Counter[tuple[str, str]] = Counter()
        self.last: deque[str] = deque(maxlen=12)
        self._env, self._snapshot = make(), None

    def call(self) -> None:
        """Make one call."""
        if self._rng.random() < 0.02:
            self._attempt("(new)", self._renew)
            return
        names = [name for name in METHODS if name == "copy" or self._has(name)]
        odds = np.array([WEIGHTS.get(name, 1.0) for name in names])
        name = str(self._rng.choice(names, p=odds / odds.sum()))
        self._attempt(name, lambda: self._call(name))

    def _has(self, name: str) -> bool:
        """Whether the class has this method (a Gymnasium environment's spaces are no methods)."""
        return callable(getattr(type(self._env), name, None))

    def _attempt(self, name: str, act: Callable[[], None]) -> None:
        try:
            act()
            self.counts[name, "answered"] += 1
        except (AgentError, KeepawayError) as error:
            self.counts[name, type(error).__name__] += 1
            self.last[-1] += f" -> {error}"

    def _renew(self) -> None:
        """Make another environment, mostly one with settings that make no sense."""
        settings: dict[str, Any] = {}
        if self._rng.random() < 0.8:
            settings[str(self._rng.choice(SETTINGS))] = self._hostile()
        self.last.append(f"(new) {settings}")
        self._env = self._make(**settings)

    def _call(self, name: str) -> None:
        if name == "copy":
            self.last.append("copy")
            self._env = copy.deepcopy(self._env)
            return
        arguments = self._arguments(name)
        self.last.append(f"{name}{arguments}")
        result = getattr(self._env, name)(*arguments.get("args", ()), **arguments.get("kw", {}))
        if name == "get_state":
            self._snapshot = result
        if name in ("reset", "step"):
            self._check(result)

    def _arguments(self, name: str) -> dict[str, Any]:
        """Of a call: good ones more often than not."""
        good = self._rng.random() < 0.7
        if name == "reset":
            seed = int(self._rng.integers(1000)) if good else self._hostile()
            return {"kw": {} if self._rng.random() < 0.3 else {"seed": seed}}
        if name == "step":
            return {"args": (self._action() if good else self._hostile(),)}
        if name in ("observe", "action_space", "observation_space"):
            return {"args": (self._agent() if good else self._hostile(),)}
        if name == "set_state":
            return {"args": (self._snapshot if good else self._hostile(),)}
        return {}

    def _action(self) -> Any:
        env = self._env
        if isinstance(env, KeepawayParallelEnv):
            return {name: int(env.action_space(name).sample()) for name in env.agents}
        if isinstance(env, KeepawayAECEnv):
            names = env.agents
            over = names and env.terminations[env.agent_selection]
            return None if over else int(env.action_space(env.possible_agents[0]).sample())
        return env.action_space.sample()

    def _agent(self) -> Any:
        return str(self._rng.choice(self._env.possible_agents))

    def _hostile(self) -> Any:
        return HOSTILE[self._rng.integers(len(HOSTILE))]

    def _check(self, result: Any) -> None:
        """What an environment gives lies in its spaces."""
        env = self._env
        if isinstance(env, KeepawayParallelEnv):
            for name, seen in result[0].items():
                assert env.observation_space(name).contains(seen), (name, seen)
        elif isinstance(env, KeepawayAECEnv):
            for name in env.agents:
                assert env.observation_space(name).contains(env.observe(name)), name
        else:
            assert env.observation_space.contains(result[0]), result[0]


def call_class(name: str, calls: int, seed: int) -> None:
    """Call one class in this process, and print the counts."""
    caller = Caller(CLASSES[name], seed)
    for _ in range(calls):
        try:
            caller.call()
        except BaseException:
            print(f"{name} fails after:", *caller.last, sep="\n  ", file=sys.stderr)
            raise
    answered = sum(n for (_, what), n in caller.counts.items() if what == "answered")
    kinds = sorted({what for _, what in caller.counts} - {"answered"})
    print(f"{name:20s} {calls:8,} {answered:9,} {calls - answered:8,}  {', '.join(kinds)}")


def main() -> int:
    """Call every class in a child of its own."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--calls", type=int, default=20_000, help="of each class (default 20,000)")
    parser.add_argument("--seed", type=int, default=0, help="of what is called")
    parser.add_argument("--only", action="append", choices=CLASSES, help="in this process")
    parser.add_argument("--write", action="store_true", help="write it into environments.md")
    args = parser.parse_args()
    for name in args.only or ():
        call_class(name, args.calls, args.seed)
    if args.only:
        return 0
    print(f"{'class':20s} {'calls':>8s} {'answered':>9s} {'refused':>8s}  with")
    counts = {name: _call_in_child(name, args.calls, args.seed) for name in CLASSES}
    if None in counts.values():
        return 1
    if args.write:
        keep({"hostile": made_here() | {"calls": counts}})
    return 0


def _call_in_child(name: str, calls: int, seed: int) -> tuple[int, int] | None:
    """Calls of a class, and those that were answered; None where its process failed."""
    command = [sys.executable, __file__, "--only", name]
    command += ["--calls", str(calls), "--seed", str(seed)]
    done = subprocess.run(command, check=False, stdout=subprocess.PIPE, text=True)
    print(done.stdout, end="", flush=True)
    if done.returncode:
        print(f"{name}: its process ended with {done.returncode}", file=sys.stderr)
        return None
    _, made, answered = done.stdout.replace(",", "").split()[:3]
    return int(made), int(answered)


if __name__ == "__main__":
    sys.exit(main())
