"""PettingZoo, cycle by cycle: all players act at once; those without a choice do nothing."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from keepaway_agent.environments.one_field import OneField, OneFieldEnv
from keepaway_agent.environments.refusals import (
    MAX_CYCLES,
    InvalidActionError,
    ResetNeededError,
    checked_action,
)
from keepaway_agent.environments.snapshots import CycleState, require_kind

Observation = dict[str, np.ndarray]
"""An agent's "observation" and "action_mask"."""


class KeepawayParallelEnv(OneFieldEnv, ParallelEnv[str, Observation, int]):
    """One field, a cycle of 0.1 s a step: all agents act at once.

    Players decide at different moments. So there is one action more than choices, "nothing", and
    an agent's observation has a mask: either all choices, or nothing alone. An action that the mask
    forbids is not refused (random agents choose such actions): a choice out of turn does nothing,
    and nothing in place of a choice holds the ball, or lets a taker choose again a cycle later.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "keepaway_v0",
        "render_modes": OneField.RENDER_MODES,
        "render_fps": 10,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        teams: str = "both",
        *,
        max_cycles: int | None = None,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        """Lay out the field.

        Args:
            teams: that are agents: keepers, takers or both.
            max_cycles: after which an episode is truncated; None: never.
            render_mode: None, rgb_array, rgb_array_list or human.
            settings: those of `DecisionFields` but for the number of fields.

        Raises:
            AgentError, KeepawayError: settings that make no match.
        """
        self._lay_out(teams, max_cycles, render_mode, settings)
        self.observation_spaces = {
            name: spaces.Dict(
                {
                    "observation": self._field.observation_spaces[name],
                    "action_mask": spaces.Box(0, 1, (self._num_choices + 1,), np.int8),
                }
            )
            for name in self.possible_agents
        }
        self.action_spaces = {
            name: spaces.Discrete(self._num_choices + 1) for name in self.possible_agents
        }

    @property
    def nothing(self) -> int:
        """The action of agents without a choice."""
        return self._num_choices

    def observation_space(self, agent: str) -> spaces.Dict:
        """Of an agent's state variables and its mask."""
        self._field.role(agent)
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Discrete:
        """Hold or pass to K2..; go to the ball or mark K2..; and nothing, the last."""
        self._field.role(agent)
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Kick off, with the random numbers of `seed` or continuing those in use.

        Raises:
            InvalidSeedError, ClosedError: see `refusals`.
        """
        self._field.start(seed)
        self.agents = self.possible_agents[:]
        return self._observations(), self._infos()

    def step(self, actions: dict[str, int]) -> tuple[Any, Any, Any, Any, Any]:
        """Play a cycle.

        Args:
            actions: of every agent, by name.

        Returns:
            observations, rewards, terminations, truncations and infos, by name.

        Raises:
            InvalidActionError, ResetNeededError, ClosedError: see `refusals`.
        """
        self._field.fields.require_started()
        if not self.agents:
            raise ResetNeededError("the episode has ended: call reset first")
        self._field.choose(self._choices(actions))
        self._field.play()
        over = self._field.is_over
        late = not over and self._field.cycle >= min(self.max_cycles, MAX_CYCLES)
        names = self.agents
        results = (
            self._observations(),
            {name: self._field.reward(name) for name in names},
            dict.fromkeys(names, over),
            dict.fromkeys(names, late),
            self._infos(),
        )
        if over or late:
            self.agents = []
        return results

    def get_state(self) -> CycleState:
        """The state of the field now, as a copy: plain data.

        Raises:
            ResetNeededError, ClosedError: see `refusals`.
        """
        return CycleState(self._field.fields.get_state(0), self.agents[:])

    def set_state(
        self, state: CycleState, seed: int | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Continue from a state; with random numbers from a seed, or those of the state.

        Returns:
            observations and infos, as of `reset`.

        Raises:
            AgentError, KeepawayError, ClosedError: no such state, or one of another world.
        """
        self._field.set_state(require_kind(state, CycleState).field, seed)
        self.agents = state.agents[:]
        return self._observations(), self._infos()

    def _choices(self, actions: Any) -> dict[str, int]:
        """Choices that take effect: those of agents that have one to make."""
        if not isinstance(actions, dict) or set(actions) != set(self.agents):
            raise InvalidActionError(
                f"actions={actions!r:.60}: give one for each of {', '.join(self.agents)}"
            )
        checked = {
            name: checked_action(actions[name], self.nothing + 1, name) for name in self.agents
        }
        return {
            name: action
            for name, action in checked.items()
            if action != self.nothing and self._field.chooses(name)
        }

    def _observations(self) -> dict[str, Observation]:
        return {
            name: {"observation": self._field.observe(name), "action_mask": self._mask(name)}
            for name in self.agents
        }

    def _mask(self, name: str) -> np.ndarray:
        chooses = self._field.chooses(name) and not self._field.is_over
        mask = np.full(self._num_choices + 1, chooses, dtype=np.int8)
        mask[self.nothing] = not chooses
        return mask

    def _infos(self) -> dict[str, dict[str, Any]]:
        return {name: {"cycle": self._field.cycle} for name in self.agents}
