"""Keepaway as Gymnasium and PettingZoo environments; importing this registers `Keepaway-v0`."""

import gymnasium

from keepaway_agent.environments.aec import KeepersAECEnv
from keepaway_agent.environments.fields import Fields, observation_space
from keepaway_agent.environments.gym import KeeperEnv, KeeperVectorEnv

__all__ = ["Fields", "KeeperEnv", "KeeperVectorEnv", "KeepersAECEnv", "observation_space"]

gymnasium.register(
    id="Keepaway-v0",
    entry_point="keepaway_agent.environments:KeeperEnv",
    vector_entry_point="keepaway_agent.environments:KeeperVectorEnv",
)
