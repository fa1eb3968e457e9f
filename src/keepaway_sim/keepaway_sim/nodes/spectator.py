"""The spectator's node: subscribes to a match and shows it to browsers; see `live`."""

from collections.abc import Sequence
from typing import Any

from rclpy.node import Node
from rclpy.subscription import Subscription

from keepaway_sim.bags.topics import Qos
from keepaway_sim.errors import LOG_PERIOD, KeepawayError
from keepaway_sim.ros.subscribing import listen, take_all, to_profile
from keepaway_sim.view.live import LiveMatch
from keepaway_sim.wire.messages import ACTION_REQUEST, EPISODE, FIELD_STATE, MATCH, PERCEPTION

DRAIN_PERIOD = 0.02  # [s]
EVERY_CYCLE = Qos(100)  # what is not taken in time is missed


class Spectator(Node):
    """Subscribes to a match, from its description on, and feeds it to a live page."""

    def __init__(self, live: LiveMatch, **node_options: Any) -> None:
        """Listen to the match; to its players once it has named them."""
        super().__init__("spectator", **node_options)
        self._live = live
        self._heard: dict[str, tuple[str, Subscription]] = {}
        self._listen("match", MATCH, Qos(1, transient_local=True))
        self._listen("field_state", FIELD_STATE)
        self._listen("episode", EPISODE, Qos(1000, transient_local=True))

    def poll(self) -> None:
        """Take everything that has come, and show the newest of it."""
        for message_type, subscription in list(self._heard.values()):
            for data in take_all(subscription):
                self._feed(message_type, data)
        try:
            self._live.show()
        except KeepawayError as error:
            self._complain(error)

    def _listen(self, topic: str, message_type: str, qos: Qos = EVERY_CYCLE) -> None:
        if topic not in self._heard:
            profile = to_profile(qos, qos.depth)
            self._heard[topic] = message_type, listen(self, topic, message_type, profile)

    def _feed(self, message_type: str, data: bytes) -> None:
        try:
            self._listen_to_players(self._live.feed(message_type, data))
        except KeepawayError as error:
            self._complain(error)

    def _listen_to_players(self, names: Sequence[str]) -> None:
        for player in names:
            self._listen(f"{player}/perception", PERCEPTION)
            self._listen(f"{player}/action_request", ACTION_REQUEST)

    def _complain(self, error: KeepawayError) -> None:
        self.get_logger().warning(str(error), throttle_duration_sec=LOG_PERIOD)
