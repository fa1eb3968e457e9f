"""One field of a World as the bytes of keepaway_msgs, and requests read from such bytes. No ROS.

The simulator node publishes these bytes and the in-process trainer records them: what a message
says is worked out here and nowhere else. Positions are in metres, velocities in the messages in
m/s (in the world m/cycle), times simulated.
"""

from __future__ import annotations

import functools
import json
import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from keepaway_sim.task import Task
from keepaway_sim.version import code_version
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.markers import field_markers
from keepaway_sim.world.config import CYCLE_TIME

if TYPE_CHECKING:  # nodes that pass messages on need no world
    from keepaway_sim.world.world import World

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
_STAMP = struct.Struct("<iI")
_STATE = struct.Struct("<4xiIIIB")  # CDR header, then stamp, episode, cycle, outcome
_SEEN = struct.Struct("<4xiIB3xIIB?")  # stamp, player, episode, cycle, outcome, decision due
_REQUEST = struct.Struct("<4xB3xIIBB")  # CDR header, then ActionRequest's fields but the values


class Request(NamedTuple):
    """What one player asks for, answering its perception of an episode's cycle."""

    player_index: int
    episode: int
    cycle: int
    action: int
    target: int


def read_request(data: bytes) -> Request:
    """The request in an ActionRequest's bytes; its action values are left unread.

    Raises:
        struct.error: too few bytes.
    """
    return Request(*_REQUEST.unpack_from(data))


class Saying(NamedTuple):
    """What a message of a cycle is about, without its contents."""

    episode: int
    cycle: int
    player_index: int = -1  # who hears or asks; -1: a FieldState
    time_ns: int = -1  # simulated, its stamp; -1: an ActionRequest, which has none
    outcome: int = 0  # of a FieldState or Perception
    decision_due: bool = False  # of a Perception


def read_saying(message_type: str, data: bytes) -> Saying:
    """What the bytes of a FieldState, Perception or ActionRequest are about.

    Raises:
        struct.error: too few bytes.
    """
    if message_type == FIELD_STATE:
        sec, nanosec, episode, cycle, outcome = _STATE.unpack_from(data)
        return Saying(episode, cycle, -1, sec * SECOND + nanosec, outcome)
    if message_type == PERCEPTION:
        sec, nanosec, player, episode, cycle, outcome, due = _SEEN.unpack_from(data)
        return Saying(episode, cycle, player, sec * SECOND + nanosec, outcome, due)
    player, episode, cycle = _REQUEST.unpack_from(data)[:3]
    return Saying(episode, cycle, player)


def read_time(data: bytes) -> int:
    """The nanoseconds in a builtin_interfaces/Time's bytes.

    Raises:
        struct.error: too few bytes.
    """
    sec, nanosec = _STAMP.unpack_from(data, 4)
    return int(sec) * SECOND + int(nanosec)


def clean_request(data: bytes) -> bytes:
    """An ActionRequest's bytes with its padding zeroed.

    ROS's serialiser leaves whatever was in memory between the fields; without it, two matches
    that are equal are recorded with equal bytes.
    """
    clean = bytearray(data)
    clean[5:8] = bytes(3)  # after player_index
    clean[18:20] = bytes(2)  # after target
    if len(clean) > 24:
        clean[24:28] = bytes(4)  # before the first of the action values
    return bytes(clean)


def action_request(request: Request, action_values: Sequence[float] = ()) -> bytes:
    """An ActionRequest; `action_values` is what a learner expected of each choice [cycles].

    >>> asked = Request(player_index=0, episode=3, cycle=12, action=1, target=2)
    >>> read_request(action_request(asked)) == asked
    True
    """
    return codec(ACTION_REQUEST).encode({**request._asdict(), "action_values": action_values})


class FieldMessages:
    """What one field of a World says to players and viewers, as bytes of this very moment."""

    def __init__(self, world: World, field: int = 0) -> None:
        """Lay out the messages for the world's number of players."""
        self._world, self._field = world, field
        objects, num = world.task.num_players + 1, world.task.num_players
        places = {"positions": 2 * objects, "velocities": 2 * objects}
        self._perceptions = codec(PERCEPTION).empty(
            num, {**places, "ages": objects, "cycles_to_ball": num}
        )
        self._perceptions["player_index"] = np.arange(num)
        self._clock = codec(CLOCK).empty(1, {})
        self._state = codec(FIELD_STATE).empty(
            1, {**places, "yaws": num, "neck_yaws": num, "actions": num, "targets": num}
        )

    def stamp_ns(self) -> int:
        """Simulated time since the field was started [ns]."""
        return int(self._world.state.time[self._field]) * CYCLE_NS

    def clock(self) -> bytes:
        """A Clock message."""
        now = stamp(self.stamp_ns())
        self._clock["clock.sec"], self._clock["clock.nanosec"] = now["sec"], now["nanosec"]
        return self._clock.tobytes()

    def perceptions(self) -> list[bytes]:
        """A Perception message of every player, in match order."""
        messages, seen, field = self._perceptions, self._world.perceptions, self._field
        num = len(messages)
        self._fill_moment(messages)
        messages["decision_due"] = seen.decision_due[field]
        messages["ball_kickable"] = seen.ball_kickable[field]
        messages["body_yaw"] = seen.body[field].diagonal()
        messages["neck_yaw"] = seen.neck[field]
        messages["positions"] = seen.position[field].reshape(num, -1)
        messages["velocities"] = seen.velocity[field].reshape(num, -1) / CYCLE_TIME
        messages["ages"] = seen.age[field]
        messages["cycles_to_ball"] = seen.cycles_to_ball[field]
        return rows(messages)

    def field_state(self) -> bytes:
        """A FieldState message: the truth."""
        message, state, field = self._state, self._world.state, self._field
        self._fill_moment(message)
        message["positions"] = state.position[field].reshape(-1)
        message["velocities"] = state.velocity[field].reshape(-1) / CYCLE_TIME
        message["yaws"] = state.yaw[field]
        message["neck_yaws"] = self._world.perceptions.neck[field]
        message["actions"] = state.action[field]
        message["targets"] = state.target[field]
        message["take_counter"] = state.take_count[field]
        return message.tobytes()

    def episode(self, seed: int) -> bytes:
        """An Episode message of the episode that has just ended; `seed` is the match's."""
        seen, field = self._world.perceptions, self._field
        cycles = int(seen.cycle[field])
        return codec(EPISODE).encode(
            {
                "stamp": stamp(self.stamp_ns()),
                "number": int(seen.episode[field]),
                "seed": seed,
                "cycles": cycles,
                "duration": cycles * CYCLE_TIME,
                "outcome": int(seen.outcome[field]),
                "lost_by": int(self._world.state.last_keeper[field]),
            }
        )

    def match(self, seed: int, speed: float, first_episode: int = 0) -> bytes:
        """A Match message: what is played here."""
        task, config = self._world.task, self._world.config
        return codec(MATCH).encode(
            {
                "task": task.name,
                "profile": config.profile,
                "num_keepers": task.num_keepers,
                "num_takers": task.num_takers,
                "field_length": task.field_length,
                "field_width": task.field_width,
                "cycle_time": CYCLE_TIME,
                "visible_angle": float(np.radians(config.vision.visible_angle)),
                "speed": speed,
                "seed": seed,
                "player_names": task.player_names,
                "code_version": code_version(),
                "config_json": json.dumps(config.to_dict()),
                "first_episode": first_episode,
            }
        )

    def markers(self) -> bytes:
        """A MarkerArray that shows the truth in RViz and Foxglove."""
        state, field = self._world.state, self._field
        return marker_array(
            self._world.task, state.position[field], state.yaw[field], self.stamp_ns()
        )

    def _fill_moment(self, messages: np.ndarray) -> None:
        now, seen, field = stamp(self.stamp_ns()), self._world.perceptions, self._field
        messages["stamp.sec"], messages["stamp.nanosec"] = now["sec"], now["nanosec"]
        messages["episode"] = seen.episode[field]
        messages["cycle"] = seen.cycle[field]
        messages["outcome"] = seen.outcome[field]


def marker_array(task: Task, position: np.ndarray, yaw: np.ndarray, time_ns: int) -> bytes:
    """A MarkerArray of players and ball.

    Args:
        task: who plays, and on what field.
        position: (num_players + 1, 2) [m], the ball last.
        yaw: (num_players,) body directions [rad].
        time_ns: simulated time [ns].
    """
    header = {"stamp": stamp(time_ns), "frame_id": "field"}
    markers = [{"header": header, **marker} for marker in field_markers(task, position, yaw)]
    return codec(MARKERS).encode({"markers": markers})


def stamp(time_ns: int) -> dict[str, Any]:
    """A builtin_interfaces/Time of nanoseconds."""
    sec, nanosec = divmod(time_ns, SECOND)
    return {"sec": sec, "nanosec": nanosec}


def rows(messages: np.ndarray) -> list[bytes]:
    """Every message of a structured array (`Codec.empty`) as its bytes."""
    data, size = messages.tobytes(), messages.itemsize
    return [data[start : start + size] for start in range(0, len(data), size)]


def stamp_of(message_type: str, data: bytes) -> int | None:
    """When a message was stamped, simulated [ns]; None for types without a stamp at the front."""
    if not _has_stamp(message_type):
        return None
    return read_time(data)


@functools.cache
def _has_stamp(message_type: str) -> bool:
    return message_type in (PERCEPTION, FIELD_STATE, EPISODE, CLOCK)
