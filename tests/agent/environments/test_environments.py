"""Gymnasium's and PettingZoo's environments: their own tests, and the trainer's episodes."""

import re
from itertools import groupby
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import api_test, seed_test

from keepaway_agent import compiled
from keepaway_agent.environments import keepaway_v0
from keepaway_agent.environments.aec import KeepawayAECEnv
from keepaway_agent.environments.gym import KeeperEnv, KeeperVectorEnv
from keepaway_agent.errors import AgentError
from keepaway_agent.learning.features import keeper_features
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import StopRule, TrainerConfig, Trial, trial_seed
from keepaway_sim.task import Task


def test_gymnasium_accepts_the_environment() -> None:
    check_env(KeeperEnv(), skip_render_check=True)


@pytest.mark.filterwarnings("ignore:Environment has not defined a render")
def test_pettingzoo_accepts_the_environment() -> None:
    api_test(KeepawayAECEnv(), num_cycles=300)


def test_pettingzoo_finds_it_the_same_for_a_seed() -> None:
    seed_test(KeepawayAECEnv, num_cycles=100)


def durations(policy: str, task: str = "3v2", trials: int = 3) -> list[list[int]]:
    """Cycles of the first four episodes of every trial, as the trainer plays them."""
    trainer = Trainer(TrainerConfig(Task.parse(task)), num_fields=trials)
    stop = StopRule(max_episodes=4)
    done = {
        result.trial.label: result.durations.tolist()
        for result in trainer.run(
            Trial(trial_seed(6, k), stop, keeper_policy=policy, label=k) for k in range(trials)
        )
    }
    return [done[k] for k in range(trials)]


@pytest.mark.parametrize("task", ["3v2", "4v3"])
def test_holding_in_every_field_gives_the_trainers_episodes(task: str) -> None:
    env = KeeperVectorEnv(3, task=task)
    env.reset(seed=6)
    ends: list[list[int]] = [[], [], []]
    while min(map(len, ends)) < 4:
        _, rewards, ended, _, infos = env.step(np.zeros(3, dtype=np.int64))
        assert (rewards == infos["cycles"]).all()
        for field in np.flatnonzero(ended):
            ends[field].append(int(infos["cycle"][field]))
    assert [field[:4] for field in ends] == durations("hold", task)


def test_a_field_plays_the_same_whether_a_step_waits_for_all_or_for_any() -> None:
    """Choices go by the field's own count of them; waiting moves them to another step only."""
    played: dict[str, list[list[tuple[int, int]]]] = {}
    for wait_for in ("all", "any"):
        env = KeeperVectorEnv(4, wait_for=wait_for)
        _, infos = env.reset(seed=6)
        made, fields = np.zeros(4, dtype=np.int64), [[(0, 0)] for _ in range(4)]
        while min(map(len, fields)) < 60:
            actions = (made * np.arange(1, 5)) % 3
            made += infos["choosing"]
            _, rewards, ended, _, infos = env.step(actions)
            for field in np.flatnonzero(infos["choosing"] | ended):
                fields[field].append((int(rewards[field]), int(infos["cycle"][field])))
        played[wait_for] = [field[:60] for field in fields]
    assert played["all"] == played["any"]


def test_many_fields_at_once_equal_each_alone() -> None:
    """Field 0 of many is the only field of one, whatever is chosen beside it."""
    many, one = KeeperVectorEnv(5), KeeperEnv()
    states, _ = many.reset(seed=3)
    state, _ = one.reset(seed=3)
    rng, is_new = np.random.default_rng(0), False
    for _ in range(300):
        np.testing.assert_array_equal(states[0], state)
        actions = rng.integers(3, size=5)
        states, rewards, ended, _, infos = many.step(actions)
        if is_new:
            state, info = one.reset()
            is_new = False
        else:
            state, reward, is_new, _, info = one.step(int(actions[0]))
            assert (reward, is_new) == (rewards[0], ended[0])
        assert info == {name: values[0] for name, values in infos.items() if name[0] != "_"}


def test_a_keepers_rewards_are_the_cycles_since_its_own_last_choice() -> None:
    env, rng = KeepawayAECEnv(), np.random.default_rng(2)
    env.reset(seed=1)
    now, last, num_agents = 0.0, dict[str, float](), set[str]()
    while env.agents:
        agent = env.agent_selection
        _, reward, terminated, _, _ = env.last()
        assert reward == now - last.get(agent, 0.0)
        last[agent] = now
        num_agents.add(agent)
        env.step(None if terminated else int(rng.integers(3)))
        now += 0.0 if terminated else env.rewards[env.agents[0]]
    assert num_agents == set(env.possible_agents)


def test_it_is_made_by_its_name_alone_and_by_the_dozen() -> None:
    env = gymnasium.make("Keepaway-v0", task="4v3", disable_env_checker=True)
    assert env.observation_space.shape == (19,)
    assert gymnasium.make_vec("Keepaway-v0", num_envs=12).action_space.shape == (12,)


def test_an_observations_entries_have_names_and_infos_are_those_of_the_page() -> None:
    page = Path(__file__).parents[3] / "src/keepaway_agent/docs/environments.md"
    rows = re.findall(r"^\| ?(\w*) \| `(\w+)` \|", page.read_text(encoding="utf-8"), re.MULTILINE)
    told = {name for form, name in rows if form in ("Gymnasium", "")}
    env = gymnasium.make("keepaway_agent.environments:Keepaway-v0", task="4v3")
    observation, info = env.reset(seed=1)
    assert set(info) == told
    keeper = env.unwrapped
    assert isinstance(keeper, KeeperEnv)
    assert len(keeper.variables) == len(observation) == 19
    assert keeper.variables[:2] == ("dist_k1_c", "dist_k1_k2")
    many = KeeperVectorEnv(2, task="4v3")
    assert many.variables == keeper.variables
    turns = KeepawayAECEnv(teams="both", task="4v3")
    assert turns.variables("keeper_2") == many.variables
    assert turns.variables("taker_1")[0] == "dist_t1_b"
    with pytest.raises(AgentError, match="the agents are keeper_1"):
        turns.variables("nobody")


def test_the_packages_readme_has_a_keepers_variables_in_their_order() -> None:
    page = Path(__file__).parents[3] / "src/keepaway_agent/README.md"
    table = page.read_text(encoding="utf-8").split("| variables of a keeper K1")[1].split("\n\n")[0]
    groups = groupby(keeper_features(4, 3), key=lambda each: each.kind)
    firsts = [next(each).name for _, each in groups]
    assert re.findall(r"^\| `(\w+)`", table, re.MULTILINE) == firsts


def test_settings_that_make_no_game_are_refused() -> None:
    with pytest.raises(AgentError, match="taker policy 'nice'"):
        KeeperEnv(taker_policy="nice")


def test_no_step_of_an_environment_compiles(monkeypatch: pytest.MonkeyPatch) -> None:
    many = KeeperVectorEnv(2)
    at_once, in_turn = keepaway_v0.parallel_env(), keepaway_v0.turn_based_env(teams="both")
    monkeypatch.setattr(compiled, "make", lambda jobs: pytest.fail(f"compiles {jobs}"))
    many.reset(seed=1)
    many.step(many.action_space.sample())
    at_once.reset(seed=1)
    at_once.step(dict.fromkeys(at_once.agents, at_once.nothing))
    in_turn.reset(seed=1)
    in_turn.step(0)
