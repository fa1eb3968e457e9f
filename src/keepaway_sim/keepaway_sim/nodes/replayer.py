"""The replayer's node: publishes again what was recorded, byte for byte, at any rate.

Names in the bag are taken relative to the node's namespace, so `-r __ns:=/again` moves a whole
match; only /clock stays where it is.
"""

import re
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import attrs
import rclpy
from rclpy.duration import Duration
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.playback import Playback, difference_from_installed, episode_times
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.timeline import Timeline
from keepaway_sim.bags.topics import Recorded, Topic
from keepaway_sim.cli.interrupts import SIGNALS, Stopped
from keepaway_sim.errors import KeepawayError, one_line
from keepaway_sim.ros.parameters import declare_settings, warn_of_unknown
from keepaway_sim.ros.running import check_arguments, end_ros
from keepaway_sim.ros.subscribing import check_topic_name, message_class, to_profile
from keepaway_sim.settings import setting
from keepaway_sim.wire.messages import SECOND

HISTORY = 2000
"""Messages kept for slow listeners: a replay as fast as possible overtakes every subscriber."""
LONGEST_SPIN = 0.1  # [s]
LONGEST_LINGER = 5.0  # [s] for a listener that does not listen any more


@attrs.frozen
class ReplayerSettings:
    """The replayer's parameters.

    Raises:
        KeepawayError: a value outside its range.
    """

    path: str = setting("", "folder of the bag")
    rate: float = setting(
        1.0, "simulated over wall time; 0: as fast as possible", "1", "[0, 10000]"
    )
    start: float = setting(
        -1.0, "simulated time to begin at; -1: the bag's beginning", "s", "[-1, 1e9]"
    )
    end: float = setting(-1.0, "simulated time to end before; -1: the bag's end", "s", "[-1, 1e9]")
    episodes: str = setting("", "play only these, like 7 or 3-9; empty: all")
    topics: str = setting("", "play only these, comma-separated; empty: all")
    match: int = setting(
        0,
        "number of the match, from 1 on, where the bag has several; 0: the only one",
        "",
        "[0, 1000000]",
    )
    as_recorded: bool = setting(
        False, "play also what has another definition than the installed one"
    )
    loop: bool = setting(False, "begin again at the end")
    paused: bool = setting(False, "wait for the services resume or step")
    start_delay: float = setting(
        0.5, "wall time between what is latched and the rest", "s", "[0, 3600]"
    )
    wait_for_subscribers: int = setting(
        0, "begin when N topics have a subscriber", "topics", "[0, 1000]"
    )

    def __attrs_post_init__(self) -> None:
        if not self.path:
            raise KeepawayError("path is not set: name the bag that is to be played")

    def times(self) -> tuple[int | None, int | None]:
        """From when on and before when to play [ns]."""
        if self.episodes:
            bag = MatchBag(self.path, self.match or None)
            return episode_times(bag, *_range(self.episodes))
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
        self.settings = declare_settings(self, ReplayerSettings, ("rate",), self._on_settings)
        warn_of_unknown(self, (ReplayerSettings,))
        timeline = Timeline.of_bag(BagReader(self.settings.path), self.settings.match)
        topics = self._playable(timeline)
        self.playback = Playback(
            timeline,
            self.settings.rate,
            *self.settings.times(),
            topics,
            self.settings.loop,
        )
        if self.settings.paused:
            self.playback.pause()
        self._publishers_by_topic = {
            name: self._make_publisher(timeline.topics[name]) for name in topics
        }
        for name, action in (
            ("pause", self.playback.pause),
            ("resume", self.playback.resume),
            ("step", self.playback.step),
        ):
            self.create_service(Trigger, f"~/{name}", self._service(action))

    def play(self, spin: Callable[[float], None]) -> int:
        """Play to the end, which a loop has not.

        Args:
            spin: lets ROS handle what has come, or waits that many seconds for it.

        Returns:
            the number of messages published.
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
        """Wait until subscribers have what was published."""
        for publisher in self._publishers_by_topic.values():
            publisher.wait_for_all_acked(Duration(seconds=LONGEST_LINGER))

    def _playable(self, timeline: Timeline) -> list[str]:
        """The topics to play: those asked for that are of installed types.

        Raises:
            KeepawayError: one of another definition than the installed one, or none is left.
        """
        wanted = self.settings.recorded_topics() or list(timeline.topics)
        playable = []
        for name in wanted:
            topic = timeline.topics.get(name)
            try:
                difference = difference_from_installed(topic) if topic else ""
                if topic:
                    message_class(topic.message_type)
                    check_topic_name(name)
            except KeepawayError as error:
                self.get_logger().warning(f"{one_line(name)} is left out: {error}")
                continue
            if difference and not self.settings.as_recorded:
                raise KeepawayError(
                    f"{name}: {difference}; --as-recorded true plays its bytes all the same"
                )
            playable.append(name)
        if not playable:
            raise KeepawayError(f"{timeline.reader.path}: no topic of an installed type")
        return playable

    def _make_publisher(self, topic: Topic) -> Publisher:
        name = topic.name
        here = name if name == "/clock" else name.lstrip("/")
        return self.create_publisher(
            message_class(topic.message_type), here, to_profile(topic.qos, HISTORY)
        )

    def _await_subscribers(self, spin: Callable[[float], None]) -> None:
        begin = time.monotonic()
        while rclpy.ok(context=self.context):
            subscribed = sum(
                p.get_subscription_count() > 0 for p in self._publishers_by_topic.values()
            )
            left = begin + self.settings.start_delay - time.monotonic()
            if subscribed >= self.settings.wait_for_subscribers and left <= 0:
                return
            spin(min(LONGEST_SPIN, max(left, 0.01)))

    def _say(self, messages: list[Recorded]) -> int:
        for message in messages:
            self._publishers_by_topic[message.topic].publish(message.data)
        return len(messages)

    def _on_settings(self, settings: ReplayerSettings) -> None:
        self.playback.rate = settings.rate

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
    found = re.fullmatch(r"\s*(\d{1,9})(?:-(\d{1,9}))?\s*", text)
    if not found or int(found[2] or found[1]) < int(found[1]):
        raise KeepawayError(f"episodes={text!r}: write 7 or 3-9")
    return int(found[1]), int(found[2] or found[1])


@contextmanager
def stoppable(executor: Any) -> Iterator[Callable[[float], None]]:
    """Lets ROS spin until a signal asks the program to end; then the next spin raises `Stopped`.

    Before the block SIGTERM simply ends the process: nothing has begun that must be ended.
    """
    came: list[int] = []

    def spin(seconds: float) -> None:
        if came:
            raise Stopped(came[0])
        executor.spin_once(timeout_sec=seconds)

    before = [
        (number, signal.signal(number, lambda signum, _: came.append(signum)))
        for number in SIGNALS
        if signal.getsignal(number) is not signal.SIG_IGN  # nohup stays nohup
    ]
    try:
        yield spin
    finally:
        for number, handler in before:
            signal.signal(number, handler)


def main(args: list[str] | None = None) -> int:
    """Play a bag.

    Returns:
        0, or 1 where it cannot be played; after a signal what shells expect, 143 after SIGTERM.
    """
    check_arguments("replayer", (ReplayerSettings,), sys.argv[1:] if args is None else args)
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        replayer = Replayer()
        executor = EventsExecutor()
        executor.add_node(replayer)
        with stoppable(executor) as spin:
            count = replayer.play(spin)
            replayer.linger()
        replayer.get_logger().info(f"published {count} messages")
    except (KeepawayError, InvalidParameterTypeException) as error:
        get_logger("replayer").error(str(error))
        return 1
    except Stopped as stopped:
        return stopped.code
    except KeyboardInterrupt:
        return 128 + signal.SIGINT
    except ExternalShutdownException:
        pass
    finally:
        end_ros()
    return 0


if __name__ == "__main__":
    sys.exit(main())
