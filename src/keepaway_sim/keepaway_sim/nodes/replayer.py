"""The replayer's node: says again what was recorded, byte for byte, at any rate.

Names in the bag are taken relative to the node's namespace, so `-r __ns:=/again` moves a whole
match; only /clock stays where it is.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import rclpy
from rcl_interfaces.msg import SetParametersResult
from rclpy.duration import Duration
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from std_srvs.srv import Trigger

from keepaway_sim.bags.playback import Playback, episode_times
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.topics import Recorded
from keepaway_sim.errors import KeepawayError
from keepaway_sim.ros.subscribing import declared, message_class, to_profile
from keepaway_sim.wire.messages import SECOND

HISTORY = 2000
"""Messages kept for slow listeners: a replay as fast as possible overtakes everybody."""
LONGEST_SPIN = 0.1  # [s]
LONGEST_LINGER = 5.0  # [s] for a listener that does not listen any more


@dataclass(frozen=True)
class Settings:
    """The replayer's parameters.

    Raises:
        KeepawayError: a value outside its range.
    """

    path: str = ""  # folder of the bag
    rate: float = 1.0  # simulated over wall time; 0: as fast as possible
    start: float = -1.0  # simulated time to begin at [s]; -1: the bag's beginning
    end: float = -1.0  # simulated time to end before [s]; -1: the bag's end
    episodes: str = ""  # play only these, like 7 or 3-9
    topics: str = ""  # play only these, comma-separated; empty: all
    loop: bool = False  # begin again at the end
    paused: bool = False  # wait for the services resume or step
    start_delay: float = 0.5  # wall time between what is latched and the rest [s]
    wait_for_subscribers: int = 0  # so many topics must be listened to before it begins

    def __post_init__(self) -> None:
        if not self.path:
            raise KeepawayError("path is not set: name the bag that is to be played")

    def times(self) -> tuple[int | None, int | None]:
        """From when on and before when to play [ns]."""
        if self.episodes:
            return episode_times(self.path, *_range(self.episodes))
        return (
            None if self.start < 0 else round(self.start * SECOND),
            None if self.end < 0 else round(self.end * SECOND),
        )

    def recorded_topics(self) -> list[str]:
        """The topics to play as the bag calls them, given with a slash in front or without."""
        return ["/" + topic.strip().lstrip("/") for topic in self.topics.split(",") if topic]


class Replayer(Node):
    """Plays one bag.

    Attributes:
        settings: its parameters.
        playback: where it is.
    """

    def __init__(self, **node_options: Any) -> None:
        """Open the bag and offer its topics.

        Raises:
            KeepawayError: no bag, or not what is asked for.
        """
        super().__init__("replayer", **node_options)
        self.settings = declared(self, Settings, changeable=("rate",))
        self._reader = BagReader(self.settings.path)
        topics = self.settings.recorded_topics() or list(self._reader.topics)
        self.playback = Playback(
            self._reader,
            self.settings.rate,
            *self.settings.times(),
            topics,
            self.settings.loop,
        )
        if self.settings.paused:
            self.playback.pause()
        self._publishers_by_topic = {topic: self._make_publisher(topic) for topic in topics}
        self.add_on_set_parameters_callback(self._on_parameters)
        for name, action in (
            ("pause", self.playback.pause),
            ("resume", self.playback.resume),
            ("step", self.playback.step),
        ):
            self.create_service(Trigger, f"~/{name}", self._service(action))

    def play(self, spin: Callable[[float], None]) -> int:
        """Play to the end, which a loop has not.

        Args:
            spin: lets ROS handle what has come, or waits for it so many seconds.

        Returns:
            how many messages were said.
        """
        count = self._say(self.playback.prologue())
        self._await_subscribers(spin)
        moments = 0
        while rclpy.ok(context=self.context) and not self.playback.finished:
            wait = self.playback.wait(time.monotonic())
            spin(min(wait, LONGEST_SPIN))
            count += self._say(self.playback.due(time.monotonic()))
            moments += 1
            if not self.playback.rate and moments % (HISTORY // 2) == 0:
                self.linger()
        return count

    def linger(self) -> None:
        """Wait until listeners have what was said."""
        for publisher in self._publishers_by_topic.values():
            publisher.wait_for_all_acked(Duration(seconds=LONGEST_LINGER))

    def _make_publisher(self, name: str) -> Publisher:
        topic = self._reader.topics[name]
        here = name if name == "/clock" else name.lstrip("/")
        return self.create_publisher(
            message_class(topic.message_type), here, to_profile(topic.qos, HISTORY)
        )

    def _await_subscribers(self, spin: Callable[[float], None]) -> None:
        begin = time.monotonic()
        while rclpy.ok(context=self.context):
            heard = sum(p.get_subscription_count() > 0 for p in self._publishers_by_topic.values())
            left = begin + self.settings.start_delay - time.monotonic()
            if heard >= self.settings.wait_for_subscribers and left <= 0:
                return
            spin(min(LONGEST_SPIN, max(left, 0.01)))

    def _say(self, messages: list[Recorded]) -> int:
        for message in messages:
            self._publishers_by_topic[message.topic].publish(message.data)
        return len(messages)

    def _on_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == "rate":
                try:
                    self.playback.rate = float(parameter.value)
                except (KeepawayError, TypeError) as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _service(
        self, action: Callable[[], None]
    ) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
        def serve(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            action()
            response.success = True
            response.message = f"at {self.playback.time / SECOND:.1f} s"
            return response

        return serve


def _range(text: str) -> tuple[int, int]:
    """The first and the last of "7" or "3-9"."""
    first, _, last = text.partition("-")
    try:
        return int(first), int(last or first)
    except ValueError:
        raise KeepawayError(f"episodes={text!r}: write 7 or 3-9") from None


def main(args: list[str] | None = None) -> int:
    """Play a bag.

    Returns:
        0, or 2 where it cannot be played.
    """
    rclpy.init(args=args)
    try:
        replayer = Replayer()
        executor = EventsExecutor()
        executor.add_node(replayer)
        count = replayer.play(lambda seconds: executor.spin_once(timeout_sec=seconds))
        replayer.linger()
        replayer.get_logger().info(f"said {count} messages")
    except (KeepawayError, InvalidParameterTypeException) as error:
        get_logger("replayer").error(str(error))
        return 2
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0
