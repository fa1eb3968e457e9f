"""What a simulator says: publishers of bytes, and a bag that gets the same bytes."""

from __future__ import annotations

from collections.abc import Callable

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
ALL = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Whoever counts episodes may come late."""
TOPICS = {
    "match": (Match, messages.MATCH, LATCHED),
    "/clock": (Clock, messages.CLOCK, QUEUE),
    "field_state": (FieldState, messages.FIELD_STATE, QUEUE),
    "episode": (Episode, messages.EPISODE, ALL),
    "markers": (MarkerArray, messages.MARKERS, QUEUE),
}


class Voice:
    """Says messages, given as CDR bytes, on a node's topics and into a bag.

    Attributes:
        trouble: why the bag is no longer written, in words; empty while it is.
    """

    def __init__(self, node: Node, player_names: tuple[str, ...], bag: BagWriter | None) -> None:
        """Make a publisher for every topic; `bag` may be None."""
        perceptions = {f"{name}/perception": _PERCEPTION for name in player_names}
        self._bag, self._logger = bag, node.get_logger()
        self.trouble = ""
        self._notes: list[tuple[str, str, bytes, int]] = []
        self._publishers: dict[str, Publisher] = {}
        self._types: dict[str, str] = {}
        for topic, (message_class, message_type, qos) in (TOPICS | perceptions).items():
            self._publishers[topic] = node.create_publisher(message_class, topic, qos)
            self._types[topic] = message_type

    def say(self, topic: str, data: bytes, time: int) -> None:
        """Publish, and record as of `time` [simulated ns]."""
        publisher = self._publishers[topic]
        publisher.publish(data)
        if self._bag is not None:
            self.note(publisher.topic_name, self._types[topic], data, time)

    def repeat(self, topic: str, data: bytes) -> None:
        """Publish what was said before."""
        self._publishers[topic].publish(data)

    def say_if_heard(self, topic: str, make: Callable[[], bytes], time: int) -> None:
        """Make the message if somebody listens or a bag is written, and publish or record it."""
        if self.has_listeners(topic):
            self.say(topic, make(), time)
        elif self._bag is not None:
            self.note(self._publishers[topic].topic_name, self._types[topic], make(), time)

    def has_listeners(self, topic: str) -> bool:
        """Does anybody listen?"""
        return bool(self._publishers[topic].get_subscription_count())

    def wait_until_heard(self, topic: str, patience: float) -> None:
        """Wait until what was said on a topic has arrived everywhere, at most so many seconds."""
        self._publishers[topic].wait_for_all_acked(Duration(seconds=patience))

    def note(self, topic: str, message_type: str, data: bytes, time: int) -> None:
        """Record what somebody else said, if a bag is written; `topic` is its name in full."""
        if self._bag is not None:
            self._notes.append((topic, message_type, data, time))

    def write_down(self) -> None:
        """Write into the bag what was said and noted since the last time.

        Done while the players think, so that a recorded match is hardly slower. A bag that cannot
        be written (the disk is full) ends there; the match does not.
        """
        notes, self._notes = self._notes, []
        if self._bag is None:
            return
        try:
            for note in notes:
                self._bag.write(*note)
        except KeepawayError as error:
            self._bag, self.trouble = None, str(error)
            self._logger.error(f"the match goes on unrecorded: {error}")


_PERCEPTION = (Perception, messages.PERCEPTION, QUEUE)
