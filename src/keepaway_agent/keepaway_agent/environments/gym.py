"""The keepers' decision problem for learners from elsewhere: Gymnasium and PettingZoo environments.

A keeper that can kick the ball chooses: 0 holds it, k passes to K(k+1). It sees the 4n + 2m - 3
state variables of `features.keeper_state` as it believes them to be. Whoever has no choice to make
follows the rules of `policies`, and so do the takers. One cycle in play pays 1, and cycles go by
between two choices: the problem is a semi-Markov one, and `infos` tell how many (Taylor & Stone
2005). The world is that of the trainer: field k of a reset with seed s plays what trial k of a
training with seed s plays.

============================  =======================================================
`KeeperEnv`                   one field; whichever keeper has the choice is the agent
`KeeperVectorEnv`             the same for many fields of one `World`, next-step reset
`KeepersAECEnv`               one field; every keeper is an agent of its own
============================  =======================================================
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from keepaway_agent.environments.fields import Fields, observation_space
from keepaway_agent.training.trial import trial_seed


class KeeperVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Many fields; on each the keeper that has a choice is the agent.

    A step goes from choice to choice; where the episode ended the next step's action is ignored
    and gives the first choice of a new episode. If two keepers could kick the ball at once, the
    first in match order chooses and the other holds it. Rewards are cycles.

    `infos`: "cycles" that the step took, "cycle" since kick-off, "keeper" who chooses.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as the base class declares it
        "autoreset_mode": AutoresetMode.NEXT_STEP,
        "render_modes": [],
    }

    single_observation_space: Box
    single_action_space: Discrete

    def __init__(self, num_envs: int = 1, **settings: Any) -> None:
        """Lay out `num_envs` fields; `settings` are those of `Fields`."""
        self._fields = Fields(num_fields=num_envs, **settings)
        task = self._fields.task
        self.num_envs = num_envs
        self.single_observation_space = observation_space(task)
        self.single_action_space = Discrete(task.num_keepers)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._keeper = np.zeros(num_envs, dtype=np.int64)
        self._state = np.zeros(self.observation_space.shape or ())
        self._is_started = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Kick off everywhere: with the random numbers of `seed`, or going on with those in use."""
        super().reset(seed=seed)
        if seed is None and self._is_started:
            self._fields.abort()
        else:
            chosen = int(self.np_random.integers(2**63)) if seed is None else seed
            for field in range(self.num_envs):
                self._fields.start(field, trial_seed(chosen, field))
        self._is_started = True
        waiting = np.asarray(~self._fields.choosing.any(axis=1))
        self._advance(waiting, np.zeros(self.num_envs, dtype=np.bool_))
        return self._observations(), self._infos(np.zeros(self.num_envs, dtype=np.int64))

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Make every field's choice, and play on to its next one or to the end of its episode."""
        in_play = ~self._fields.is_over
        for field in np.flatnonzero(in_play):
            self._fields.choose(int(field), int(self._keeper[field]), int(actions[field]))
        cycles = self._advance(np.ones(self.num_envs, dtype=np.bool_), in_play)
        rewards = np.where(in_play, cycles, 0)
        ended = self._fields.is_over
        return (
            self._observations(),
            rewards.astype(np.float64),
            ended,
            np.zeros(self.num_envs, dtype=np.bool_),
            self._infos(rewards),
        )

    def _advance(self, moving: np.ndarray, has_chosen: np.ndarray) -> np.ndarray:
        """Play on to the next choice, or to the end where one was made; (num_envs,) cycles."""
        cycles = np.zeros(self.num_envs, dtype=np.int64)
        while moving.any():
            self._fields.step(moving)
            cycles += moving
            moving = moving & ~self._fields.choosing.any(axis=1)
            moving &= ~(self._fields.is_over & has_chosen)
        return cycles

    def _observations(self) -> np.ndarray:
        choosing = self._fields.choosing
        self._keeper = np.where(choosing.any(axis=1), choosing.argmax(axis=1), self._keeper)
        for field, keeper in enumerate(self._keeper.tolist()):
            self._fields.observe(field, keeper, self._state[field])
        space = self.single_observation_space
        return np.clip(self._state, space.low, space.high).astype(np.float32)

    def _infos(self, cycles: np.ndarray) -> dict[str, Any]:
        return {"cycles": cycles, "cycle": self._fields.cycle.copy(), "keeper": self._keeper.copy()}


class KeeperEnv(gymnasium.Env[np.ndarray, Any]):
    """One field, from choice to choice of whichever keeper has it; see `KeeperVectorEnv`."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - ditto

    def __init__(self, render_mode: None = None, **settings: Any) -> None:
        """Lay out the field; `settings` are those of `Fields`."""
        self._env = KeeperVectorEnv(1, **settings)
        self.observation_space = self._env.single_observation_space
        self.action_space = self._env.single_action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Kick off, with the random numbers of `seed` or going on with those in use."""
        super().reset(seed=seed)
        observations, infos = self._env.reset(seed=seed)
        return observations[0], _first(infos)

    def step(self, action: int) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Make the choice, and play on to the next one or to the end of the episode."""
        state, reward, ended, _, infos = self._env.step(np.array([action]))
        return state[0], float(reward[0]), bool(ended[0]), False, _first(infos)


def _first(infos: dict[str, np.ndarray]) -> dict[str, int]:
    return {name: int(values[0]) for name, values in infos.items()}
