"""PettingZoo, turn by turn: every player is an agent; the one that has a choice is selected."""

from __future__ import annotations

import copy
from typing import Any, ClassVar

import numpy as np
from gymnasium.spaces import Box, Discrete
from pettingzoo import AECEnv
from pettingzoo.utils.env import AECIterable

from keepaway_agent.environments.one_field import OneField, OneFieldEnv
from keepaway_agent.environments.refusals import (
    InvalidActionError,
    ResetNeededError,
    checked_action,
)
from keepaway_agent.environments.snapshots import TurnState, require_kind


class KeepawayAECEnv(OneFieldEnv, AECEnv[str, np.ndarray, int]):
    """One field, turn by turn: an agent with a choice is selected, and simulated time waits for it.

    A keeper chooses between holding the ball (0) and passing to K(k+1) (k), when it can kick the
    ball; a taker between going to the ball (0) and marking K(k+1) (k), every five cycles. All
    choose on what they believe at the same moment, and then the field plays on to the next
    choice. Every cycle pays 1 to each keeper and -1 to each taker, so what `last` gives an agent
    is the reward since its own last choice, as for a learner of Taylor & Stone (2004).
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "keepaway_v0",
        "render_modes": OneField.RENDER_MODES,
        "render_fps": 10,
        "is_parallelizable": False,
    }

    def __init__(
        self,
        teams: str = "keepers",
        *,
        max_cycles: int | None = None,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        """Lay out the field.

        Args:
            teams: that are agents: keepers, takers or both.
            max_cycles: the first choice after them truncates the episode; None: never.
            render_mode: None, rgb_array, rgb_array_list or human.
            settings: those of `DecisionFields` but for the number of fields.

        Raises:
            AgentError, KeepawayError: settings that make no match.
        """
        super().__init__()
        self._lay_out(teams, max_cycles, render_mode, settings)
        self.observation_spaces = self._field.observation_spaces
        self.action_spaces = {name: Discrete(self._num_choices) for name in self.possible_agents}
        self._choices: dict[str, int] = {}

    def observation_space(self, agent: str) -> Box:
        """Of an agent's state variables."""
        self._field.role(agent)
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Discrete:
        """Hold or pass to K2, K3..; go to the ball or mark K2, K3.."""
        self._field.role(agent)
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Kick off, with the random numbers of `seed` or continuing those in use.

        Raises:
            InvalidSeedError, ClosedError: see `refusals`.
        """
        self._field.start(seed)
        if not self._field.fields.choosing.any():
            self._field.play_to_choice(until_the_end=False)
        self.agents = self.possible_agents[:]
        self.rewards = dict.fromkeys(self.agents, 0.0)
        self._cumulative_rewards = dict.fromkeys(self.agents, 0.0)
        self.terminations = dict.fromkeys(self.agents, False)
        self.truncations = dict.fromkeys(self.agents, False)
        self.infos: dict[str, dict[str, Any]] = {name: {} for name in self.agents}
        self._choices = {}
        self._note_cycle()
        self._select()

    def observe(self, agent: str) -> np.ndarray:
        """An agent's state variables now, a keeper's as if it had the ball.

        Raises:
            AgentError, ResetNeededError, ClosedError: no such agent, or no episode.
        """
        self._field.fields.require_started()
        return self._field.observe(agent)

    def last(self, observe: bool = True) -> Any:
        """The selected agent's observation, reward since its last choice, and whether it finished.

        Raises:
            ResetNeededError, ClosedError: see `refusals`.
        """
        self._require_agents()
        return super().last(observe)

    def agent_iter(self, max_iter: int = 2**63) -> AECIterable[str, np.ndarray, int]:
        """The agents in the order of their choices.

        Raises:
            ResetNeededError, ClosedError: see `refusals`.
        """
        self._field.fields.require_started()
        return super().agent_iter(max_iter)

    def step(self, action: int | None) -> None:
        """Make the selected agent's choice; when all have chosen, play on to the next ones.

        Raises:
            InvalidActionError, ResetNeededError, ClosedError: see `refusals`.
        """
        self._require_agents()
        agent = self.agent_selection
        if self.terminations[agent] or self.truncations[agent]:
            if action is not None:
                raise InvalidActionError(f"action={action!r}: {agent} has finished; give None")
            self._was_dead_step(action)
            return
        self._choices[agent] = checked_action(action, int(self.action_spaces[agent].n), agent)
        self._cumulative_rewards[agent] = 0.0
        self.rewards = dict.fromkeys(self.agents, 0.0)
        if not any(self._has_turn(name) for name in self.agents):
            self._play_on()
        self._accumulate_rewards()
        self._select()

    def get_state(self) -> TurnState:
        """The state of the field and of the turns now, as a copy: plain data.

        Raises:
            ResetNeededError, ClosedError: see `refusals`.
        """
        field = self._field.fields.get_state(0)
        books = copy.deepcopy(self._books())
        return TurnState(field, self.agents[:], self.agent_selection, dict(self._choices), books)

    def set_state(self, state: TurnState, seed: int | None = None) -> None:
        """Continue from a state; with random numbers from a seed, or those of the state.

        Raises:
            AgentError, KeepawayError, ClosedError: no such state, or one of another world.
        """
        self._field.set_state(require_kind(state, TurnState).field, seed)
        self.agents, self.agent_selection = state.agents[:], state.selected
        self._choices = dict(state.choices)
        (
            self.rewards,
            self._cumulative_rewards,
            self.terminations,
            self.truncations,
            self.infos,
        ) = copy.deepcopy(state.books)

    def _books(self) -> tuple[dict[str, Any], ...]:
        sums = self._cumulative_rewards
        return self.rewards, sums, self.terminations, self.truncations, self.infos

    def _play_on(self) -> None:
        """Apply all choices of a moment, and play to the next ones."""
        self._field.choose(self._choices)
        self._choices = {}
        cycles = self._field.play_to_choice(until_the_end=True)
        self.rewards = {name: self._field.reward(name) * cycles for name in self.agents}
        over = self._field.is_over
        late = not over and self._field.cycle >= self.max_cycles
        self.terminations = dict.fromkeys(self.agents, over)
        self.truncations = dict.fromkeys(self.agents, late)
        self._note_cycle()

    def _note_cycle(self) -> None:
        for name in self.agents:
            self.infos[name] = {"cycle": self._field.cycle}

    def _has_turn(self, name: str) -> bool:
        return self._field.chooses(name) and name not in self._choices

    def _select(self) -> None:
        """The first agent in match order that has a choice left; at the end, the first."""
        waiting = (name for name in self.agents if self._has_turn(name))
        self.agent_selection = next(waiting, self.agents[0])

    def _require_agents(self) -> None:
        self._field.fields.require_started()
        if not self.agents:
            raise ResetNeededError("the episode has ended: call reset first")
