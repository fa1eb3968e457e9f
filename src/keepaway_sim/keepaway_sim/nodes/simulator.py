"""The simulator's node: one World, played with players who are nodes of their own.

It is wiring: `match.conductor` plays the match, this connects it to topics, services, parameters.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import attrs
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

from keepaway_msgs.msg import ActionRequest, AgentStatus, Match
from keepaway_sim.bags.field_recorder import world_info
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.errors import LOG_PERIOD, KeepawayError
from keepaway_sim.match.conductor import FAREWELL, Conductor, Spin
from keepaway_sim.match.settings import CHANGEABLE, MatchSettings, read_named_texts
from keepaway_sim.ros.diagnostics import Troubles, diagnostics, simulator_status
from keepaway_sim.ros.parameters import declare_settings, warn_of_unknown
from keepaway_sim.ros.publishing import ALL, LATCHED, MATCHES, QUEUE, MatchPublisher
from keepaway_sim.ros.raw_subscription import PROCESS_SIZE, RawSubscription
from keepaway_sim.ros.running import run_node
from keepaway_sim.settings import same
from keepaway_sim.task import Task
from keepaway_sim.world.config import Config, Physics, Skills, Vision, profile
from keepaway_sim.world.world import World

DIAGNOSTICS_PERIOD = 1.0  # [s]
OWN_TOPICS = ("match", "episode", "field_state", "/clock")
"""No other node publishes these in a match."""


@attrs.frozen
class _Profile:
    """What the defaults of the world's constants depend on."""

    profile: str = same(Config, "profile")


class Simulator(Node):
    """The node of a match.

    Attributes:
        conductor: the match.
    """

    def __init__(self, **node_options: Any) -> None:
        """Lay out the field and publish what is played.

        Args:
            node_options: for `rclpy.node.Node`.

        Raises:
            KeepawayError: parameters that make no match.
        """
        super().__init__("simulator", **node_options)
        self._is_shut_down = False  # noted: to ask ROS takes a microsecond, many times a cycle
        self.context.on_shutdown(self._on_shutdown)
        settings = declare_settings(self, MatchSettings, CHANGEABLE, self._on_settings)
        task = Task.parse(settings.task, settings.field)
        world = World(task, self._declare_config())
        warn_of_unknown(self, (MatchSettings, Config))
        self._bag = self._open_bag(world, settings)
        self._publisher = MatchPublisher(self, task.player_names, self._bag)
        self.conductor = Conductor(world, settings, self._publisher, self.get_logger())
        self.conductor.count_recorders = partial(self.count_publishers, "recorded")
        self.conductor.on_begin = self._publish_diagnostics
        self.conductor.on_end = self._publish_last_diagnostics
        self._diagnosed_at, self._diagnosed_cycles = time.monotonic(), 0
        self._troubles = Troubles()
        self._subscribe()
        self._offer()
        self.conductor.announce()

    def play(self, spin: Spin, must_end: Callable[[], bool] = lambda: False) -> None:
        """Play until all episodes have ended, or a signal comes, or ROS is shut down."""
        self.conductor.play(spin, lambda: self._is_shut_down or must_end())
        if self.context.ok():
            self.conductor.take_leave()

    def _on_shutdown(self) -> None:
        self._is_shut_down = True

    def destroy_node(self) -> None:
        """Leave the graph."""
        for subscription in self._raw_subscriptions:
            subscription.destroy()
        super().destroy_node()

    def close(self) -> None:
        """Finish the bag; a match that was refused leaves none.

        Raises:
            KeepawayError: it is not whole.
        """
        self._publisher.write_recorded()
        if self._bag is not None and self.conductor.is_refused:
            self._bag.discard()
        elif self._bag is not None:
            self._bag.close()
        if self._publisher.trouble:
            raise KeepawayError(self._publisher.trouble)

    def _declare_config(self) -> Config:
        """The world's constants: those of a profile, each of which is a parameter, too."""
        name = declare_settings(self, _Profile).profile
        default = profile(name)
        return Config(
            name,
            declare_settings(self, Physics, default=default.physics),
            declare_settings(self, Vision, default=default.vision),
            declare_settings(self, Skills, default=default.skills),
        )

    def _open_bag(self, world: World, settings: MatchSettings) -> BagWriter | None:
        if not settings.record:
            return None
        texts = read_named_texts("record_info", settings.record_info)
        files = read_named_texts("record_attachments", settings.record_attachments)
        info = world_info(world, settings.seed, **texts)
        bag = BagWriter(Path(settings.record), info)
        for name, path in files.items():
            bag.attach(name, Path(path).read_bytes())
        return bag

    def _subscribe(self) -> None:
        self._raw_subscriptions = [
            RawSubscription(self, message, f"{seat.name}/{topic}", partial(callback, player), qos)
            for player, seat in enumerate(self.conductor.roster.seats)
            for topic, message, callback, qos in (
                ("action_request", ActionRequest, self._on_request, QUEUE),
                ("status", AgentStatus, self._on_status, LATCHED),
            )
        ]
        self._raw_subscriptions += [
            RawSubscription(self, Match, "match", self.conductor.take_match, MATCHES),
            RawSubscription(self, Time, "recorded", self.conductor.take_recorded, ALL),
        ]

    def _offer(self) -> None:
        """Services and diagnostics."""
        conductor = self.conductor
        for action in (conductor.start, conductor.pause, conductor.reset):
            for name in (f"~/{action.__name__}", action.__name__):  # the second: until 0.3
                self.create_service(Trigger, name, partial(_on_trigger, action))
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", QUEUE)
        self.create_timer(DIAGNOSTICS_PERIOD, self._publish_diagnostics)

    def _on_request(self, player: int, data: bytes, gid: bytes) -> None:
        self.conductor.take_request(player, data, gid[:PROCESS_SIZE])

    def _on_status(self, player: int, data: bytes, gid: bytes) -> None:
        self.conductor.take_status(player, data, gid[:PROCESS_SIZE])

    def _on_settings(self, settings: MatchSettings) -> None:
        self.conductor.settings = settings

    def _publish_last_diagnostics(self) -> None:
        self._publish_diagnostics()
        self._diagnostics.wait_for_all_acked(Duration(seconds=FAREWELL))

    def _publish_diagnostics(self) -> None:
        conductor, now = self.conductor, time.monotonic()
        seen, num_cycles = conductor.world.belief, conductor.num_cycles
        recent = (num_cycles - self._diagnosed_cycles) / (now - self._diagnosed_at)
        self._diagnosed_at, self._diagnosed_cycles = now, num_cycles
        figures = {
            "episode": str(seen.episode[0]),
            "cycle": str(seen.cycle[0]),
            "cycles_per_second": f"{recent:.0f}",
            "mean_cycles_per_second": f"{num_cycles / max(conductor.time_played, 1e-9):.1f}",
        }
        prefix = self.get_namespace().rstrip("/") + "/"
        stamp = self.get_clock().now().to_msg()
        seats = conductor.roster.seats
        strays = self._topics_of_others()
        answering = [self.count_publishers(f"{seat.name}/action_request") for seat in seats]
        self._diagnostics.publish(
            diagnostics(
                simulator_status(prefix, conductor.state(), figures, strays),
                self._troubles.player_statuses(prefix, seats, answering, now),
                conductor.match_id,
                stamp,
            )
        )

    def _topics_of_others(self) -> list[str]:
        """Of the topics that only a simulator publishes, those that another node publishes too."""
        strays = [topic for topic in OWN_TOPICS if self.count_publishers(topic) > 1]
        if strays:
            self.get_logger().warning(
                f"another node publishes {', '.join(strays)}: choose another namespace or domain"
                " for it",
                throttle_duration_sec=LOG_PERIOD,
            )
        return strays


def _on_trigger(
    action: Callable[[], str], _: Trigger.Request, response: Trigger.Response
) -> Trigger.Response:
    response.success, response.message = True, action()
    return response


def main(args: list[str] | None = None) -> None:
    """Run a match until it has finished, or SIGINT or SIGTERM ends it; then its bag is whole.

    Raises:
        SystemExit: it cannot play.
    """
    run_node("simulator", _play, (MatchSettings, Config), KeepawayError, args)


def _play(must_end: Callable[[], bool]) -> None:
    simulator = Simulator()
    executor = EventsExecutor()  # the quick one
    executor.add_node(simulator)
    gc.freeze()  # nor what has been compiled
    try:
        simulator.play(lambda timeout: executor.spin_once(timeout), must_end)
    finally:
        simulator.close()


if __name__ == "__main__":
    main()
