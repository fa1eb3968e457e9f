"""What a simulator publishes: bytes, and a bag that gets the same bytes."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from visualization_msgs.msg import MarkerArray

from keepaway_msgs.msg import Episode, FieldState, Match, Perception
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire import messages

QUEUE = QoSProfile(depth=200)
"""Deeper than a player needs: a recorder may be some cycles behind."""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
MATCHES = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For subscribers of `match`: with a depth of 1 another simulator's would replace the own one's."""
ALL = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For topics of events: a late subscriber gets all of them."""
TOPICS = {
    "match": (Match, messages.MATCH, LATCHED),
    "/clock": (Clock, messages.CLOCK, QUEUE),
    "field_state": (FieldState, messages.FIELD_STATE, QUEUE),
    "episode": (Episode, messages.EPISODE, ALL),
    "markers": (MarkerArray, messages.MARKERS, QUEUE),
}


class MatchPublisher:
    """Publishes messages, given as CDR bytes, on a node's topics and writes them into a bag.

    Attributes:
        trouble: why the bag is no longer written, in words; empty while it is.
    """

    def __init__(self, node: Node, player_names: tuple[str, ...], bag: BagWriter | None) -> None:
        """Make a publisher for every topic; `bag` may be None."""
        perceptions = {f"{name}/perception": _PERCEPTION for name in player_names}
        self._bag, self._logger = bag, node.get_logger()
        self.trouble = ""
        self._prefix = node.get_namespace().rstrip("/") + "/"
        self._unwritten: list[tuple[str, str, bytes, int]] = []
        self._publishers: dict[str, Publisher] = {}
        self._types: dict[str, str] = {}
        for topic, (message_class, message_type, qos) in (TOPICS | perceptions).items():
            self._publishers[topic] = node.create_publisher(message_class, topic, qos)
            self._types[topic] = message_type

    def publish(self, topic: str, data: bytes, time: int) -> None:
        """Publish, and record as of `time` [simulated ns]."""
        publisher = self._publishers[topic]
        publisher.publish(data)
        if self._bag is not None:
            self._unwritten.append((publisher.topic_name, self._types[topic], data, time))

    def repeat(self, topic: str, data: bytes) -> None:
        """Publish once more what was published before."""
        self._publishers[topic].publish(data)

    def publish_if_wanted(self, topic: str, make: Callable[[], bytes], time: int) -> None:
        """Make the message where it is subscribed to or recorded, and publish or record it."""
        if self.has_subscribers(topic):
            self.publish(topic, make(), time)
        elif self._bag is not None:
            name = self._publishers[topic].topic_name
            self._unwritten.append((name, self._types[topic], make(), time))

    def has_subscribers(self, topic: str) -> bool:
        """Whether anything subscribes to it."""
        return bool(self._publishers[topic].get_subscription_count())

    def wait_until_received(self, patience: float) -> None:
        """Wait until all subscribers have all that was published, at most `patience` seconds.

        What a process has published and not sent yet is lost with it.
        """
        until = monotonic() + patience
        for publisher in self._publishers.values():
            publisher.wait_for_all_acked(Duration(seconds=max(0.0, until - monotonic())))

    def record_answer(self, topic: str, message_type: str, data: bytes, time: int) -> None:
        """Record what another node published, if a bag is written; `topic` is relative."""
        if self._bag is not None:
            self._unwritten.append((self._prefix + topic, message_type, data, time))

    def write_recorded(self) -> None:
        """Write into the bag what was recorded since the last time.

        Done while the players decide, so that a recorded match is hardly slower. A bag that cannot
        be written (the disk is full) ends there; the match does not.
        """
        messages, self._unwritten = self._unwritten, []
        if self._bag is None:
            return
        try:
            for message in messages:
                self._bag.write(*message)
        except KeepawayError as error:
            self._bag, self.trouble = None, str(error)
            self._logger.error(f"the match continues unrecorded: {error}")


_PERCEPTION = (Perception, messages.PERCEPTION, QUEUE)
