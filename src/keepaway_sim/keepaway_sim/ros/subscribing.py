"""What recorder, replayer and spectator share: messages that pass as bytes."""

import importlib
from collections.abc import Iterator
from typing import Any

from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.validate_full_topic_name import validate_full_topic_name

from keepaway_sim.bags.topics import Qos
from keepaway_sim.errors import KeepawayError


def message_class(message_type: str) -> type[Any]:
    """The Python class of "package/msg/Name".

    Raises:
        KeepawayError: it is not installed.
    """
    package, _, name = [*message_type.split("/"), "", ""][:3]
    try:
        if f"{package}/msg/{name}" != message_type or not name.isidentifier():
            raise ImportError("not a type's name")
        return getattr(importlib.import_module(f"{package}.msg"), name)  # type: ignore[no-any-return]
    except (ImportError, AttributeError, ValueError) as error:
        raise KeepawayError(f"{message_type[:100]!r} is not installed: {error}") from error


def check_topic_name(name: str) -> None:
    """Whether ROS takes this for a topic's name.

    Raises:
        KeepawayError: it does not.
    """
    try:
        validate_full_topic_name(name)
    except InvalidTopicNameException as error:
        raise KeepawayError(f"not a topic's name: {error}") from error


def listen(node: Node, topic: str, message_type: str, qos: QoSProfile) -> Subscription:
    """A subscription whose messages wait, as bytes, to be taken; DDS keeps the last of them.

    Its node must not be given to an executor, which would take them.
    """
    return node.create_subscription(
        message_class(message_type), topic, _never_called, qos, raw=True
    )


def take_all(subscription: Subscription) -> Iterator[bytes]:
    """Everything that has come on a subscription since the last time."""
    with subscription.handle:
        while taken := subscription.handle.take_message(subscription.msg_type, True):
            yield taken[0]


def _never_called(message: bytes) -> None:
    """Messages are taken, not handed out."""


def to_profile(qos: Qos, depth: int) -> QoSProfile:
    """A QoS profile of that kind with a history of its own depth."""
    return QoSProfile(
        depth=depth,
        durability=DurabilityPolicy.TRANSIENT_LOCAL
        if qos.transient_local
        else DurabilityPolicy.VOLATILE,
        reliability=ReliabilityPolicy.RELIABLE if qos.reliable else ReliabilityPolicy.BEST_EFFORT,
    )


def offered_qos(node: Node, topic: str, otherwise: Qos) -> Qos:
    """How a topic's publisher offers it; its depth is not published, so not known here."""
    publishers = node.get_publishers_info_by_topic(topic)
    if not publishers:
        return otherwise
    profile = publishers[0].qos_profile
    return Qos(
        otherwise.depth,
        profile.durability == DurabilityPolicy.TRANSIENT_LOCAL,
        profile.reliability == ReliabilityPolicy.RELIABLE,
    )
