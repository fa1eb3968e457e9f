"""A moment can be taken down, copied and pickled; what follows is the same, bit for bit."""

import copy
import multiprocessing
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from keepaway_agent.environments import (
    KeepawayAECEnv,
    KeepawayParallelEnv,
    KeeperEnv,
    KeeperVectorEnv,
)
from keepaway_agent.errors import AgentError
from keepaway_sim.errors import KeepawayError


def play_one(env: KeeperEnv, rng: np.random.Generator, steps: int) -> list[Any]:
    seen: list[Any] = []
    for _ in range(steps):
        results = env.step(int(rng.integers(3)))
        seen.append(results)
        if results[2]:
            seen.append(env.reset())
    return seen


def play_many(env: KeeperVectorEnv, rng: np.random.Generator, steps: int) -> list[Any]:
    return [env.step(rng.integers(3, size=3)) for _ in range(steps)]


def play_turns(env: KeepawayAECEnv, rng: np.random.Generator, steps: int) -> list[Any]:
    seen: list[Any] = []
    for _ in range(steps):
        seen.append((env.agent_selection, env.last(), env.state()))
        over = env.terminations[env.agent_selection]
        env.step(None if over else int(rng.integers(3)))
        if not env.agents:
            env.reset()
    return seen


def play_cycles(env: KeepawayParallelEnv, rng: np.random.Generator, steps: int) -> list[Any]:
    seen: list[Any] = []
    for _ in range(steps):
        seen.append(env.step({name: int(rng.integers(3)) for name in env.agents}))
        if not env.agents:
            seen.append(env.reset())
    return seen


KINDS: dict[str, tuple[Callable[[], Any], Callable[..., list[Any]]]] = {
    "one": (KeeperEnv, play_one),
    "many": (lambda: KeeperVectorEnv(3, max_episode_steps=40, taker_policy="random"), play_many),
    "turns": (lambda: KeepawayAECEnv("both", task="4v3"), play_turns),
    "cycles": (lambda: KeepawayParallelEnv(task="2v1"), play_cycles),
    "eleven against ten": (lambda: KeepawayAECEnv("both", task="11v10"), play_turns),
}


def plain(result: Any) -> Any:
    """Arrays as lists, so that two results can be compared."""
    if isinstance(result, np.ndarray):
        return result.tolist()
    if isinstance(result, dict):
        return {name: plain(value) for name, value in result.items()}
    if isinstance(result, (list, tuple)):
        return [plain(value) for value in result]
    return result


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("way", ["state", "another's state", "deepcopy", "pickle"])
def test_what_follows_a_snapshot_is_the_same(kind: str, way: str) -> None:
    make, play = KINDS[kind]
    env = make()
    env.reset(seed=4)
    play(env, np.random.default_rng(0), 57)
    twin: Any = env
    if way in ("state", "another's state"):
        state = pickle.loads(pickle.dumps(env.get_state()))
        if way == "another's state":
            twin = make()
    else:
        twin = copy.deepcopy(env) if way == "deepcopy" else pickle.loads(pickle.dumps(env))
    first = plain(play(env, np.random.default_rng(1), 150))
    if way in ("state", "another's state"):
        twin.set_state(state)
    assert plain(play(twin, np.random.default_rng(1), 150)) == first


def test_a_copy_and_its_original_do_not_touch_each_other() -> None:
    env = KeeperEnv()
    env.reset(seed=2)
    twin, other = copy.deepcopy(env), copy.deepcopy(env)
    play_one(twin, np.random.default_rng(3), 60)
    assert plain(play_one(env, np.random.default_rng(1), 60)) == plain(
        play_one(other, np.random.default_rng(1), 60)
    )


def test_one_moment_goes_on_many_fields_with_luck_of_their_own() -> None:
    one, many = KeeperEnv(), KeeperVectorEnv(4)
    one.reset(seed=2)
    seen, _ = one.step(0)[0], play_one(one, np.random.default_rng(0), 30)
    moment = one.get_state()
    observations, _ = many.set_state([moment] * 4, seeds=[7, 8, 7, 9])
    assert (observations == observations[0]).all()
    assert observations[0].shape == seen.shape
    results = [many.step(np.zeros(4, dtype=np.int64))[0] for _ in range(40)]
    assert all((step[0] == step[2]).all() for step in results)
    assert any((step[0] != step[1]).any() for step in results)
    assert any((step[0] != step[3]).any() for step in results)


def test_what_is_no_state_of_this_world_is_refused() -> None:
    env, other = KeeperEnv(), KeeperEnv(task="4v3")
    env.reset(seed=1)
    other.reset(seed=1)
    before = plain(env.get_state().field.world.rows)
    wrong: Any
    for wrong in (None, 3, {}, env.get_state().field):
        with pytest.raises(AgentError, match="give what get_state"):
            env.set_state(wrong)
    with pytest.raises(KeepawayError, match="another world"):
        env.set_state(other.get_state())
    with pytest.raises(AgentError, match="give a list of 2"):
        KeeperVectorEnv(2).set_state([env.get_state()])
    assert plain(env.get_state().field.world.rows) == before


def _play_here(env: KeeperEnv) -> list[Any]:
    played: list[Any] = plain(play_one(env, np.random.default_rng(1), 60))
    return played


def test_a_spawned_worker_goes_on_where_it_was_sent() -> None:
    env = KeeperEnv()
    env.reset(seed=4)
    play_one(env, np.random.default_rng(0), 20)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        there = pool.apply(_play_here, (env,))
    assert there == _play_here(env)
