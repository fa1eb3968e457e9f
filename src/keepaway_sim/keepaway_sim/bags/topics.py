"""Topics of a bag: types, qualities of service, and recorded messages."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from keepaway_sim.wire.messages import AGENT_STATUS, MATCH

INFO = "keepaway"
"""Name of the MCAP metadata records that say what made a bag."""


_FOREVER = {"sec": 9223372036, "nsec": 854775807}  # how rosbag2 writes an infinite duration
_LATCHED = (MATCH, AGENT_STATUS)


class Qos(NamedTuple):
    """How a topic is offered; the rest is ROS 2's default."""

    depth: int = 10
    transient_local: bool = False
    reliable: bool = True

    def to_dict(self) -> dict[str, Any]:
        """As rosbag2 writes it."""
        return {
            "history": "keep_last",
            "depth": self.depth,
            "reliability": "reliable" if self.reliable else "best_effort",
            "durability": "transient_local" if self.transient_local else "volatile",
            "deadline": _FOREVER,
            "lifespan": _FOREVER,
            "liveliness": "automatic",
            "liveliness_lease_duration": _FOREVER,
            "avoid_ros_namespace_conventions": False,
        }


def default_qos(message_type: str) -> Qos:
    """How topics of a type are offered in a match: what is said once is latched."""
    return Qos(1, transient_local=True) if message_type in _LATCHED else Qos()


class Topic(NamedTuple):
    """A topic of a bag."""

    name: str
    message_type: str
    definition: str  # ros2msg
    type_hash: str  # empty where it is not known
    qos: Qos


class Recorded(NamedTuple):
    """One message of a bag."""

    topic: str
    message_type: str
    log_time: int  # [ns] simulated
    data: bytes  # CDR


class Batch(NamedTuple):
    """Messages of one topic of equal lengths, in order, as one structured array."""

    topic: str
    log_time: np.ndarray  # (n,) int64 [ns]
    data: np.ndarray  # (n,) of the codec's dtype
