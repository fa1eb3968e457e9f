"""Takers are agents as keepers are: they play as the trainer's, on any task, for their own pay."""

import numpy as np
import pytest

from keepaway_agent.actions import Role
from keepaway_agent.environments import KeepawayAECEnv, KeepawayParallelEnv
from keepaway_agent.learning.features import feature_names
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import StopRule, TrainerConfig, Trial, trial_seed
from keepaway_sim.task import Task


def always(choice: int, config: TrainerConfig) -> np.ndarray:
    """Weights of takers who value one choice most whatever they see."""
    tiling = config.tiling(Role.TAKER)
    weights = np.zeros((config.task.num_keepers, tiling.num_features, tiling.num_tiles, 32))
    weights[choice] = 1.0
    return weights


def durations_of_trainer(choice: int, task: str, keepers: str) -> list[int]:
    config = TrainerConfig(Task.parse(task))
    weights = always(choice, config)
    trial = Trial(trial_seed(6, 0), StopRule(max_episodes=3), keepers, "greedy", None, weights)
    (result,) = Trainer(config, num_fields=1).run([trial])
    durations: list[int] = result.durations.tolist()
    return durations


def durations_of_turns(choice: int, task: str, keepers: str) -> list[int]:
    """Keepers from outside hold the ball."""
    teams = "both" if keepers == "outside" else "takers"
    env, durations = KeepawayAECEnv(teams, task=task, keeper_policy=keepers), list[int]()
    env.reset(seed=6)
    for _ in range(3):
        cycle = 0
        for agent in env.agent_iter():
            _, _, over, _, info = env.last()
            env.step(None if over else choice * agent.startswith("taker"))
            cycle = info["cycle"]
        durations.append(cycle)
        env.reset()
    return durations


@pytest.mark.parametrize(
    ("choice", "task", "keepers"),
    [(0, "3v2", "hold"), (0, "4v3", "outside"), (2, "4v3", "random")],
)
def test_takers_from_outside_play_as_the_trainers(choice: int, task: str, keepers: str) -> None:
    theirs = "hold" if keepers == "outside" else keepers
    wanted = durations_of_trainer(choice, task, theirs)
    assert durations_of_turns(choice, task, keepers) == wanted


@pytest.mark.parametrize("task", ["2v1", "6v5", "11v10"])
def test_any_number_of_players_plays(task: str) -> None:
    env = KeepawayParallelEnv(task=task, max_cycles=40)
    sizes = Task.parse(task)
    seen, _ = env.reset(seed=3)
    assert len(env.agents) == sizes.num_players
    rng, choices = np.random.default_rng(0), dict.fromkeys(env.agents, 0)
    while env.agents:
        masks = {name: each["action_mask"] for name, each in seen.items()}
        actions = {name: int(rng.choice(np.flatnonzero(mask))) for name, mask in masks.items()}
        for name, mask in masks.items():
            choices[name] += int(mask[0])
        seen, rewards, *_ = env.step(actions)
        assert {name: reward > 0 for name, reward in rewards.items()} == {
            name: name.startswith("keeper") for name in rewards
        }
    names = feature_names(Role.TAKER, sizes.num_keepers, sizes.num_takers)
    assert seen["taker_1"]["observation"].shape == (len(names),)
    assert all(choices[f"taker_{k + 1}"] >= 3 for k in range(sizes.num_takers))


def test_every_n_v_m_up_to_eleven_v_ten_is_played_turn_by_turn() -> None:
    for n in range(2, 12):
        for m in range(1, n):
            env = KeepawayAECEnv("both", task=f"{n}v{m}", max_cycles=6)
            env.reset(seed=n)
            asked = set[str]()
            for agent in env.agent_iter():
                seen, _, terminated, truncated, _ = env.last()
                assert env.observation_space(agent).contains(seen)
                over = terminated or truncated
                asked |= set() if over else {agent}
                env.step(None if over else n - 1)
            assert {f"taker_{k + 1}" for k in range(m)} <= asked


def test_a_takers_mask_opens_every_five_cycles() -> None:
    env = KeepawayParallelEnv("takers", keeper_policy="hold")
    seen, _ = env.reset(seed=1)
    opened = []
    for cycle in range(21):
        if seen["taker_1"]["action_mask"][0]:
            opened.append(cycle)
        seen, *_ = env.step(dict.fromkeys(env.agents, 0))
    assert opened == [0, 5, 10, 15, 20]
