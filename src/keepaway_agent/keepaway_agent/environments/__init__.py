"""Keepaway as Gymnasium and PettingZoo environments; importing this registers `Keepaway-v0`.

With Gymnasium, and with PettingZoo as "parallel" and as "aec"; `KeepawayTurns-v0` is "aec" as well.

============================  =======================================================
`KeeperEnv`                   one field; the keeper that has the choice is the agent
`KeeperVectorEnv`             the same for many fields of one `World`, next-step reset
`KeepawayAECEnv`              one field, turn by turn: an agent with a choice is selected
`KeepawayParallelEnv`         one field, cycle by cycle: all act, most of them by "nothing"
`keepaway_v0`                 the last two as PettingZoo's modules offer theirs
============================  =======================================================
"""

import gymnasium
import pettingzoo

from keepaway_agent.environments.aec import KeepawayAECEnv
from keepaway_agent.environments.fields import DecisionFields
from keepaway_agent.environments.gym import KeeperEnv, KeeperVectorEnv
from keepaway_agent.environments.parallel import KeepawayParallelEnv
from keepaway_agent.environments.spaces import observation_space

__all__ = [
    "DecisionFields",
    "KeepawayAECEnv",
    "KeepawayParallelEnv",
    "KeeperEnv",
    "KeeperVectorEnv",
    "observation_space",
]

gymnasium.register(
    id="Keepaway-v0",
    entry_point="keepaway_agent.environments:KeeperEnv",
    vector_entry_point="keepaway_agent.environments:KeeperVectorEnv",
)
pettingzoo.register(
    "parallel", "Keepaway-v0", "keepaway_agent.environments.keepaway_v0:parallel_env"
)
pettingzoo.register("aec", "Keepaway-v0", "keepaway_agent.environments.keepaway_v0:env")
pettingzoo.register(
    "aec", "KeepawayTurns-v0", "keepaway_agent.environments.keepaway_v0:turn_based_env"
)
