"""Topics of a bag: types, qualities of service, and recorded messages."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import yaml

from keepaway_sim.wire.messages import AGENT_STATUS, EPISODE, MATCH

INFO = "keepaway"
"""Name of the MCAP metadata records that say what made a bag."""


_FOREVER = {"sec": 9223372036, "nsec": 854775807}  # how rosbag2 writes an infinite duration
_LATCHED = {MATCH: 1, AGENT_STATUS: 1, EPISODE: 1000}  # their depths
_LONGEST_QOS = 8192  # [bytes] of a topic's offers that are read; some 20 publishers


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
    """How topics of a type are offered in a match: what later comers must know is latched."""
    depth = _LATCHED.get(message_type)
    return Qos(depth, transient_local=True) if depth else Qos()


@functools.lru_cache(maxsize=256)
def read_qos(text: str, message_type: str) -> Qos:
    """The first of the offers that rosbag2 wrote for a topic; by its type where there is none.

    >>> read_qos("- {depth: 3, durability: transient_local}", "").transient_local
    True
    """
    otherwise = default_qos(message_type)
    if len(text) > _LONGEST_QOS:
        return otherwise
    try:
        offers = yaml.load(text, Loader=YAML_LOADER)
    except (yaml.YAMLError, ValueError, RecursionError):
        return otherwise
    first = offers[0] if isinstance(offers, list) and offers else None
    if not isinstance(first, dict) or not first:
        return otherwise
    depth = first.get("depth")
    return Qos(
        depth if isinstance(depth, int) and 0 < depth < 2**31 else otherwise.depth,
        first.get("durability") in ("transient_local", 1),
        first.get("reliability", "reliable") in ("reliable", 0, 1),
    )


YAML_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Reads plain data; libyaml's is ten times faster, where it is there."""


class Topic(NamedTuple):
    """A topic of a bag."""

    name: str
    message_type: str  # empty where its channel has no schema
    definition: str  # of the schema; bytes that are no UTF-8 are surrogate-escaped
    type_hash: str  # empty where it is not known
    qos: Qos
    schema_encoding: str = "ros2msg"
    encoding: str = "cdr"  # of its messages

    @property
    def is_ros(self) -> bool:
        """Whether its messages are ROS 2's."""
        return self.schema_encoding == "ros2msg" and self.encoding == "cdr"


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
