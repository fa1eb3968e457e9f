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

import math
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from pettingzoo import AECEnv

from keepaway_agent.actions import NO_TARGET, Action, Outcome, Role
from keepaway_agent.learning import sarsa
from keepaway_agent.learning.cmac import make_tiling
from keepaway_agent.learning.features import ORDERINGS, keeper_features, keeper_state, rank_players
from keepaway_agent.learning.sarsa import UNIFORMS_PER_CHOICE
from keepaway_agent.playing.policies import make_player
from keepaway_agent.training.trainer import child_seed, decide_all, trial_seed
from keepaway_sim.task import Task
from keepaway_sim.world.config import Config
from keepaway_sim.world.streams import RandomStreams
from keepaway_sim.world.world import World


class Fields:
    """Fields of one World on which keepers' choices are made from outside.

    Attributes:
        task: what is played.
        choosing: (num_fields, num_keepers) bool, who has a choice to make now.
        cycle: (num_fields,) cycles since kick-off.
    """

    def __init__(
        self,
        task: str = "3v2",
        num_fields: int = 1,
        taker_policy: str = "hand",
        config: Config | None = None,
        ordering: str = "ball",
    ) -> None:
        """Lay out the fields.

        Args:
            task: keepers v takers.
            num_fields: played side by side.
            taker_policy: hand or random.
            config: of the world.
            ordering: what ranks players, ball or k1.

        Raises:
            AgentError, KeepawayError: settings with which nobody can play.
        """
        self.task = Task.parse(task)
        self._world = World(self.task, config or Config(), num_fields)
        n, num_players = self.task.num_keepers, self.task.num_players
        shape = (num_fields, num_players)
        self.choosing = np.zeros((num_fields, n), dtype=np.bool_)
        self.cycle = self._world.perceptions.cycle
        self._keeper = make_player(0, n, "hold", ordering)
        self._taker = make_player(n, n, taker_policy)
        self._policy = np.full(shape, self._keeper.policy)
        self._policy[:, n:] = self._taker.policy
        self._learners = [
            sarsa.make_learners(
                num_fields * size, n, make_tiling(role, n, self.task.num_takers), None
            )
            for role, size in ((Role.KEEPER, n), (Role.TAKER, self.task.num_takers))
        ]
        self._ordering = ORDERINGS[ordering]
        self._streams = RandomStreams(num_fields * num_players, UNIFORMS_PER_CHOICE, block=512)
        self._order = np.zeros(num_players, dtype=np.int64)
        self._action = np.zeros(shape, dtype=np.int64)
        self._target = np.zeros(shape, dtype=np.int64)

    @property
    def is_over(self) -> np.ndarray:
        """(num_fields,) whether the episode has ended; the next cycle kicks off a new one."""
        over: np.ndarray = self._world.perceptions.outcome != Outcome.IN_PLAY
        return over

    def start(self, field: int, seed: np.random.SeedSequence) -> None:
        """Begin anew on a field, with all random numbers from this seed."""
        first = field * self.task.num_players
        for player in range(self.task.num_players):
            generator = np.random.default_rng(child_seed(seed, 1, player))
            self._streams.seed(first + player, generator)
        self._world.start(field, child_seed(seed, 0))
        self._look(np.arange(len(self.cycle)) == field)

    def abort(self) -> None:
        """End the episodes of all fields; the next cycle kicks off new ones."""
        for field in np.flatnonzero(~self.is_over):
            self._world.abort(int(field))
        self.choosing[:] = False

    def choose(self, field: int, keeper: int, choice: int) -> None:
        """Make a keeper's choice: 0 to hold, k to pass to K(k+1)."""
        action, target = Action.HOLD_BALL, NO_TARGET
        if choice:
            self._rank(field, keeper)
            action, target = Action.PASS_BALL, int(self._order[choice])
        self._action[field, keeper], self._target[field, keeper] = action, target

    def step(self, moving: np.ndarray) -> None:
        """Play a cycle on the fields of (num_fields,) `moving`; time stands still on the others."""
        running = self._world.state.running
        running[:] = moving
        self._world.step(self._action, self._target)
        running[:] = True
        self._look(moving)

    def observe(self, field: int, keeper: int, into: np.ndarray) -> None:
        """Write a keeper's state variables, itself being K1, into (4n + 2m - 3,) `into`."""
        self._rank(field, keeper)
        position = self._world.perceptions.position[field, keeper]
        keeper_state(position, self._order, self.task.num_keepers, into)

    def _rank(self, field: int, keeper: int) -> None:
        position = self._world.perceptions.position[field, keeper]
        num_keepers = self.task.num_keepers
        rank_players(position, num_keepers, keeper, -1, self._ordering, self._order)

    def _look(self, moved: np.ndarray) -> None:
        """Let everybody answer by rule where time went by, and find out who has a choice."""
        self._streams.refill()
        due, cursor = self._world.perceptions.decision_due, self._streams.cursor
        known, before = due.copy(), cursor.copy()
        due[~moved] = False
        decide_all(
            0,
            len(moved),
            self._world.perceptions,
            *self._learners,
            self._policy,
            self._keeper,
            self._taker,
            self._streams.uniforms,
            cursor,
            self._order,
            self._action,
            self._target,
        )
        due[:] = known
        chose = (cursor != before).reshape(due.shape)  # who has a choice used up random numbers
        self.choosing[moved] = chose[moved, : self.task.num_keepers]


def observation_space(task: Task) -> Box:
    """Of a keeper's state variables: metres up to the field's diagonal, angles up to pi."""
    diagonal = math.hypot(task.field_length, task.field_width)
    features = keeper_features(task.num_keepers, task.num_takers)
    high = [math.pi if feature.kind == "min_angle" else diagonal for feature in features]
    return Box(np.zeros(len(high), np.float32), np.array(high, np.float32), dtype=np.float32)


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
        """The first keeper in match order that has a choice; at the end, whoever is first."""
        self.agent_selection = self.possible_agents[int(self._fields.choosing[0].argmax())]


gymnasium.register(
    id="Keepaway-v0",
    entry_point="keepaway_agent.environments:KeeperEnv",
    vector_entry_point="keepaway_agent.environments:KeeperVectorEnv",
)
