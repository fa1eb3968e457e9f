"""Gymnasium's and PettingZoo's own tests, each by name, and the table of them on the page."""

import gymnasium
import numpy as np
import pettingzoo
import pytest
from environment_tests import CHECKS, LEFT_OUT, outcome, written
from gymnasium.vector import VectorEnv
from gymnasium.wrappers.vector import DictInfoToList, RecordEpisodeStatistics

from keepaway_agent.environments import KeepawayAECEnv, KeepawayParallelEnv, KeeperVectorEnv


@pytest.mark.parametrize("name", CHECKS)
def test_the_library_accepts_it_and_the_page_has_its_outcome(name: str) -> None:
    what, check = CHECKS[name]
    result = outcome(check)
    assert result.startswith("passed")
    assert f"| {name} | {what} | {result} |" in written().splitlines()


def test_the_page_names_the_tests_that_do_not_apply() -> None:
    rows = written().splitlines()
    assert [row for row in rows if "does not apply" in row] == [
        f"| {name} | | does not apply: {why} |" for name, why in LEFT_OUT.items()
    ]
    assert len(rows) == 2 + len(CHECKS) + len(LEFT_OUT)


@pytest.mark.parametrize("name", ["Keepaway-v0", "keepaway_agent.environments:Keepaway-v0"])
@pytest.mark.parametrize("mode", [None, "sync"])
def test_it_is_made_by_name_alone_and_by_the_dozen(name: str, mode: str | None) -> None:
    one = gymnasium.make(name, task="4v3", max_episode_steps=7)
    assert one.observation_space.shape == (19,)
    many = gymnasium.make_vec(
        name, 12, vectorization_mode=mode, max_episode_steps=7, render_mode="rgb_array"
    )
    assert many.action_space.shape == (12,)
    many.reset(seed=1)
    frames = many.render()
    assert frames is not None
    assert len(frames) == 12


def cut_off(env: VectorEnv, steps: int) -> list[np.ndarray]:
    env.reset(seed=[5])  # type: ignore[arg-type]
    results: list[np.ndarray] = []
    for k in range(steps):
        results += [np.concatenate([np.ravel(each) for each in env.step(np.array([k % 3]))[:4]])]
    return results


def test_cut_off_after_choices_as_by_the_time_limit_of_single_ones() -> None:
    ours = gymnasium.make_vec("Keepaway-v0", 1, max_episode_steps=9)
    theirs = gymnasium.make_vec("Keepaway-v0", 1, max_episode_steps=9, vectorization_mode="sync")
    assert isinstance(ours.unwrapped, KeeperVectorEnv)
    first, second = cut_off(ours, 60), cut_off(theirs, 60)
    np.testing.assert_array_equal(first, second)
    truncations = [result[-1] for result in first]
    assert sum(truncations) > 1


def test_infos_are_understood_by_gymnasiums_wrappers() -> None:
    env = DictInfoToList(RecordEpisodeStatistics(gymnasium.make_vec("Keepaway-v0", 4)))
    env.reset(seed=1)
    ended = 0
    for _ in range(60):
        _, _, over, _, infos = env.step(np.ones(4, dtype=np.int64))
        for field in range(4):
            assert {"cycles", "cycle", "keeper"} <= set(infos[field])
            if over[field]:
                ended += 1
                assert infos[field]["episode"]["r"] > 0
    assert ended > 2


def test_pettingzoo_makes_them_by_name() -> None:
    parallel = pettingzoo.make("parallel", "Keepaway-v0", max_cycles=5, task="4v3")
    assert isinstance(parallel, KeepawayParallelEnv)
    assert parallel.max_cycles == 5
    assert isinstance(pettingzoo.make("aec", "KeepawayTurns-v0"), KeepawayAECEnv)
    assert pettingzoo.make("aec", "Keepaway-v0").max_num_agents == 5
