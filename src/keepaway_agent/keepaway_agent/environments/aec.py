"""PettingZoo: every keeper is an agent; the one that has a choice to make is selected."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box, Discrete
from pettingzoo import AECEnv

from keepaway_agent.environments.fields import Fields, observation_space


class KeepersAECEnv(AECEnv[str, np.ndarray, int]):
    """One field on which every keeper is an agent; the one that has a choice to make is selected.

    Every cycle pays 1 to each of them, so what `last` gives a keeper is the reward since its own
    last choice: what a learner of Taylor & Stone (2005) is paid.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "keepaway_v0", "render_modes": []}

    def __init__(self, **settings: Any) -> None:
        """Lay out the field; `settings` are those of `Fields`."""
        self._fields = Fields(**settings)
        task = self._fields.task
        self.render_mode = None
        self.possible_agents = list(task.player_names[: task.num_keepers])
        self.agents: list[str] = []
        self.observation_spaces = {name: observation_space(task) for name in self.possible_agents}
        self.action_spaces = {name: Discrete(task.num_keepers) for name in self.possible_agents}
        self._is_started = False

    def observation_space(self, agent: str) -> Box:
        """Of this keeper's state variables."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Discrete:
        """Hold, or pass to K2, K3.."""
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Kick off, with the random numbers of `seed` or going on with those in use."""
        if seed is None and self._is_started:
            self._fields.abort()
        else:
            self._fields.start(0, np.random.SeedSequence(seed, spawn_key=(0,)))
        self._is_started = True
        while not self._fields.choosing.any():
            self._play()
        self.agents = self.possible_agents[:]
        self.rewards = dict.fromkeys(self.agents, 0.0)
        self._cumulative_rewards = dict.fromkeys(self.agents, 0.0)
        self.terminations = dict.fromkeys(self.agents, False)
        self.truncations = dict.fromkeys(self.agents, False)
        self.infos: dict[str, dict[str, Any]] = {name: {} for name in self.agents}
        self._select()

    def observe(self, agent: str) -> np.ndarray:
        """A keeper's state variables now, as if it had the ball."""
        space = self.observation_space(agent)
        state = np.zeros(space.shape)
        self._fields.observe(0, self.possible_agents.index(agent), state)
        return np.clip(state, space.low, space.high).astype(np.float32)

    def step(self, action: int | None) -> None:
        """Make the selected keeper's choice; when all have chosen, play on to the next ones."""
        agent = self.agent_selection
        if self.terminations[agent]:
            self._was_dead_step(action)
            return
        keeper = self.possible_agents.index(agent)
        assert action is not None
        self._fields.choose(0, keeper, int(action))
        self._fields.choosing[0, keeper] = False
        self._cumulative_rewards[agent] = 0.0
        cycles = 0
        while not self._fields.choosing.any() and (cycles == 0 or not self._fields.is_over[0]):
            self._play()
            cycles += 1
        self.rewards = dict.fromkeys(self.agents, float(cycles))
        self.terminations = dict.fromkeys(self.agents, bool(self._fields.is_over[0]))
        self._accumulate_rewards()
        self._select()

    def _play(self) -> None:
        self._fields.step(np.ones(1, dtype=np.bool_))

    def _select(self) -> None:
        """The first keeper in match order that has a choice; at the end, the first in the list."""
        self.agent_selection = self.possible_agents[int(self._fields.choosing[0].argmax())]
