"""Keepaway as PettingZoo's modules offer their environments.

`parallel_env` steps cycle by cycle; `env` is the same as an AEC environment; `turn_based_env` steps
from choice to choice, and selects only agents that have one.
"""

from __future__ import annotations

from typing import Any

from pettingzoo.utils.conversions import parallel_to_aec
from pettingzoo.utils.wrappers import OrderEnforcingWrapper

from keepaway_agent.environments.aec import KeepawayAECEnv
from keepaway_agent.environments.parallel import KeepawayParallelEnv


def parallel_env(**settings: Any) -> KeepawayParallelEnv:
    """One field, cycle by cycle; `settings` are those of `KeepawayParallelEnv`."""
    return KeepawayParallelEnv(**settings)


def raw_env(**settings: Any) -> Any:
    """`parallel_env` as an AEC environment: all agents act in turn, once a cycle."""
    return parallel_to_aec(parallel_env(**settings))


def env(**settings: Any) -> OrderEnforcingWrapper[Any, Any, Any]:
    """`raw_env` in the wrapper that every PettingZoo environment comes in."""
    return OrderEnforcingWrapper(raw_env(**settings))


def turn_based_env(**settings: Any) -> KeepawayAECEnv:
    """One field, from choice to choice; `settings` are those of `KeepawayAECEnv`."""
    return KeepawayAECEnv(**settings)
