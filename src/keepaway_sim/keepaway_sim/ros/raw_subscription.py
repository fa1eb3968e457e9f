"""Messages as bytes together with who sent them.

The middleware marks every message with its publisher's identity; rclpy of ROS 2 Jazzy does not
hand it on. So a raw subscription is a `Waitable` of its own, which takes messages with
`rcl_take_serialized_message`, the function of ROS's C library that rclpy takes them with too.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.type_support import check_for_type_support
from rclpy.waitable import NumberOfEntities, Waitable

GID_SIZE = 16
"""Bytes of a publisher's identity in rmw."""
PROCESS_SIZE = 12
"""The first of them name its DDS participant: a process, strictly one `rclpy.Context` in it."""


class _Allocator(ctypes.Structure):
    """`rcutils_allocator_t`: four functions and their state."""

    _fields_ = [(name, ctypes.c_void_p) for name in ("make", "free", "grow", "zeroed", "state")]


class _Bytes(ctypes.Structure):
    """`rcutils_uint8_array_t`, which is `rcl_serialized_message_t`."""

    _fields_ = [
        ("buffer", ctypes.c_void_p),
        ("length", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
        ("allocator", _Allocator),
    ]


class _MessageInfo(ctypes.Structure):
    """`rmw_message_info_t`; two times [ns], two sequence numbers, then the publisher."""

    _fields_ = [
        ("times_and_numbers", ctypes.c_uint64 * 4),
        ("implementation", ctypes.c_char_p),
        ("gid", ctypes.c_ubyte * GID_SIZE),
        ("from_same_process", ctypes.c_bool),
    ]


_RCL = ctypes.CDLL("librcl.so")
_RCL.rcl_take_serialized_message.argtypes = [
    ctypes.c_void_p,
    ctypes.POINTER(_Bytes),
    ctypes.POINTER(_MessageInfo),
    ctypes.c_void_p,
]
_RCUTILS = ctypes.CDLL("librcutils.so")
_RCUTILS.rcutils_get_default_allocator.restype = _Allocator
_RCUTILS.rcutils_uint8_array_fini.argtypes = [ctypes.POINTER(_Bytes)]


class RawSubscription(Waitable):
    """Subscribes to one topic for as long as its node lives."""

    def __init__(
        self,
        node: Node,
        message_class: type[Any],
        topic: str,
        on_message: Callable[[bytes, bytes], None],
        qos: QoSProfile,
    ) -> None:
        """Subscribe.

        Args:
            node: that subscribes.
            message_class: of the topic's messages.
            topic: its name, relative to the node's namespace.
            on_message: called with a message's bytes and its publisher's identity.
            qos: of the subscription.
        """
        super().__init__(node.default_callback_group)
        check_for_type_support(message_class)
        name = node.resolve_topic_name(topic)
        with node.handle:
            self._subscription = _rclpy.Subscription(
                node.handle, message_class, name, qos.get_c_qos_profile()
            )
        self._on_message, self._is_open = on_message, True
        self._place = 0  # in the wait set
        self._bytes = _Bytes(allocator=_RCUTILS.rcutils_get_default_allocator())
        self._info = _MessageInfo()
        node.add_waitable(self)

    def __enter__(self) -> None:
        """The executor begins to use it."""
        self._subscription.__enter__()

    def __exit__(self, *error: object) -> None:
        """The executor no longer uses it."""
        self._subscription.__exit__(*error)

    def get_num_entities(self) -> NumberOfEntities:
        """What it puts into a wait set."""
        return NumberOfEntities(num_subs=1)

    def add_to_wait_set(self, wait_set: Any) -> None:
        """Put it there."""
        self._place = wait_set.add_subscription(self._subscription)

    def is_ready(self, wait_set: Any) -> bool:
        """Hand on what has come, so that nothing is left to be done by the executor.

        It would make a task of every message, which takes longer than taking it.
        """
        if self._is_open and wait_set.is_ready("subscription", self._place):
            taken = self._take()
            if taken is not None:  # the executor may report a message that is gone
                self._on_message(*taken)
        return False

    def _take(self) -> tuple[bytes, bytes] | None:
        """The oldest message and its publisher; None if there is none."""
        with self._subscription:
            missing = _RCL.rcl_take_serialized_message(
                self._subscription.pointer, self._bytes, self._info, None
            )
        if missing:
            return None
        return ctypes.string_at(self._bytes.buffer, self._bytes.length), bytes(self._info.gid)

    def take_data(self) -> None:
        """Never called, as it is never ready."""

    async def execute(self, taken_data: None) -> None:
        """Never called, as it is never ready."""

    def destroy(self) -> None:
        """Unsubscribe, whatever an executor still has in hand."""
        self._is_open = False
        self._subscription.destroy_when_not_in_use()
        _RCUTILS.rcutils_uint8_array_fini(self._bytes)
