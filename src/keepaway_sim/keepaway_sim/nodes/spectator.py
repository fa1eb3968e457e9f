"""The spectator's node: hears a match and shows it to browsers; see `live`."""

from collections.abc import Sequence
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile

from keepaway_sim.errors import KeepawayError
from keepaway_sim.live import LiveMatch
from keepaway_sim.messages import ACTION_REQUEST, EPISODE, FIELD_STATE, MATCH, PERCEPTION
from keepaway_sim.nodes.raw import message_class, to_profile
from keepaway_sim.recording import Qos

LOG_PERIOD = 5.0  # [s] the same complaint is not made more often


class Spectator(Node):
    """Hears a match, from its description on, and feeds it to a live page."""

    def __init__(self, live: LiveMatch, **node_options: Any) -> None:
        """Listen to the match; to its players once it has said who they are."""
        super().__init__("spectator", **node_options)
        self._live = live
        self._heard: set[str] = set()
        self._listen("match", MATCH, to_profile(Qos(1, transient_local=True), 1))
        self._listen("field_state", FIELD_STATE)
        self._listen("episode", EPISODE, to_profile(Qos(transient_local=True), 1000))

    def _listen(self, topic: str, message_type: str, qos: QoSProfile | int = 50) -> None:
        if topic not in self._heard:
            self._heard.add(topic)
            hear = partial(self._hear, message_type)
            self.create_subscription(message_class(message_type), topic, hear, qos, raw=True)

    def _hear(self, message_type: str, data: bytes) -> None:
        try:
            names = self._live.feed(message_type, data)
        except KeepawayError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=LOG_PERIOD)
            return
        self._listen_to_players(names)

    def _listen_to_players(self, names: Sequence[str]) -> None:
        for player in names:
            self._listen(f"{player}/perception", PERCEPTION)
            self._listen(f"{player}/action_request", ACTION_REQUEST)
