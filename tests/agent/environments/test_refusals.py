"""No call ends the process or makes up an answer: what is wrong is refused, by name."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from keepaway_agent.environments import (
    KeepawayAECEnv,
    KeepawayParallelEnv,
    KeeperEnv,
    KeeperVectorEnv,
)
from keepaway_agent.environments.refusals import (
    ClosedError,
    InvalidActionError,
    InvalidSeedError,
    ResetNeededError,
    UnsupportedModeError,
)
from keepaway_agent.errors import AgentError
from keepaway_sim.errors import KeepawayError

CLASSES = [KeeperEnv, KeeperVectorEnv, KeepawayAECEnv, KeepawayParallelEnv]
NOTHING: dict[type, Any] = {
    KeeperEnv: 0,
    KeeperVectorEnv: np.zeros(1, dtype=np.int64),
    KeepawayAECEnv: 0,
    KeepawayParallelEnv: dict.fromkeys(
        ["keeper_1", "keeper_2", "keeper_3", "taker_1", "taker_2"], 3
    ),
}


@pytest.mark.parametrize("make", CLASSES)
def test_nothing_is_played_before_the_first_reset(make: Callable[..., Any]) -> None:
    env = make(render_mode="rgb_array")
    calls = [lambda: env.step(NOTHING[type(env)]), env.render, env.get_state]
    calls += [getattr(env, name) for name in ("state", "last", "agent_iter") if hasattr(env, name)]
    for call in calls:
        with pytest.raises(ResetNeededError):
            call()


@pytest.mark.parametrize("make", CLASSES)
def test_nothing_is_played_after_close(make: Callable[..., Any]) -> None:
    env = make(render_mode="rgb_array")
    env.reset(seed=1)
    state = env.get_state()
    env.close()
    env.close()
    for call in (
        env.reset,
        lambda: env.step(NOTHING[type(env)]),
        env.render,
        env.get_state,
        lambda: env.set_state(state),
    ):
        with pytest.raises(ClosedError):
            call()


@pytest.mark.parametrize("action", [-3, 1.7, True, 99, "0", None, [0], np.array([0]), np.nan])
def test_an_action_outside_its_space_is_refused(action: Any) -> None:
    one, turns = KeeperEnv(), KeepawayAECEnv()
    one.reset(seed=1)
    turns.reset(seed=1)
    for env in (one, turns):
        before = env.get_state()
        with pytest.raises(InvalidActionError, match="give a whole number from 0 to 2"):
            env.step(action)
        np.testing.assert_array_equal(before.field.requests, env.get_state().field.requests)
    with pytest.raises(gymnasium.error.InvalidAction):
        one.step(action)


@pytest.mark.parametrize(
    "actions",
    [0, [0], [0, 0, 0, 0, 0], [0, -1], [0, 3], [0, 0.5], [True, False], [[0], [0, 1]], ["a", "b"]],
)
def test_one_action_for_each_field_and_of_its_space(actions: Any) -> None:
    env = KeeperVectorEnv(2)
    env.reset(seed=1)
    with pytest.raises(InvalidActionError):
        env.step(actions)


def test_all_agents_act_and_nobody_else() -> None:
    env = KeepawayParallelEnv()
    env.reset(seed=1)
    wrong: Any
    for wrong in ({}, {"keeper_1": 0}, NOTHING[KeepawayParallelEnv] | {"taker_9": 0}, 0, None):
        with pytest.raises(InvalidActionError, match="give one for each"):
            env.step(wrong)


def test_an_episode_that_has_ended_goes_no_further() -> None:
    one, turns, cycles = KeeperEnv(), KeepawayAECEnv(), KeepawayParallelEnv(max_cycles=2)
    one.reset(seed=1)
    while not one.step(1)[2]:
        pass
    turns.reset(seed=1)
    for _ in turns.agent_iter():
        turns.step(None if turns.last()[2] else 1)
    cycles.reset(seed=1)
    for _ in range(2):
        cycles.step(NOTHING[KeepawayParallelEnv])
    for env in (one, turns, cycles):
        with pytest.raises(ResetNeededError, match="the episode has ended"):
            env.step(NOTHING[type(env)])


@pytest.mark.parametrize("make", CLASSES)
@pytest.mark.parametrize("seed", [-1, 1.5, "1", True, np.float64(3)])
def test_a_seed_is_a_whole_number(make: Callable[..., Any], seed: Any) -> None:
    with pytest.raises(InvalidSeedError, match="give a whole number"):
        make().reset(seed=seed)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"taker_policy": "learn"}, "taker policy 'learn': choose one of outside, random, hand"),
        ({"taker_policy": "outside"}, "takers are agents in keepaway_v0"),
        ({"keeper_policy": "hand"}, "keeper_policy: no setting of this environment"),
        ({"num_fields": 3}, "num_fields: no setting of this environment"),
        ({"num_envs": 3}, "num_envs: no setting of this environment"),
        ({"config": {"profile": "2005"}}, "config=.*give a keepaway_sim.world.config.Config"),
        ({"task": 3}, "task=3: write keepers v takers"),
        ({"task": "12v3"}, "num_keepers=12"),
        ({"ordering": None}, "ordering None"),
        ({"decision_interval": 0}, "decision_interval=0: give a whole number from 1"),
        ({"render_mode": "ansi"}, "render_mode='ansi': choose None or one of rgb_array"),
    ],
)
def test_settings_that_make_no_game_are_refused(settings: dict[str, Any], words: str) -> None:
    with pytest.raises((AgentError, KeepawayError), match=words):
        KeeperEnv(**settings)


@pytest.mark.parametrize("num_envs", [0, -1, 1.5, True, "3", 10**9])
def test_a_number_of_fields_that_cannot_be_is_refused(num_envs: Any) -> None:
    with pytest.raises(AgentError, match=r"num_envs=.*: give a whole number from 1 to 4096"):
        KeeperVectorEnv(num_envs)


def test_teams_and_their_policies_fit_together() -> None:
    for settings in (
        {"teams": "nobody"},
        {"teams": "keepers", "keeper_policy": "hand"},
        {"teams": "keepers", "taker_policy": "outside"},
    ):
        with pytest.raises(AgentError):
            KeepawayAECEnv(**settings)  # type: ignore[arg-type]


def test_a_window_where_there_is_no_screen_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "no such driver")
    with pytest.raises(UnsupportedModeError, match="no window can be opened"):
        KeeperEnv(render_mode="human").reset(seed=1)


def test_random_and_hostile_calls_are_answered_or_refused(root: Path) -> None:
    """A short run of scripts/checks/hostile.py: all classes in one child process."""
    script = root / "scripts" / "checks" / "hostile.py"
    command = [sys.executable, str(script), "--calls", "800", "--seed", "5"]
    for make in CLASSES:
        command += ["--only", make.__name__]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    rows = [line.split(maxsplit=4) for line in done.stdout.splitlines()]
    assert [row[0] for row in rows] == [make.__name__ for make in CLASSES]
    for _, calls, answered, refused, _ in rows:
        assert int(answered) > 150
        assert int(refused) > 150
        assert int(answered) + int(refused) == int(calls) == 800
