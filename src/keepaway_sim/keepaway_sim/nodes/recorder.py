"""The recorder's node: what a match publishes, into a bag, with a count of what is missing.

It does not spin: two hundred times a second it takes all that came from its subscriptions, as
bytes. That costs a fraction of a callback for each message, and deep histories keep what comes in
between. The simulator can wait for it: `recorded` has the simulated time that it has reached.
"""

import json
import math
import struct
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import attrs
from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription

from keepaway_sim.bags.checked import check_match
from keepaway_sim.bags.gaps import GapCounter
from keepaway_sim.bags.timeline import OwnTimes
from keepaway_sim.bags.topics import default_qos
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.errors import LOG_PERIOD, KeepawayError
from keepaway_sim.ros.parameters import declare_settings, warn_of_unknown
from keepaway_sim.ros.running import run_node
from keepaway_sim.ros.subscribing import listen, offered_qos, take_all, to_profile
from keepaway_sim.settings import flat, setting
from keepaway_sim.version import code_version
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.messages import (
    ACTION_REQUEST,
    AGENT_STATUS,
    CLOCK,
    CYCLE_NS,
    EPISODE,
    FIELD_STATE,
    MARKERS,
    MATCH,
    PERCEPTION,
    stamp,
)

POLL_PERIOD = 0.005  # [s]
FLUSH_PERIOD = 1.0  # [s]
QUIET = 0.3  # [s] nothing came for this long: all that was published has come
LONGEST_FIRST_WAIT = 10.0  # [s] for a player that publishes no requests
LONGEST_LAST_WAIT = 5.0  # [s] a match that continues is left after this time
REPORT_STEP = 10 * CYCLE_NS  # a simulator that waits for it lets it be further behind than that
MATCH_TOPICS = {
    "/clock": CLOCK,
    "match": MATCH,
    "field_state": FIELD_STATE,
    "episode": EPISODE,
    "markers": MARKERS,
}
PLAYER_TOPICS = {
    "perception": PERCEPTION,
    "action_request": ACTION_REQUEST,
    "status": AGENT_STATUS,
}


@attrs.frozen
class RecorderSettings:
    """The recorder's parameters.

    Raises:
        KeepawayError: a value outside its range.
    """

    path: str = setting("", "folder of the bag to write")
    compression: str = setting("zstd", "of its chunks", choices=("zstd", "lz4", "none"))
    history: int = setting(
        2000, "that a topic keeps until they are taken", "messages", "[1, 1000000]"
    )
    more_topics: str = setting("", "to record too, as /topic=package/msg/Name, comma-separated")

    def __attrs_post_init__(self) -> None:
        if not self.path:
            raise KeepawayError("path is not set: name the bag that is to be made")

    def topics(self) -> dict[str, str]:
        """The types of the topics that are recorded from the start on."""
        entries = [entry.partition("=") for entry in self.more_topics.split(",") if entry]
        for topic, _, message_type in entries:
            if message_type.count("/") != 2:
                raise KeepawayError(f"more_topics: {topic} needs a type, =package/msg/Name")
        return MATCH_TOPICS | {topic: message_type for topic, _, message_type in entries}


class Recorder(Node):
    """Records one match.

    Attributes:
        settings: its parameters.
        bag: where to.
        gaps: what came and what did not.
    """

    def __init__(self, **node_options: Any) -> None:
        """Begin the bag and listen to the match; to its players once it has named them.

        Raises:
            KeepawayError: no path was given, or its folder exists.
        """
        super().__init__("recorder", **node_options)
        self.settings = declare_settings(self, RecorderSettings)
        warn_of_unknown(self, (RecorderSettings,))
        self.gaps = GapCounter()
        self._subscriptions_by_topic: dict[str, tuple[str, Subscription]] = {}
        self._times = OwnTimes()
        self._reported = -1
        self._connected_at = math.inf  # [s] of the monotonic clock: all but the players' requests
        self._flushed = time.monotonic()
        for name, message_type in self.settings.topics().items():
            self._listen(name, message_type)
        self._recorded = self.create_publisher(
            Time, "recorded", QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        )
        info = {
            "recorder": json.dumps(flat(self.settings), allow_nan=False),
            "code_version": code_version(),
        }
        self.bag = BagWriter(self.settings.path, info, self.settings.compression)

    def poll(self) -> int:
        """Record everything that has come.

        Returns:
            how many messages.
        """
        count = 0
        for topic, message_type, data in self._taken():
            self._record(topic, message_type, data)
            count += 1
        if self._is_listening_to_players():
            self._report(max(0, self.gaps.complete_until()), is_behind=count > 0)
        if time.monotonic() - self._flushed > FLUSH_PERIOD:
            self.bag.flush()
            self._flushed = time.monotonic()
        return count

    def _taken(self) -> Iterator[tuple[str, str, bytes]]:
        """What has come: topic, type, bytes.

        Requests are taken first and given last: what they answer was published before them, so it
        has been taken then, and its time is known.
        """
        known = list(self._subscriptions_by_topic.items())
        requests = [
            (topic, kind, data)
            for topic, (kind, subscription) in known
            if kind == ACTION_REQUEST
            for data in take_all(subscription)
        ]
        for topic, (kind, subscription) in known:
            if kind != ACTION_REQUEST:
                yield from ((topic, kind, data) for data in take_all(subscription))
        yield from requests

    def finish(self) -> str:
        """Take what is still coming, and close the bag.

        Returns:
            what is missing, in words.
        """
        quiet_since = started = time.monotonic()
        while time.monotonic() - quiet_since < QUIET:
            if self.poll():
                quiet_since = time.monotonic()
            if time.monotonic() - started > LONGEST_LAST_WAIT:
                break
            time.sleep(POLL_PERIOD)
        report = self.gaps.report()
        self.bag.add_info(gaps=report, missing=json.dumps(self.gaps.missing(), allow_nan=False))
        self.bag.close()
        return report

    def _listen(self, name: str, message_type: str) -> None:
        topic = self.resolve_topic_name(name)
        if topic in self._subscriptions_by_topic:
            return
        qos = default_qos(message_type)
        if message_type == EPISODE:  # older bags offer it volatile, and earlier episodes have ended
            qos = qos._replace(transient_local=False)
        profile = to_profile(qos, self.settings.history)
        subscription = listen(self, topic, message_type, profile)
        self._subscriptions_by_topic[topic] = message_type, subscription

    def _record(self, topic: str, message_type: str, data: bytes) -> None:
        if topic not in self.bag.topics:
            qos = offered_qos(self, topic, default_qos(message_type))
            self.bag.add_topic(topic, message_type, qos)
        try:
            match = codec(MATCH).decode(data) if message_type == MATCH else None
            log_time = self._times.of(message_type, data)
            self.gaps.feed(topic, message_type, data)
        except (KeepawayError, struct.error) as error:  # in a bag it would stop every reader
            self.get_logger().warning(
                f"{topic}: not recorded: {error}", throttle_duration_sec=LOG_PERIOD
            )
            return
        self.bag.write(topic, message_type, data, log_time)
        if match is not None:
            self._learn_players(match)

    def _learn_players(self, match: Mapping[str, Any]) -> None:
        """Listen to the players that a Match names, where it makes sense."""
        try:
            check_match(match)
        except KeepawayError as error:
            self.get_logger().warning(f"match: {error}", throttle_duration_sec=LOG_PERIOD)
            return
        self.gaps.match_id = self.gaps.match_id or match["match_id"]
        self._listen_to_players(match["player_names"])

    def _listen_to_players(self, names: Sequence[str]) -> None:
        for player in names:
            for name, message_type in PLAYER_TOPICS.items():
                self._listen(f"{player}/{name}", message_type)
            self.gaps.expect(self.resolve_topic_name(f"{player}/perception"))
        self.gaps.expect(self.resolve_topic_name("field_state"))

    def _is_listening_to_players(self) -> bool:
        """Whether all that publish each cycle are connected, and all players who answer.

        A player may publish its first request late: it is waited for `LONGEST_FIRST_WAIT`.
        """
        if self._reported >= 0:
            return True
        topics = self.gaps.topics
        if len(topics) < 2 or not all(map(self._is_connected, topics)):
            return False
        now = time.monotonic()
        self._connected_at = min(self._connected_at, now)
        requests = [
            topic
            for topic, (message_type, _) in self._subscriptions_by_topic.items()
            if message_type == ACTION_REQUEST
        ]
        waited = now - self._connected_at
        return all(map(self._is_connected, requests)) or waited > LONGEST_FIRST_WAIT

    def _is_connected(self, topic: str) -> bool:
        """Whether a publisher's messages come here; the graph may know it before that."""
        _, subscription = self._subscriptions_by_topic[topic]
        return bool(subscription.get_publisher_count())

    def _report(self, time_ns: int, is_behind: bool) -> None:
        """Say what has been reached: all of it, or while more is coming a step ahead."""
        step = REPORT_STEP if is_behind and self._reported >= 0 else 1
        if not 0 <= time_ns - self._reported < step:  # time may begin anew
            self._reported = time_ns
            self._recorded.publish(Time(**stamp(time_ns)))


def main(args: list[str] | None = None) -> None:
    """Record until SIGINT or SIGTERM.

    Raises:
        SystemExit: with 0 where nothing is missing; with 1 where something is, nothing came, or
            nothing can be recorded.
    """
    run_node("recorder", _record, (RecorderSettings,), KeepawayError, args)


def _record(is_over: Callable[[], bool]) -> None:
    recorder = Recorder()
    recorder.get_logger().info(f"records to {recorder.bag.path}")
    while not is_over():
        recorder.poll()
        time.sleep(POLL_PERIOD)
    report = recorder.finish()
    complete = recorder.gaps.is_complete()
    log = recorder.get_logger().info if complete else recorder.get_logger().warning
    log(f"{recorder.bag.message_count} messages in {recorder.bag.path}: {report}")
    raise SystemExit(int(not complete))


if __name__ == "__main__":
    main()
