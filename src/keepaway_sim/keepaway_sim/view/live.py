"""A running match, for browsers: its messages made into the page's events, and a small server.

The server listens on this machine only, by default, and answers only requests that
name it as their host and come from its own page. Events go over one long HTTP answer for each
browser (server-sent events); a browser that is slow misses cycles; no other waits for it.
"""

from __future__ import annotations

import json
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from keepaway_sim.bags.match_bag import EpisodeSummary, Track
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Outcome, Task
from keepaway_sim.view.page import encoded, episode_data, frames, match_data
from keepaway_sim.wire import messages
from keepaway_sim.wire.cdr import codec
from keepaway_sim.world.config import NEVER

FRAME_PERIOD = 0.05  # [s] browsers are not sent more moments
KEPT_EPISODES = 100_000  # sent to browsers that connect later

Event = tuple[str, str]
"""Its kind, and its data as JSON: match, frame or episode."""


class LiveMatch:
    """Makes events of a match's messages, whatever order the topics come in.

    Most of what is published is never shown, so messages are kept as they came and read on demand.

    Attributes:
        history: the events that a browser needs to follow from now on.
    """

    def __init__(self, send: Callable[[Event], None]) -> None:
        """Events go to `send` as they are made."""
        self._send = send
        self._task: Task | None = None
        self._match: Event | None = None
        self._match_id = 0
        self._episodes: list[Event] = []
        self._moments: dict[tuple[int, int], _Moment] = {}
        self._sent_at = 0.0
        self._lock = threading.Lock()

    @property
    def history(self) -> list[Event]:
        """What was published before: the match, and its finished episodes."""
        with self._lock:
            return [*([self._match] if self._match else []), *self._episodes]

    def feed(self, message_type: str, data: bytes) -> list[str]:
        """Take a message.

        Returns:
            the names of the players, if it was a Match.

        Raises:
            KeepawayError: bytes that are not such a message, or not one of this match.
        """
        try:
            if message_type == messages.MATCH:
                return self._begin(codec(message_type).decode(data))
            if messages.match_of(message_type, data) not in (0, self._match_id):
                return []  # another simulator publishes in this namespace
            if self._task is not None and message_type == messages.EPISODE:
                self._end_episode(codec(message_type).decode(data))
            elif self._task is not None:
                self._keep(message_type, data)
        except (ValueError, IndexError, struct.error) as error:
            raise KeepawayError(f"a {message_type} that makes no sense here: {error}") from error
        return []

    def show(self) -> None:
        """Send a moment, if it is time for one, of which everything has come, and episodes' ends.

        Everything has come of the moments before the newest.

        Raises:
            KeepawayError: bytes that are not such a message, or not one of this match.
        """
        newest = max(self._moments, default=None)
        for key in sorted(self._moments):
            is_last = self._is_last(self._moments[key])
            if key == newest and not is_last:
                return
            moment = self._moments.pop(key)
            now = time.monotonic()
            if moment.state and (is_last or now - self._sent_at >= FRAME_PERIOD):
                self._sent_at = now
                self._send(("frame", _json([key[0], encoded(self._frame(moment))])))

    def _begin(self, said: dict[str, Any]) -> list[str]:
        sides = said["field_length"], said["field_width"]
        task = Task(said["num_keepers"], said["num_takers"], *sides)
        names = list(said["player_names"])
        if names != list(task.player_names):  # they become topics, and a page's text
            raise ValueError(f"players {ascii(names)[:100]}, not {', '.join(task.player_names)}")
        event = ("match", _json(match_data(said)))
        with self._lock:
            self._task, self._match, self._match_id = task, event, said.get("match_id", 0)
            self._moments.clear()
            self._episodes.clear()
        self._send(event)
        return names

    def _end_episode(self, said: dict[str, Any]) -> None:
        outcome = Outcome(said["outcome"])
        summary = EpisodeSummary(
            said["number"], 0, 0, said["cycles"], said["duration"], outcome, said["lost_by"]
        )
        event = ("episode", _json(episode_data(summary)))
        with self._lock:
            self._episodes.append(event)
            del self._episodes[:-KEPT_EPISODES]
        self._send(event)

    def _keep(self, message_type: str, data: bytes) -> None:
        about = messages.read_head(message_type, data)
        moment = self._moments.setdefault((about.episode, about.cycle), _Moment())
        if message_type == messages.FIELD_STATE:
            moment.state, moment.outcome = data, about.outcome
        elif message_type == messages.PERCEPTION:
            moment.seen[about.player_index] = data
        else:
            moment.asked[about.player_index] = data

    def _is_last(self, moment: _Moment) -> bool:
        """Is it an episode's last moment, with everything published in it?"""
        assert self._task is not None
        ended = moment.state and moment.outcome != Outcome.IN_PLAY
        return bool(ended) and len(moment.seen) >= self._task.num_players

    def _frame(self, moment: _Moment) -> np.ndarray:
        assert self._task is not None
        try:
            return frames(_track(self._task, moment), self._task)
        except (ValueError, IndexError) as error:
            raise KeepawayError(f"a moment that makes no sense here: {error}") from error


@dataclass
class _Moment:
    """What was published in one cycle, as bytes."""

    state: bytes = b""
    outcome: int = Outcome.IN_PLAY
    seen: dict[int, bytes] = field(default_factory=dict)  # perceptions by player
    asked: dict[int, bytes] = field(default_factory=dict)  # requests by player


def _json(data: Any) -> str:
    """Data for a browser, on one line; ValueError where JSON has no word for a number (NaN)."""
    return json.dumps(data, allow_nan=False)


def _track(task: Task, moment: _Moment) -> Track:
    """One moment's messages as a track of one cycle."""
    num, objects = task.num_players, task.num_players + 1
    state = codec(messages.FIELD_STATE).decode(moment.state)
    seen = [_decoded(messages.PERCEPTION, moment.seen.get(player)) for player in range(num)]
    asked = [_decoded(messages.ACTION_REQUEST, moment.asked.get(player)) for player in range(num)]
    nowhere = [np.nan] * (2 * objects)
    values = np.full((1, num, task.num_keepers), np.nan)
    for player, request in enumerate(asked):
        known = request.get("action_values", [])[: task.num_keepers]
        values[0, player, : len(known)] = known

    def each(said: list[dict[str, Any]], name: str, otherwise: Any) -> np.ndarray:
        return np.array([[entry.get(name, otherwise) for entry in said]])

    return Track(
        time=np.zeros(1, dtype=np.int64),
        outcome=np.array([state["outcome"]]),
        cycle=np.array([state["cycle"]]),
        position=np.array(state["positions"]).reshape(1, objects, 2),
        velocity=np.array(state["velocities"]).reshape(1, objects, 2),
        yaw=np.array([state["yaws"]]),
        neck=np.array([state["neck_yaws"]]),
        action=np.array([state["actions"]]),
        target=np.array([state["targets"]]),
        believed=each(seen, "positions", nowhere).reshape(1, num, objects, 2),
        age=each(seen, "ages", [NEVER] * objects),
        kickable=each(seen, "ball_kickable", False),
        due=each(seen, "decision_due", False),
        cycles_to_ball=each(seen, "cycles_to_ball", [NEVER] * num),
        requested=each(asked, "action", -1),
        requested_target=each(asked, "target", -1),
        values=values,
    )


def _decoded(message_type: str, data: bytes | None) -> dict[str, Any]:
    """A message's values; none of one that did not come."""
    return {} if data is None else codec(message_type).decode(data)
