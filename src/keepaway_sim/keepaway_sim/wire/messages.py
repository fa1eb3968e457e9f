"""One field of a World as the bytes of keepaway_msgs, and requests read from such bytes. No ROS.

The simulator node publishes these bytes and the in-process trainer records them: a message's
contents are worked out here and nowhere else. Positions are in metres, velocities in messages in
m/s (in the world m/cycle), times simulated.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from keepaway_sim.wire.cdr import codec
from keepaway_sim.world.config import CYCLE_TIME

if TYPE_CHECKING:  # nodes that pass messages on need no world
    pass

MATCH = "keepaway_msgs/msg/Match"
PERCEPTION = "keepaway_msgs/msg/Perception"
ACTION_REQUEST = "keepaway_msgs/msg/ActionRequest"
FIELD_STATE = "keepaway_msgs/msg/FieldState"
EPISODE = "keepaway_msgs/msg/Episode"
AGENT_STATUS = "keepaway_msgs/msg/AgentStatus"
CLOCK = "rosgraph_msgs/msg/Clock"
MARKERS = "visualization_msgs/msg/MarkerArray"

SECOND = 1_000_000_000  # [ns]
CYCLE_NS = round(CYCLE_TIME * SECOND)
FRAME = "field"
"""Of all positions: the field's centre, x forward, y left, z up."""
_STAMP = struct.Struct("<iI")
_STATE = struct.Struct("<4xiIIIB")  # CDR header, then stamp, episode, cycle, outcome
_SEEN = struct.Struct("<4xiIB3xIIB?")  # stamp, player, episode, cycle, outcome, decision due
_REQUEST = struct.Struct("<4xB3xIIBB2xI")  # CDR header, then ActionRequest up to its values' count
_REQUEST_HEAD = struct.Struct("<4xB3xII")  # CDR header, player, episode, cycle
_MATCH_ID = struct.Struct("<Q")
_OF_A_MATCH = (PERCEPTION, FIELD_STATE, EPISODE)
_VALUES_AT = 28  # [bytes] where an ActionRequest's values begin
_TAIL = struct.Struct(f"<QiII{len(FRAME) + 1}s2x")  # match_id, then the header, at a message's end


class Request(NamedTuple):
    """What one player asks for, answering its perception of an episode's cycle."""

    player_index: int
    episode: int
    cycle: int
    action: int
    target: int
    match_id: int = 0  # 0: not given


def read_request(data: bytes) -> Request:
    """The request in an ActionRequest's bytes; its action values are left unread.

    Raises:
        struct.error: too few bytes.
    """
    *fields, count = _REQUEST.unpack_from(data)
    end = _VALUES_AT + 8 * count
    if len(data) < end + _MATCH_ID.size:  # of an agent built before matches had numbers
        return Request(*fields)
    return Request(*fields, *_MATCH_ID.unpack_from(data, end))


class MessageHead(NamedTuple):
    """What a message of a cycle is about, without its contents."""

    episode: int
    cycle: int
    player_index: int = -1  # who receives it or asks; -1: a FieldState
    time_ns: int = -1  # simulated, its stamp; -1: an ActionRequest, which has none
    outcome: int = 0  # of a FieldState or Perception
    decision_due: bool = False  # of a Perception


def read_head(message_type: str, data: bytes) -> MessageHead:
    """What the bytes of a FieldState, Perception or ActionRequest are about.

    Raises:
        struct.error: too few bytes.
    """
    if message_type == FIELD_STATE:
        sec, nanosec, episode, cycle, outcome = _STATE.unpack_from(data)
        return MessageHead(episode, cycle, -1, sec * SECOND + nanosec, outcome)
    if message_type == PERCEPTION:
        sec, nanosec, player, episode, cycle, outcome, due = _SEEN.unpack_from(data)
        return MessageHead(episode, cycle, player, sec * SECOND + nanosec, outcome, due)
    player, episode, cycle = _REQUEST_HEAD.unpack_from(data)
    return MessageHead(episode, cycle, player)


def read_match_id(data: bytes) -> int:
    """The match that a Perception, FieldState or Episode belongs to; 0 where it does not say."""
    if len(data) < _TAIL.size:
        return 0
    match_id, _, _, _, frame = _TAIL.unpack_from(data, len(data) - _TAIL.size)
    return int(match_id) if frame == FRAME.encode() + b"\0" else 0


def match_of(message_type: str, data: bytes) -> int:
    """The match that a message of any type belongs to; 0 where it does not say.

    Raises:
        struct.error: an ActionRequest of too few bytes.
    """
    if message_type == ACTION_REQUEST:
        return read_request(data).match_id
    return read_match_id(data) if message_type in _OF_A_MATCH else 0


def read_time(data: bytes) -> int:
    """The nanoseconds in a builtin_interfaces/Time's bytes.

    Raises:
        struct.error: too few bytes.
    """
    sec, nanosec = _STAMP.unpack_from(data, 4)
    return int(sec) * SECOND + int(nanosec)


def action_request(request: Request, action_values: Sequence[float] = ()) -> bytes:
    """An ActionRequest; `action_values` is what a learner expected of each choice [cycles].

    >>> asked = Request(player_index=0, episode=3, cycle=12, action=1, target=2)
    >>> read_request(action_request(asked)) == asked
    True
    """
    return codec(ACTION_REQUEST).encode({**request._asdict(), "action_values": action_values})


def header(time_ns: int) -> dict[str, Any]:
    """A std_msgs/Header of a moment on the field."""
    return {"stamp": stamp(time_ns), "frame_id": FRAME}


def stamp(time_ns: int) -> dict[str, Any]:
    """A builtin_interfaces/Time of nanoseconds."""
    sec, nanosec = divmod(time_ns, SECOND)
    return {"sec": sec, "nanosec": nanosec}


def stamp_of(message_type: str, data: bytes) -> int | None:
    """When a message was stamped, simulated [ns]; None for types without a stamp at the front."""
    if not _has_stamp(message_type):
        return None
    return read_time(data)


@functools.cache
def _has_stamp(message_type: str) -> bool:
    return message_type in (PERCEPTION, FIELD_STATE, EPISODE, CLOCK)
