"""Wrappers and vectors of both libraries take the environments."""

import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import wrappers
from gymnasium.wrappers import vector
from pettingzoo.utils import conversions
from pettingzoo.utils import wrappers as zoo

from keepaway_agent.environments import keepaway_v0

make = partial(gymnasium.make, "keepaway_agent.environments:Keepaway-v0")
make_vec = partial(gymnasium.make_vec, "keepaway_agent.environments:Keepaway-v0", num_envs=3)
both_teams = partial(keepaway_v0.turn_based_env, teams="both")

SINGLE: dict[str, Callable[[], Any]] = {
    "FlattenObservation": lambda: wrappers.FlattenObservation(make()),
    "FrameStackObservation": lambda: wrappers.FrameStackObservation(make(), 4),
    "MaxAndSkipObservation": lambda: wrappers.MaxAndSkipObservation(make(), 2),
    "NormalizeObservation": lambda: wrappers.NormalizeObservation(make()),
    "NormalizeReward": lambda: wrappers.NormalizeReward(make()),
    "RescaleObservation": lambda: wrappers.RescaleObservation(make(), np.float32(0), np.float32(1)),
    "StickyAction": lambda: wrappers.StickyAction(make(), 0.3),
    "TimeAwareObservation": lambda: wrappers.TimeAwareObservation(make(max_episode_steps=9)),
}
VECTORS: dict[str, Callable[[], Any]] = {
    "AsyncVectorEnv": lambda: gymnasium.vector.AsyncVectorEnv([make] * 2),
    "AsyncVectorEnv, no shared memory": lambda: gymnasium.vector.AsyncVectorEnv(
        [make] * 2, shared_memory=False
    ),
    "SyncVectorEnv": lambda: gymnasium.vector.SyncVectorEnv([make] * 2),
    "ClipReward": lambda: vector.ClipReward(make_vec(), 0, 1),
    "DictInfoToList": lambda: vector.DictInfoToList(make_vec()),
    "FlattenObservation": lambda: vector.FlattenObservation(make_vec()),
    "NormalizeObservation": lambda: vector.NormalizeObservation(make_vec()),
    "NormalizeReward": lambda: vector.NormalizeReward(make_vec()),
    "RecordEpisodeStatistics": lambda: vector.RecordEpisodeStatistics(make_vec()),
}
TURNS: dict[str, Callable[[], Any]] = {
    "AssertOutOfBoundsWrapper": lambda: zoo.AssertOutOfBoundsWrapper(both_teams()),
    "BaseWrapper": lambda: zoo.BaseWrapper(both_teams()),
    "MultiEpisodeEnv": lambda: zoo.MultiEpisodeEnv(both_teams(), num_episodes=2),
    "OrderEnforcingWrapper": lambda: zoo.OrderEnforcingWrapper(both_teams()),
    "TerminateIllegalWrapper": lambda: zoo.TerminateIllegalWrapper(keepaway_v0.env(), -1.0),
    "parallel_to_aec": lambda: conversions.parallel_to_aec(keepaway_v0.parallel_env()),
}
CYCLES: dict[str, Callable[[], Any]] = {
    "BaseParallelWrapper": lambda: zoo.BaseParallelWrapper(keepaway_v0.parallel_env()),
    "MultiEpisodeParallelEnv": lambda: zoo.MultiEpisodeParallelEnv(
        keepaway_v0.parallel_env(), num_episodes=2
    ),
    "aec_to_parallel": lambda: conversions.aec_to_parallel(keepaway_v0.env()),
    "turn_based_aec_to_parallel": lambda: conversions.turn_based_aec_to_parallel(both_teams()),
}


def allowed(space: Any, seen: Any) -> Any:
    return space.sample(seen["action_mask"] if isinstance(seen, dict) else None)


@pytest.mark.parametrize("name", SINGLE)
def test_a_wrapper_of_gymnasium_takes_it(name: str) -> None:
    env = SINGLE[name]()
    env.reset(seed=1)
    for _ in range(60):
        seen, _, terminated, truncated, _ = env.step(env.action_space.sample())
        assert env.observation_space.contains(seen)
        if terminated or truncated:
            env.reset()
    env.close()


@pytest.mark.parametrize("name", VECTORS)
def test_a_vector_of_gymnasium_takes_it(name: str) -> None:
    env = VECTORS[name]()
    env.reset(seed=1)
    for _ in range(60):
        seen, rewards, *_ = env.step(env.action_space.sample())
        assert seen.shape == env.observation_space.shape
        assert rewards.shape == (env.num_envs,)
    env.close()


@pytest.mark.parametrize("name", TURNS)
def test_a_wrapper_of_pettingzoo_takes_turns(name: str) -> None:
    env = TURNS[name]()
    env.reset(seed=1)
    for agent in env.agent_iter(max_iter=300):
        seen, _, terminated, truncated, _ = env.last()
        over = terminated or truncated
        env.step(None if over else allowed(env.action_space(agent), seen))
    env.close()


@pytest.mark.parametrize("name", CYCLES)
def test_a_wrapper_of_pettingzoo_takes_cycles(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # conversions say that they are for some games only
        env = CYCLES[name]()
    seen, _ = env.reset(seed=1)
    for _ in range(100):
        if not env.agents:
            seen, _ = env.reset()
        actions = {name: allowed(env.action_space(name), seen[name]) for name in env.agents}
        seen, *_ = env.step(actions)
    env.close()
