"""One field of a World as the bytes of keepaway_msgs."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from keepaway_sim.task import Task
from keepaway_sim.version import code_version
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.markers import field_markers
from keepaway_sim.wire.messages import (
    CLOCK,
    CYCLE_NS,
    EPISODE,
    FIELD_STATE,
    FRAME,
    MARKERS,
    MATCH,
    PERCEPTION,
    header,
    stamp,
)
from keepaway_sim.world.config import CYCLE_TIME

if TYPE_CHECKING:
    from keepaway_sim.world.world import World


class FieldMessages:
    """What one field of a World publishes to players and viewers, as bytes of this very moment."""

    def __init__(self, world: World, field: int = 0, match_id: int = 0) -> None:
        """Lay out the messages for the world's number of players.

        Args:
            world: that they are about.
            field: its index in the world.
            match_id: that all messages carry; 0: none.
        """
        self._world, self._field, self._match_id = world, field, match_id
        objects, num = world.task.num_players + 1, world.task.num_players
        places = {"positions": 2 * objects, "velocities": 2 * objects}
        places["header.frame_id"] = len(FRAME) + 1
        self._perceptions = codec(PERCEPTION).empty(
            num, {**places, "ages": objects, "cycles_to_ball": num}
        )
        self._perceptions["player_index"] = np.arange(num)
        self._clock = codec(CLOCK).empty(1, {})
        self._state = codec(FIELD_STATE).empty(
            1, {**places, "yaws": num, "neck_yaws": num, "actions": num, "targets": num}
        )

        for messages in (self._perceptions, self._state):
            messages["match_id"], messages["header.frame_id"] = match_id, FRAME.encode()

    def stamp_ns(self) -> int:
        """Simulated time since the field was started [ns]."""
        return int(self._world.truth.time[self._field]) * CYCLE_NS

    def clock(self) -> bytes:
        """A Clock message."""
        now = stamp(self.stamp_ns())
        self._clock["clock.sec"], self._clock["clock.nanosec"] = now["sec"], now["nanosec"]
        return self._clock.tobytes()

    def perceptions(self) -> list[bytes]:
        """A Perception message of every player, in match order."""
        messages, seen, field = self._perceptions, self._world.belief, self._field
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
        message, state, field = self._state, self._world.truth, self._field
        self._fill_moment(message)
        message["positions"] = state.position[field].reshape(-1)
        message["velocities"] = state.velocity[field].reshape(-1) / CYCLE_TIME
        message["yaws"] = state.yaw[field]
        message["neck_yaws"] = self._world.belief.neck[field]
        message["actions"] = state.action[field]
        message["targets"] = state.target[field]
        message["take_counter"] = state.take_count[field]
        return message.tobytes()

    def episode(self, seed: int) -> bytes:
        """An Episode message of the episode that has just ended; `seed` is the match's."""
        seen, field = self._world.belief, self._field
        cycles = int(seen.cycle[field])
        return codec(EPISODE).encode(
            {
                "stamp": stamp(self.stamp_ns()),
                "number": int(seen.episode[field]),
                "seed": seed,
                "cycles": cycles,
                "duration": cycles * CYCLE_TIME,
                "outcome": int(seen.outcome[field]),
                "lost_by": int(self._world.truth.last_keeper[field]),
                "match_id": self._match_id,
                "header": header(self.stamp_ns()),
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
                "visible_angle": float(np.radians(config.vision.visible_angle_deg)),
                "speed": speed,
                "seed": seed,
                "player_names": task.player_names,
                "code_version": code_version(),
                "config_json": json.dumps(config.to_dict(), allow_nan=False),
                "first_episode": first_episode,
                "match_id": self._match_id,
                "visible_angle_deg": config.vision.visible_angle_deg,
            }
        )

    def markers(self) -> bytes:
        """A MarkerArray that shows the truth in RViz and Foxglove."""
        state, field = self._world.truth, self._field
        return marker_array(
            self._world.task, state.position[field], state.yaw[field], self.stamp_ns()
        )

    def _fill_moment(self, messages: np.ndarray) -> None:
        now, seen, field = stamp(self.stamp_ns()), self._world.belief, self._field
        for name in ("stamp", "header.stamp"):
            messages[f"{name}.sec"], messages[f"{name}.nanosec"] = now["sec"], now["nanosec"]
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
    markers = [
        {"header": header(time_ns), **marker} for marker in field_markers(task, position, yaw)
    ]
    return codec(MARKERS).encode({"markers": markers})


def rows(messages: np.ndarray) -> list[bytes]:
    """Every message of a structured array (`Codec.empty`) as its bytes."""
    data, size = messages.tobytes(), messages.itemsize
    return [data[start : start + size] for start in range(0, len(data), size)]
