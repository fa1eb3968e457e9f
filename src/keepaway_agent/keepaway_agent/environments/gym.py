"""The keepers' decision problem as Gymnasium environments.

A keeper that can kick the ball chooses: 0 holds it, k passes to K(k+1). It sees the 4n + 2m - 3
state variables of `features.keeper_state` as it believes them to be. Keepers without a choice
follow the rules of `policies`, and so do the takers. One cycle in play pays 1, and cycles pass
between two choices: the problem is a semi-Markov one, and `infos` contain their number (Taylor &
Stone 2005). The world is that of the trainer: field k of a reset with seed s plays what trial k of
a training with seed s plays.
"""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from keepaway_agent.compiled import Kernel, prepare
from keepaway_agent.environments.camera import Camera
from keepaway_agent.environments.compiled_fields import (
    KeeperBooks,
    Results,
    begin_step,
    end_step,
)
from keepaway_agent.environments.fields import DecisionFields
from keepaway_agent.environments.refusals import (
    MAX_FIELDS,
    InvalidSeedError,
    ResetNeededError,
    checked_action,
    checked_actions,
    checked_limit,
    checked_mode,
    checked_number,
    checked_seed,
)
from keepaway_agent.environments.snapshots import KeeperState, require_kind, with_new_luck
from keepaway_agent.environments.spaces import observation_space, variable_names
from keepaway_agent.errors import AgentError
from keepaway_agent.training.trial import trial_seed


class KeeperVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Many fields; on each the keeper that has a choice is the agent.

    A step makes a choice on every field and plays on until there is one again: on every field
    (`wait_for="all"`), or on any (`wait_for="any"`), which loses no time on fields that are ahead
    of others, and takes actions only where `infos["choosing"]`; the other ones are ignored. Where
    the episode ended the next step's action is ignored too, and a new episode begins.

    Rewards are cycles, paid at the next choice or at the episode's end. If two keepers could kick
    the ball at once, the first in match order chooses and the other holds it.

    `infos`: "choosing", where there is a choice; "cycles" since the last one, "cycle" since
    kick-off, "keeper" who chooses; and for each of them a mask of the fields that have it.

    Attributes:
        variables: names of an observation's entries, in order.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as the base class declares it
        "autoreset_mode": AutoresetMode.NEXT_STEP,
        "render_modes": ["rgb_array"],
        "render_fps": 10,
    }

    single_observation_space: Box
    single_action_space: Discrete

    def __init__(
        self,
        num_envs: int = 1,
        *,
        wait_for: str = "all",
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        """Lay out the fields.

        Args:
            num_envs: the number of fields.
            wait_for: a step ends when there is a choice on all of them, or on any.
            max_episode_steps: choices after which an episode is truncated.
            render_mode: None or rgb_array: `render` gives a frame of every field.
            settings: task, taker_policy, config, ordering: see `DecisionFields`.

        Raises:
            AgentError, KeepawayError: settings that make no match.
        """
        refuse_unknown(settings)
        self.num_envs = checked_number("num_envs", num_envs, 1, MAX_FIELDS)
        self.render_mode = checked_mode(render_mode, self.metadata["render_modes"])
        if wait_for not in ("all", "any"):
            raise AgentError(f"wait_for={wait_for!r}: choose all or any")
        self._waits_for_all = wait_for == "all"
        self._max_steps = checked_limit("max_episode_steps", max_episode_steps)
        self._fields = DecisionFields(num_fields=self.num_envs, **settings)
        self._camera = Camera(self._fields, self.render_mode)
        task = self._fields.task
        self.variables = variable_names(task)
        self.single_observation_space = observation_space(task)
        self.single_action_space = Discrete(task.num_keepers)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        highest = self.single_observation_space.high
        self._books = _books(self.num_envs)
        self._for_results = self._max_steps, highest, np.zeros(len(highest))
        self._lay_kernels()
        self._all = np.ones(self.num_envs, dtype=np.bool_)
        self._all.flags.writeable = False
        self._masks = dict.fromkeys((f"_{name}" for name in _INFOS), self._all)

    def _lay_kernels(self) -> None:
        """Bring together what the compiled functions work on; no array is ever replaced."""
        deciders, books = self._fields.deciders, self._books
        self._begin_step = Kernel(begin_step, deciders, books)
        self._end_step = Kernel(end_step, deciders, books, self._fields.choosing)
        prepare(
            (self._begin_step, (np.zeros(self.num_envs, np.int64),)),
            (self._end_step, (*self._for_results, self._empty_results())),
            self._fields.play_call,
        )

    def __getstate__(self) -> dict[str, Any]:
        """All but the kernels: they are laid anew around the copied arrays."""
        kept = self.__dict__.copy()
        del kept["_begin_step"], kept["_end_step"]
        return kept

    def __setstate__(self, kept: dict[str, Any]) -> None:
        """Put together what was copied or pickled."""
        self.__dict__.update(kept)
        self._lay_kernels()

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Kick off everywhere.

        Args:
            seed: of all random numbers; a list has one for each field, as that of a single
                environment. None continues the random numbers in use.
            options: none is known; they are ignored.

        Raises:
            InvalidSeedError, ClosedError: see `refusals`.
        """
        self._fields.require_open()
        if isinstance(seed, (list, tuple)):
            self._start_each(list(seed))
        elif (one := checked_seed(seed)) is None and self._fields.is_started:
            self._fields.abort(self._all)
        else:
            super().reset(seed=one)
            self._start(int(self.np_random.integers(2**63)) if one is None else one)
        for each in self._books:
            each.fill(0)
        waiting = np.asarray(~self._fields.choosing.any(axis=1))
        self._fields.play_on(waiting, self._books.in_play, self._books.cycles)
        results = self._results()
        return results.observations, self._infos(results)

    def _start(self, seed: int) -> None:
        for field in range(self.num_envs):
            self._fields.start(field, trial_seed(seed, field))

    def _start_each(self, seeds: list[Any]) -> None:
        if len(seeds) != self.num_envs:
            raise InvalidSeedError(f"{len(seeds)} seeds: give {self.num_envs}, one for each field")
        checked = [checked_seed(seed) for seed in seeds]
        for field, seed in enumerate(checked):
            chosen = int(self.np_random.integers(2**63)) if seed is None else seed
            self._fields.start(field, trial_seed(chosen, 0))

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Make every field's choice, and play on to its next one or to the end of its episode.

        Raises:
            InvalidActionError, ResetNeededError, ClosedError: see `refusals`.
        """
        self._fields.require_started()
        chosen = checked_actions(actions, self.num_envs)
        wrong = self._begin_step(chosen)
        if wrong >= 0:
            checked_action(chosen[wrong], int(self.single_action_space.n), f"actions[{wrong}]")
        books = self._books
        if self._waits_for_all:
            self._fields.play_on(self._all, books.in_play, books.cycles)
        else:
            self._fields.play_until_any(books.in_play, books.cycles)
        results = self._results()
        return (*results[:4], self._infos(results))

    def _results(self) -> Results:
        """The results of a step; episodes of the maximum length are truncated."""
        results = self._empty_results()
        if self._end_step(*self._for_results, results):
            self._fields.abort(results.truncated)
            self._books.choosing[results.truncated] = False
        return results

    def _empty_results(self) -> Results:
        size = self.num_envs
        return Results(
            np.empty((size, len(self._for_results[1])), dtype=np.float32),
            np.empty(size),
            np.empty(size, dtype=np.bool_),
            np.empty(size, dtype=np.bool_),
            np.empty(size, dtype=np.bool_),
            np.empty(size, dtype=np.int64),
            np.empty(size, dtype=np.int64),
            np.empty(size, dtype=np.int64),
        )

    def get_state(self) -> list[KeeperState]:
        """The state of every field now, as copies: plain data for `set_state`.

        Raises:
            ResetNeededError, ClosedError: see `refusals`.
        """
        self._fields.require_started()
        return [
            KeeperState(
                self._fields.get_state(field), tuple(each[field].item() for each in self._books)
            )
            for field in range(self.num_envs)
        ]

    def set_state(
        self, states: list[KeeperState], seeds: list[int] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Put every field to a state, whichever field or environment it is of.

        Args:
            states: one for each field; some may be the same.
            seeds: of all random numbers from now on, one for each field; None continues
                those of the state, so that equal choices give equal play.

        Returns:
            observations and infos, as of `reset`.

        Raises:
            AgentError, KeepawayError, ClosedError: no states, or those of another world.
        """
        self._fields.require_open()
        for what, given in (("states", states), ("seeds", seeds)):
            if given is not None or what == "states":
                _check_list(what, given, self.num_envs)
        checked = [require_kind(state, KeeperState) for state in states]
        for field, state in enumerate(checked):
            luck = state.field if seeds is None else with_new_luck(state.field, seeds[field])
            self._fields.set_state(field, luck)
            for each, value in zip(self._books, state.books, strict=True):
                each[field] = value
        results = self._results()
        return results.observations, self._infos(results)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A frame (height, width, 3) uint8 of every field; None without a render mode."""
        self._fields.require_started()
        if self.render_mode is None:
            return None
        return tuple(self._camera.frame(field) for field in range(self.num_envs))

    def close_extras(self, **_kwargs: Any) -> None:
        """Play no more."""
        self._fields.close()

    def _infos(self, results: Results) -> dict[str, Any]:
        return dict(zip(_INFOS, results[4:], strict=True)) | self._masks


_INFOS = Results._fields[4:]


def _books(num_fields: int) -> KeeperBooks:
    return KeeperBooks(
        keeper=np.zeros(num_fields, dtype=np.int64),
        choosing=np.zeros(num_fields, dtype=np.bool_),
        steps=np.zeros(num_fields, dtype=np.int64),
        cycles=np.zeros(num_fields, dtype=np.int64),
        is_paid=np.zeros(num_fields, dtype=np.bool_),
        in_play=np.zeros(num_fields, dtype=np.bool_),
    )


class KeeperEnv(gymnasium.Env[np.ndarray, Any]):
    """One field, from choice to choice of the keeper that has the ball; see `KeeperVectorEnv`.

    Attributes:
        variables: names of an observation's entries, in order.
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": ["rgb_array", "rgb_array_list", "human"],
        "render_fps": 10,
    }

    def __init__(self, render_mode: str | None = None, **settings: Any) -> None:
        """Lay out the field.

        Args:
            render_mode: None; rgb_array, the field as it is now; rgb_array_list, every cycle
                since the last `render`; human, every cycle in a window, in real time.
            settings: task, taker_policy, config, ordering: see `DecisionFields`.

        Raises:
            AgentError, KeepawayError: settings that make no match.
        """
        refuse_unknown(settings)
        self.render_mode = checked_mode(render_mode, self.metadata["render_modes"])
        self._env = KeeperVectorEnv(1, **settings)
        self._camera = Camera(self._env._fields, self.render_mode)
        self.variables = self._env.variables
        self.observation_space = self._env.single_observation_space
        self.action_space: Discrete = self._env.single_action_space
        self._is_over = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Kick off, with the random numbers of `seed` or continuing those in use.

        Raises:
            InvalidSeedError, ClosedError: see `refusals`.
        """
        self._env._fields.require_open()
        chosen = checked_seed(seed)
        super().reset(seed=chosen)
        if chosen is None and not self._env._fields.is_started:
            chosen = int(self.np_random.integers(2**63))
        observations, infos = self._env.reset(seed=chosen)
        self._is_over = False
        return observations[0], first_of(infos)

    def step(self, action: int) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Make the choice, and play on to the next one or to the end of the episode.

        Raises:
            InvalidActionError, ResetNeededError, ClosedError: see `refusals`.
        """
        self._env._fields.require_started()
        if self._is_over:
            raise ResetNeededError("the episode has ended: call reset first")
        chosen = checked_action(action, int(self.action_space.n))
        state, reward, ended, _, infos = self._env.step(np.array([chosen]))
        self._is_over = bool(ended[0])
        return state[0], float(reward[0]), self._is_over, False, first_of(infos)

    def get_state(self) -> KeeperState:
        """The state of the field now, as a copy; see `KeeperVectorEnv.get_state`."""
        return self._env.get_state()[0]

    def set_state(
        self, state: KeeperState, seed: int | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Put the field to a state; see `KeeperVectorEnv.set_state`."""
        seeds = None if seed is None else [seed]
        observations, infos = self._env.set_state([state], seeds)
        self._is_over = bool(self._env._fields.is_over[0])
        return observations[0], first_of(infos)

    def render(self) -> Any:
        """A frame or frames, by the render mode; None without one, and in a window.

        Raises:
            ResetNeededError, ClosedError: see `refusals`.
        """
        self._env._fields.require_started()
        return self._camera.render()

    def close(self) -> None:
        """Play no more, and close the window."""
        self._env.close()
        self._camera.close()


def first_of(infos: dict[str, np.ndarray]) -> dict[str, Any]:
    """The infos of field 0, without the masks."""
    return {name: values[0].item() for name, values in infos.items() if not name.startswith("_")}


def refuse_unknown(settings: dict[str, Any]) -> None:
    """Refuse what is no setting of the keepers' fields.

    Raises:
        AgentError: by name.
    """
    known = ("task", "taker_policy", "config", "ordering", "decision_interval")
    for name in settings:
        if name not in known:
            raise AgentError(f"{name}: no setting of this environment; {', '.join(known)} are")
    taker_policy = settings.get("taker_policy")
    if isinstance(taker_policy, str) and taker_policy == "outside":
        raise AgentError(
            "taker_policy='outside': takers are agents in keepaway_v0 (PettingZoo) only"
        )


def _check_list(name: str, given: Any, size: int) -> None:
    if not isinstance(given, (list, tuple)) or len(given) != size:
        raise AgentError(f"{name}={given!r:.60}: give a list of {size}, one for each field")
