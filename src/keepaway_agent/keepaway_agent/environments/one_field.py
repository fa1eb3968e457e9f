"""One field with named agents of one team or both: what PettingZoo's two forms have in common."""

from __future__ import annotations

from typing import Any, ClassVar, Final

import numpy as np
from gymnasium.spaces import Box

from keepaway_agent.actions import Role
from keepaway_agent.environments.camera import Camera
from keepaway_agent.environments.compiled_fields import NO_CHOICE
from keepaway_agent.environments.fields import OUTSIDE, DecisionFields
from keepaway_agent.environments.refusals import checked_limit, checked_mode, checked_seed
from keepaway_agent.environments.snapshots import FieldState, with_new_luck
from keepaway_agent.environments.spaces import observation_space, state_space, variable_names
from keepaway_agent.errors import AgentError
from keepaway_agent.playing.policies import KEEPER_REWARD, TAKER_REWARD
from keepaway_agent.training.trial import trial_seed

TEAMS: Final = ("keepers", "takers", "both")
"""The teams that are agents; the other team plays by a rule."""


class OneField:
    """One field whose agents are known by name.

    Attributes:
        fields: the field.
        camera: what is seen of it.
        names: of the agents, in match order.
        observation_spaces: by name, of state variables.
    """

    RENDER_MODES: ClassVar[list[str]] = ["rgb_array", "rgb_array_list", "human"]

    def __init__(self, teams: str, render_mode: str | None, settings: dict[str, Any]) -> None:
        """Lay out the field.

        Args:
            teams: one of TEAMS.
            render_mode: None or one of RENDER_MODES.
            settings: those of `DecisionFields` but for the number of fields.

        Raises:
            AgentError, KeepawayError: settings that make no match.
        """
        if not isinstance(teams, str) or teams not in TEAMS:
            raise AgentError(f"teams={teams!r}: choose one of {', '.join(TEAMS)}")
        self.render_mode = checked_mode(render_mode, self.RENDER_MODES)
        self.fields = DecisionFields(num_fields=1, **_completed(teams, settings))
        self.fields.prepare()
        self.camera = Camera(self.fields, self.render_mode)
        task = self.fields.task
        n = task.num_keepers
        self._players = {
            name: player
            for player, name in enumerate(task.player_names)
            if teams == "both" or (teams == "keepers") == (player < n)
        }
        self.names = list(self._players)
        self.observation_spaces = {
            name: observation_space(task, self.role(name)) for name in self.names
        }
        self.state_space = state_space(task, self.fields.world.config)
        self._everywhere = np.ones(1, dtype=np.bool_)
        self._choices = np.full((1, task.num_players), NO_CHOICE)

    def role(self, name: str) -> Role:
        """The team of an agent.

        Raises:
            AgentError: no agent of this name.
        """
        is_keeper = self._player(name) < self.fields.task.num_keepers
        return Role.KEEPER if is_keeper else Role.TAKER

    def reward(self, name: str) -> float:
        """An agent's reward for a cycle in play."""
        return KEEPER_REWARD if self.role(name) == Role.KEEPER else TAKER_REWARD

    def start(self, seed: int | None) -> None:
        """Kick off: with the random numbers of a seed, or continuing those in use."""
        self.fields.require_open()
        chosen = checked_seed(seed)
        if chosen is None and self.fields.is_started:
            self.fields.abort(self._everywhere)
            self.fields.step(self._everywhere)
        else:
            self.fields.start(0, trial_seed(np.random.SeedSequence(chosen).entropy, 0))  # type: ignore[arg-type]

    def set_state(self, state: FieldState, seed: int | None) -> None:
        """Continue from a state; with random numbers from a seed, or those of the state."""
        self.fields.set_state(0, state if seed is None else with_new_luck(state, seed))

    def play_to_choice(self, *, until_the_end: bool) -> int:
        """Play on to the next choice of any agent, or to the episode's end; cycles."""
        cycles = np.zeros(1, dtype=np.int64)
        self.fields.play_on(self._everywhere, self._everywhere & until_the_end, cycles)
        return int(cycles[0])

    def play(self) -> None:
        """Play one cycle."""
        self.fields.step(self._everywhere)

    def chooses(self, name: str) -> bool:
        """Whether an agent has a choice to make now."""
        return bool(self.fields.choosing[0, self._player(name)])

    def choose(self, choices: dict[str, int]) -> None:
        """Make choices, by name."""
        self._choices[:] = NO_CHOICE
        for name, choice in choices.items():
            self._choices[0, self._player(name)] = choice
        self.fields.choose(self._choices)

    @property
    def is_over(self) -> bool:
        """Whether the episode has ended."""
        return bool(self.fields.is_over[0])

    @property
    def cycle(self) -> int:
        """Cycles since kick-off."""
        return int(self.fields.cycle[0])

    def observe(self, name: str) -> np.ndarray:
        """An agent's state variables now, a keeper's as if it had the ball; float32."""
        role, player = self.role(name), self._player(name)
        seen = np.empty((1, *(self.observation_spaces[name].shape)), dtype=np.float32)
        self.fields.observe(role, np.array([player]), seen)
        own: np.ndarray = seen[0]
        return own

    def state(self) -> np.ndarray:
        """The truth, a point of `state_space`: what no player knows."""
        truth = self.fields.world.truth
        motion = np.concatenate([truth.position[0], truth.velocity[0]], axis=1)
        all_of_it = np.concatenate([motion.ravel(), truth.yaw[0]])
        space: Box = self.state_space
        inside: np.ndarray = np.clip(all_of_it, space.low, space.high).astype(np.float32)
        return inside

    def close(self) -> None:
        """Play no more, and close the window."""
        self.fields.close()
        self.camera.close()

    def _player(self, name: str) -> int:
        if not isinstance(name, str) or name not in self._players:
            raise AgentError(f"agent={name!r}: the agents are {', '.join(self._players)}")
        return self._players[name]


class OneFieldEnv:
    """What is the same whether agents act in turn or at once: the field, its truth, its pictures.

    Attributes:
        max_cycles: after which an episode is truncated.
        render_mode: None or one of `OneField.RENDER_MODES`.
        possible_agents, agents: names of all, and of those that have not finished.
        state_space: of `state`.
    """

    def _lay_out(
        self, teams: str, max_cycles: int | None, render_mode: str | None, settings: dict[str, Any]
    ) -> None:
        """Lay out the field; arguments and errors are those of both constructors."""
        self.max_cycles = checked_limit("max_cycles", max_cycles)
        self._field = OneField(teams, render_mode, settings)
        self._num_choices = self._field.fields.task.num_keepers
        self.render_mode = self._field.render_mode
        self.possible_agents = self._field.names[:]
        self.agents: list[str] = []
        self.state_space = self._field.state_space

    def variables(self, agent: str) -> tuple[str, ...]:
        """Names of the entries of an agent's observation, in order.

        Raises:
            AgentError: no agent of this name.
        """
        return variable_names(self._field.fields.task, self._field.role(agent))

    def state(self) -> np.ndarray:
        """The truth, which no player knows: see `spaces.state_space`.

        Raises:
            ResetNeededError, ClosedError: see `refusals`.
        """
        self._field.fields.require_started()
        return self._field.state()

    def render(self) -> Any:
        """A frame or frames, by the render mode; None without one, and in a window.

        Raises:
            ResetNeededError, ClosedError: see `refusals`.
        """
        self._field.fields.require_started()
        return self._field.camera.render()

    def close(self) -> None:
        """Play no more, and close the window."""
        self._field.close()


def _completed(teams: str, settings: dict[str, Any]) -> dict[str, Any]:
    """The settings with the policies of teams whose players are agents."""
    known = ("task", "keeper_policy", "taker_policy", "config", "ordering", "decision_interval")
    for name in settings:
        if name not in known:
            raise AgentError(f"{name}: no setting of this environment; {', '.join(known)} are")
    policies = {}
    for policy, team in (("keeper_policy", "keepers"), ("taker_policy", "takers")):
        are_agents, given = teams in (team, "both"), settings.get(policy)
        if given is not None and are_agents != _is(given, OUTSIDE):
            way_out = f"the {team} are agents" if are_agents else "take teams='both' for that"
            raise AgentError(f"{policy}={given!r:.60}: {way_out}")
        policies[policy] = OUTSIDE if are_agents else ("hand" if given is None else given)
    return settings | policies


def _is(value: Any, text: str) -> bool:
    return isinstance(value, str) and value == text
