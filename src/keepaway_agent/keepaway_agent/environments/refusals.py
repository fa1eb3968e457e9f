"""What the environments refuse, and with which errors: no call crashes or makes up an answer.

Every error is an `AgentError`, and the library's own error for the same mistake as well, so that
code written for Gymnasium or PettingZoo catches what it expects.
"""

from __future__ import annotations

from typing import Any, Final

import gymnasium.error
import numpy as np

from keepaway_agent.errors import AgentError
from keepaway_sim.task import Task
from keepaway_sim.world.config import Config

MAX_FIELDS: Final = 4096
"""Fields side by side; more need more memory than they save time."""
MAX_CYCLES: Final = 10**9
"""The longest episode that can be asked for [cycles]; three years of play."""


class ResetNeededError(AgentError, gymnasium.error.ResetNeeded):
    """A call that only makes sense in an episode that is running."""


class ClosedError(AgentError, gymnasium.error.ClosedEnvironmentError):
    """A call after `close`."""


class InvalidActionError(AgentError, gymnasium.error.InvalidAction):
    """An action outside its space."""


class InvalidSeedError(AgentError, gymnasium.error.Error):
    """A seed that is no whole number from 0."""


class UnsupportedModeError(AgentError, gymnasium.error.UnsupportedMode):
    """A way of drawing that there is not."""


def checked_action(action: Any, num_actions: int, whose: str = "action") -> int:
    """One action as a Python int.

    Raises:
        InvalidActionError: no whole number from 0 to `num_actions` - 1.
    """
    if _is_whole(action) and 0 <= int(action) < num_actions:
        return int(action)
    raise InvalidActionError(f"{whose}={action!r}: give a whole number from 0 to {num_actions - 1}")


def checked_actions(actions: Any, num_envs: int) -> np.ndarray:
    """(num_envs,) int64 actions, one for each field, not checked against the space yet.

    Raises:
        InvalidActionError: another shape or kind.
    """
    try:
        given = np.asarray(actions)
    except ValueError as error:  # lists of unequal lengths
        raise InvalidActionError(f"actions={actions!r}: give {num_envs} whole numbers") from error
    if given.shape != (num_envs,) or given.dtype.kind not in "iu":
        raise InvalidActionError(
            f"actions of shape {given.shape} and type {given.dtype}:"
            f" give whole numbers of shape {(num_envs,)}"
        )
    return np.ascontiguousarray(given, dtype=np.int64)


def checked_number(name: str, value: Any, low: int, high: int) -> int:
    """A setting that is a whole number from `low` to `high`.

    Raises:
        AgentError: it is not.
    """
    if _is_whole(value) and low <= int(value) <= high:
        return int(value)
    raise AgentError(f"{name}={value!r}: give a whole number from {low} to {high}")


def checked_limit(name: str, limit: int | None) -> int:
    """A limit of an episode; None is no limit.

    Raises:
        AgentError: no whole number from 1.
    """
    return MAX_CYCLES if limit is None else checked_number(name, limit, 1, MAX_CYCLES)


def checked_seed(seed: Any) -> int | None:
    """A seed as a Python int; None stands for no seed.

    Raises:
        InvalidSeedError: no whole number from 0.
    """
    if seed is None or (_is_whole(seed) and int(seed) >= 0):
        return None if seed is None else int(seed)
    raise InvalidSeedError(f"seed={seed!r}: give a whole number from 0, or None")


def checked_mode(render_mode: Any, known: list[str]) -> str | None:
    """A way of drawing; None draws nothing.

    Raises:
        UnsupportedModeError: another one than the known.
    """
    if render_mode is None or (isinstance(render_mode, str) and render_mode in known):
        return render_mode
    raise UnsupportedModeError(
        f"render_mode={render_mode!r}: choose None or one of {', '.join(known)}"
    )


def checked_task(task: Any) -> Task:
    """A task by its name, or as it is.

    Raises:
        AgentError, KeepawayError: no task.
    """
    if isinstance(task, Task):
        return task
    if not isinstance(task, str):
        raise AgentError(f"task={task!r}: write keepers v takers like '3v2', or give a Task")
    return Task.parse(task)


def checked_config(config: Any) -> Config:
    """A configuration of the world; None is the default one.

    Raises:
        AgentError: something else.
    """
    if config is None or isinstance(config, Config):
        return config or Config()
    raise AgentError(
        f"config={config!r:.60}: give a keepaway_sim.world.config.Config, as `profile` makes"
    )


def _is_whole(value: Any) -> bool:
    """Whether a value is one whole number; True and False are none."""
    if isinstance(value, np.ndarray) and value.shape == ():
        value = value[()]
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)
