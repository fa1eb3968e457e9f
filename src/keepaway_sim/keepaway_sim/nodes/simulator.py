"""The simulator's node: one World, played with players who are nodes of their own.

A cycle: every player is sent what it perceives, the answers are waited for (`roster`), the world
takes a step. Messages are the bytes that `messages` makes, so a recording has just what was sent.
"""

from __future__ import annotations

import faulthandler
import gc
import json
import math
import signal
import struct
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.duration import Duration
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from keepaway_msgs.msg import ActionRequest, AgentStatus
from keepaway_sim.bags.field_recorder import world_info
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.errors import KeepawayError
from keepaway_sim.match.beginning import begin_match
from keepaway_sim.match.roster import Roster
from keepaway_sim.ros.diagnostics import diagnostics
from keepaway_sim.ros.inbox import PROCESS_SIZE, Inbox
from keepaway_sim.ros.publishing import ALL, LATCHED, QUEUE, Voice
from keepaway_sim.ros.subscribing import declared
from keepaway_sim.task import Outcome, Task
from keepaway_sim.wire import messages
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.field_messages import FieldMessages
from keepaway_sim.world.config import CYCLE_TIME, PROFILES, Config, profile
from keepaway_sim.world.world import World

RESEND_PERIOD = 0.25  # [s] an unanswered perception is sent again
MARKER_PERIOD = 0.1  # [s] viewers are not sent more
HEALTH_PERIOD = 1.0  # [s]
LOG_PERIOD = 5.0  # [s] the same complaint is not made more often
FAREWELL = 2.0  # [s] at most, for the players to take in the end of the last episode
LONGEST_EXIT = 15.0  # [s] the middleware's own end was once seen to hang
RECORDER_LAG = 50  # [cycles] that a recorder may be behind
FIXED = ParameterDescriptor(read_only=True)
ANY_TYPE = ParameterDescriptor(read_only=True, dynamic_typing=True)

Spin = Callable[[float], None]
"""Lets ROS handle what has come, or waits for it at most so many seconds."""


@dataclass(frozen=True)
class Settings:
    """The simulator's parameters beside the world's constants.

    Raises:
        KeepawayError: a value outside its range.
    """

    task: str = "3v2"
    field: str = "25x25"  # length x width [m]
    seed: int = 0
    speed: float = 0.0  # simulated over wall time; 0: as fast as the players answer
    episodes: int = 0  # to play, those before first_episode included; 0: without end
    first_episode: int = 0  # its number; to go on with a match whose simulator died
    answer_timeout: float = 2.0  # [s] wall time; a player who takes longer is missing
    autostart: bool = True  # kick off when all players are there
    record: str = ""  # folder of a bag to write; empty: none
    record_info: str = "{}"  # JSON object of texts, written into the bag
    record_attachments: str = "{}"  # JSON object, name -> file to put into the bag
    wait_for_recorder: bool = False  # play no faster than recorders' nodes follow

    def __post_init__(self) -> None:
        for name in ("seed", "episodes", "first_episode", "speed"):
            if not 0 <= getattr(self, name) < float("inf"):
                raise KeepawayError(f"{name}={getattr(self, name)}: give 0 or more")
        if not 0 < self.answer_timeout < float("inf"):
            raise KeepawayError(f"answer_timeout={self.answer_timeout}: give seconds above 0")


CHANGEABLE = ("speed", "answer_timeout")
"""Settings that may be changed while a match is on."""


class Simulator(Node):
    """A match, from waiting for its players to the end of its last episode.

    Attributes:
        settings, world: what is played.
        roster: who plays.
        num_finished: episodes that have ended, those before `first_episode` included.
        num_cycles: played here.
    """

    def __init__(self, **node_options: Any) -> None:
        """Lay out the field and say what is played.

        Args:
            node_options: for `rclpy.node.Node`.

        Raises:
            KeepawayError: parameters that make no match.
        """
        super().__init__("simulator", **node_options)
        self.settings = declared(self, Settings, CHANGEABLE)
        task = Task.parse(self.settings.task, self.settings.field)
        self.world = World(task, self._declare_config())
        begin_match(self.world, self.settings.seed, self.settings.first_episode)
        self.roster = Roster(task, self.world.config)
        self.num_finished, self.num_cycles = self.settings.first_episode, 0
        self._is_running, self._is_reset = self.settings.autostart, False
        self._statuses: dict[int, dict[str, Any]] = {}
        self._first_counts: dict[int, int] = {}
        self._perceptions: list[bytes] = []
        self._recorded: dict[bytes, int] = {}  # [ns] what recorders have reached, by publisher
        self._due = self._remind_at = self._markers_at = 0.0  # [s] of the monotonic clock
        self._health_at, self._health_cycles = time.monotonic(), 0
        self._time_played = 0.0  # [s]
        self._messages = FieldMessages(self.world)
        self._prefix = self.get_namespace().rstrip("/") + "/"
        self._bag = self._open_bag()
        self._voice = Voice(self, task.player_names, self._bag)
        self._listen()
        played = self.settings.seed, self.settings.speed, self.settings.first_episode
        self._voice.say("match", self._messages.match(*played), 0)

    def play(self, spin: Spin, is_told_to_end: Callable[[], bool] = lambda: False) -> None:
        """Play until all episodes are over, or somebody says so, or ROS is shut down."""
        self._is_told_to_end, self._spin = is_told_to_end, spin
        while not self._is_over():
            if not self._can_play():
                spin(RESEND_PERIOD)
                continue
            began = time.monotonic()
            self._let_recorder_follow()
            self._send()
            if not self._is_played():
                self._collect()
                self._step()
            self._time_played += time.monotonic() - began
        self._say_farewell()

    def destroy_node(self) -> None:
        """Leave the graph."""
        for inbox in self._inboxes:
            inbox.destroy()
        super().destroy_node()

    def close(self) -> None:
        """Finish the bag.

        Raises:
            KeepawayError: it is not whole.
        """
        self._voice.write_down()
        if self._bag is not None:
            self._bag.close()
        if self._voice.trouble:
            raise KeepawayError(self._voice.trouble)

    # Making the node.

    def _declare_config(self) -> Config:
        """The world's constants: those of a profile, each of which is a parameter, too."""
        name = str(self.declare_parameter("profile", "2005", ANY_TYPE).value)
        default = profile(name) if name in PROFILES else profile()
        changes = {
            field.name: self.declare_parameter(field.name, getattr(group, field.name), FIXED).value
            for group in (default.physics, default.vision, default.skills)
            for field in fields(group)
        }
        return profile(name, **changes)

    def _open_bag(self) -> BagWriter | None:
        if not self.settings.record:
            return None
        info = world_info(self.world, self.settings.seed, **json.loads(self.settings.record_info))
        bag = BagWriter(Path(self.settings.record), info)
        for name, path in json.loads(self.settings.record_attachments).items():
            bag.attach(name, Path(path).read_bytes())
        return bag

    def _listen(self) -> None:
        self._inboxes = [
            Inbox(self, message, f"{seat.name}/{topic}", partial(callback, player), qos)
            for player, seat in enumerate(self.roster.seats)
            for topic, message, callback, qos in (
                ("action_request", ActionRequest, self._on_request, QUEUE),
                ("status", AgentStatus, self._on_status, LATCHED),
            )
        ]
        self._inboxes.append(Inbox(self, Time, "recorded", self._on_recorded, ALL))
        for name, serve in (
            ("start", self._on_start),
            ("pause", self._on_pause),
            ("reset", self._on_reset),
        ):
            self.create_service(Trigger, name, serve)
        self.add_on_set_parameters_callback(self._on_parameters)
        self._health = self.create_publisher(DiagnosticArray, "diagnostics", QUEUE)
        self.create_timer(HEALTH_PERIOD, self._say_health)

    # What others say.

    def _on_request(self, player: int, data: bytes, gid: bytes) -> None:
        try:
            self.roster.take(player, data, gid[:PROCESS_SIZE])
        except KeepawayError as error:
            self._say_rejected(player, error)

    def _on_status(self, player: int, data: bytes, gid: bytes) -> None:
        seat = self.roster.seats[player]
        was_there = seat.present or seat.returning
        try:
            status = read_status(data, player, seat.name)
            if status is None:
                return
            self.roster.welcome(player, gid[:PROCESS_SIZE])
        except KeepawayError as error:
            seat.rejected += 1
            self._say_rejected(player, error)
            return
        self._statuses[player] = {**status, "data": data}
        if not was_there:
            self.get_logger().info(f"{seat.name} is ready: {status['policy']}")

    def _say_rejected(self, player: int, error: KeepawayError) -> None:
        seen, name = self.world.perceptions, self.roster.seats[player].name
        self.get_logger().warning(
            f"{name}, episode {seen.episode[0]} cycle {seen.cycle[0]}: rejected: {error}",
            throttle_duration_sec=LOG_PERIOD,
        )

    def _on_recorded(self, data: bytes, gid: bytes) -> None:
        try:
            self._recorded[gid] = messages.read_time(data)
        except struct.error as error:
            self.get_logger().warning(
                f"recorded: ignored: {error}", throttle_duration_sec=LOG_PERIOD
            )

    def _on_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        given = {p.name: p.value for p in parameters if p.name in CHANGEABLE}
        try:
            self.settings = Settings(**{**asdict(self.settings), **given})
        except KeepawayError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _on_start(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._is_running, response.success = True, True
        missing = self._missing()
        response.message = f"waits for {missing}" if missing else "plays"
        return response

    def _on_pause(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._is_running, response.success, response.message = False, True, "pauses"
        return response

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._is_reset, response.success = True, True
        response.message = "ends the episode and kicks off the next one"
        return response

    # A cycle.

    def _is_over(self) -> bool:
        return self._is_played() or self._is_told_to_end() or not self.context.ok()

    def _is_played(self) -> bool:
        """Have all episodes ended?"""
        return 0 < self.settings.episodes <= self.num_finished

    def _can_play(self) -> bool:
        """Is the match on, and somebody there to play it?"""
        if not self._is_running:
            return False
        missing = self._missing()
        if missing:
            self.get_logger().warning(
                f"waits for {missing}", throttle_duration_sec=LOG_PERIOD, skip_first=True
            )
        elif not self._first_counts:
            self._first_counts = {p: s["episodes"] for p, s in self._statuses.items()}
            self._note_statuses()
            self._say_health()
        return not missing

    def _missing(self) -> str:
        """Names of those without whom it cannot go on: at first everybody, later anybody."""
        if not self._first_counts:
            recorders = max(1, self.count_publishers("recorded"))
            waits = self.settings.wait_for_recorder and len(self._recorded) < recorders
            return ", ".join([*self.roster.absent, *["a recorder"] * waits])
        return "any player" if self.roster.is_deserted else ""

    def _let_recorder_follow(self) -> None:
        """Wait for recorders that have fallen far behind; for one that stays there, no longer."""
        until = time.monotonic() + self.settings.answer_timeout
        while self._recorder_lag() > RECORDER_LAG and not self._is_over():
            self._spin(RESEND_PERIOD)
            if time.monotonic() > until:
                self.get_logger().error("a recorder is missing: the match goes on without it")
                now = self._messages.stamp_ns()
                self._recorded = {
                    gid: reached
                    for gid, reached in self._recorded.items()
                    if now - reached <= RECORDER_LAG * messages.CYCLE_NS
                }

    def _recorder_lag(self) -> int:
        """How far the slowest recorder is behind [cycles]; 0 if nobody waits for it."""
        if not self.settings.wait_for_recorder or not self._recorded:
            return 0
        return (self._messages.stamp_ns() - min(self._recorded.values())) // messages.CYCLE_NS

    def _send(self) -> None:
        """Tell everybody about this moment: first the players, who then think meanwhile."""
        now, stamp = time.monotonic(), self._messages.stamp_ns()
        for name in self.roster.begin(self.world, now):
            self.get_logger().info(f"{name} is back")
        self._perceptions = self._messages.perceptions()
        for seat, data in zip(self.roster.seats, self._perceptions, strict=True):
            self._voice.say(f"{seat.name}/perception", data, stamp)
        seen = self.world.perceptions
        if seen.outcome[0] != Outcome.IN_PLAY and seen.episode[0] == self.num_finished:
            self._voice.say("episode", self._messages.episode(self.settings.seed), stamp)
            self.num_finished += 1
        self._say_to_spectators(now, stamp)

    def _collect(self) -> None:
        """Wait for the answers; unless in lock-step, until the cycle's time is over."""
        until = self._end_of_cycle()
        self._voice.write_down()
        while self._is_collecting(until):
            self._spin(min(RESEND_PERIOD, max(0.0, until - time.monotonic())))
            now = time.monotonic()
            if now >= self._remind_at:
                self._remind(now)

    def _end_of_cycle(self) -> float:
        """When the cycle's time is over [s, monotonic]; never in lock-step."""
        if self.settings.speed == 0:
            return math.inf
        duration, now = CYCLE_TIME / self.settings.speed, time.monotonic()
        is_far_behind = self._due < now - duration  # then lost time is not caught up with
        self._due = (now if is_far_behind else self._due) + duration
        return self._due

    def _is_collecting(self, until: float) -> bool:
        if self._is_reset or self._is_told_to_end():
            return False
        if until < math.inf:
            return time.monotonic() < until
        return self.roster.num_awaited > 0

    def _remind(self, now: float) -> None:
        """Send again what may have been lost, and give up on who does not answer."""
        self._remind_at = now + RESEND_PERIOD
        timeout, seen = self.settings.answer_timeout, self.world.perceptions
        for name in self.roster.dismiss(now, timeout):
            self.get_logger().error(
                f"{name} is missing: no answer for {timeout} s, episode {seen.episode[0]} cycle"
                f" {seen.cycle[0]}; it does the default until it comes back"
            )
        for player in self.roster.unanswered(now - RESEND_PERIOD):
            name = self.roster.seats[player].name
            self._voice.repeat(f"{name}/perception", self._perceptions[player])

    def _step(self) -> None:
        """Play the cycle, or end the episode where a reset was asked for."""
        if self._is_told_to_end():
            return
        stamp, seen = self._messages.stamp_ns(), self.world.perceptions
        for name, data in self.roster.answers():
            topic = f"{self._prefix}{name}/action_request"
            self._voice.note(topic, messages.ACTION_REQUEST, data, stamp)
        reset, self._is_reset = self._is_reset, False
        if reset and seen.outcome[0] == Outcome.IN_PLAY:
            self.world.abort(0)
        else:
            self.world.step(*self.roster.requests())
            self.num_cycles += 1

    # Around the cycles.

    def _say_to_spectators(self, now: float, stamp: int) -> None:
        voice, make = self._voice, self._messages
        voice.say_if_heard("/clock", make.clock, stamp)
        voice.say_if_heard("field_state", make.field_state, stamp)
        if now >= self._markers_at and voice.has_listeners("markers"):
            self._markers_at = now + MARKER_PERIOD
            voice.say("markers", make.markers(), stamp)

    def _note_statuses(self) -> None:
        """Record who plays, in match order."""
        for player, seat in enumerate(self.roster.seats):
            if player in self._statuses:
                topic, data = f"{self._prefix}{seat.name}/status", self._statuses[player]["data"]
                stamp = self._messages.stamp_ns()
                self._voice.note(topic, messages.AGENT_STATUS, data, stamp)

    def _say_farewell(self) -> None:
        """Give everybody time to take in what was said last."""
        if not self._first_counts or not self.context.ok():
            return
        until = time.monotonic() + FAREWELL
        while time.monotonic() < until and (not self._is_taken_in() or self._recorder_lag()):
            self._spin(RESEND_PERIOD)
        self._note_statuses()
        self._say_health()
        self._voice.wait_until_heard("episode", FAREWELL)
        self._health.wait_for_all_acked(Duration(seconds=FAREWELL))

    def _is_taken_in(self) -> bool:
        num_here = self.num_finished - self.settings.first_episode
        return not self._is_played() or all(
            self._statuses[player]["episodes"] >= self._first_counts[player] + num_here
            for player, seat in enumerate(self.roster.seats)
            if seat.present
        )

    def _state(self) -> str:
        """What the match does now, in words."""
        if not self._is_running:
            return "pauses"
        missing, absent = self._missing(), ", ".join(self.roster.absent)
        if missing:
            return f"waits for {missing}"
        return f"plays without {absent}" if absent else "plays"

    def _say_health(self) -> None:
        now, seen = time.monotonic(), self.world.perceptions
        recent = (self.num_cycles - self._health_cycles) / (now - self._health_at)
        self._health_at, self._health_cycles = now, self.num_cycles
        state = self._state()
        figures = {
            "episode": str(seen.episode[0]),
            "cycle": str(seen.cycle[0]),
            "cycles_per_second": f"{recent:.0f}",
            "mean_cycles_per_second": f"{self.num_cycles / max(self._time_played, 1e-9):.1f}",
        }
        stamp = self.get_clock().now().to_msg()
        seats = self.roster.seats
        answering = [self.count_publishers(f"{seat.name}/action_request") for seat in seats]
        self._health.publish(diagnostics(self._prefix, stamp, state, figures, seats, answering))


def read_status(data: bytes, player: int, name: str) -> dict[str, Any] | None:
    """What an AgentStatus's bytes say; None of a player that is not ready.

    Raises:
        KeepawayError: bytes that are no AgentStatus, or one of another player.
    """
    status = codec(messages.AGENT_STATUS).decode(data)
    if not status["ready"]:
        return None
    if (status["player_index"], status["name"]) != (player, name):
        raise KeepawayError(f"the status of {status['name']!r}, player {status['player_index']}")
    return status


def main(args: list[str] | None = None) -> None:
    """Run a match until it is over or told to end (SIGINT, SIGTERM); then its bag is whole.

    Raises:
        SystemExit: it cannot play.
    """
    told: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda signum, _: told.append(signum))
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    try:
        simulator = Simulator()
        executor = EventsExecutor()  # the quick one
        executor.add_node(simulator)
        gc.freeze()  # what has been imported and compiled stays: no collection looks at it again
        try:
            simulator.play(lambda timeout: executor.spin_once(timeout), lambda: bool(told))
        finally:
            simulator.close()
    except (KeepawayError, InvalidParameterTypeException) as error:
        raise SystemExit(f"simulator: {error}") from error
    finally:
        faulthandler.dump_traceback_later(LONGEST_EXIT, exit=True)  # all is said and saved
        rclpy.try_shutdown()
