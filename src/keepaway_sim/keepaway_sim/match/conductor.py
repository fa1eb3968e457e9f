"""The course of a match: send perceptions, collect answers, remind, step, take leave. No ROS.

A cycle: every player is sent what it perceives, the answers are waited for (`roster`), the world
takes a step. Messages are the bytes that `wire` makes, so a recording has exactly what was sent.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable
from typing import Any, Protocol

from keepaway_sim.errors import KeepawayError, one_line
from keepaway_sim.match.beginning import begin_match, random_match_id
from keepaway_sim.match.recorders import RecorderProgress
from keepaway_sim.match.reporting import Log, Reporter
from keepaway_sim.match.roster import Roster, checked_status
from keepaway_sim.match.settings import MatchSettings
from keepaway_sim.task import Outcome
from keepaway_sim.wire import messages
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.field_messages import FieldMessages
from keepaway_sim.world.config import CYCLE_TIME
from keepaway_sim.world.world import World

RESEND_PERIOD = 0.25  # [s] an unanswered perception is sent again
MARKER_PERIOD = 0.1  # [s] viewers are not sent more
ARRIVAL = 10.0  # [s] after its start in which a simulator that finds another one refuses to play
BEGINS = "begins: all players are ready"
FAREWELL = 2.0  # [s] at most, for the players to take in the end of the last episode

Spin = Callable[[float], None]
"""Handles the messages that have come, or waits for one at most that many seconds."""


class Outlet(Protocol):
    """Where a match's messages go, given as CDR bytes; `ros.publishing` has the real one."""

    def publish(self, topic: str, data: bytes, time: int) -> None:
        """Publish, and record as of `time` [simulated ns]."""

    def repeat(self, topic: str, data: bytes) -> None:
        """Publish once more what was published before."""

    def publish_if_wanted(self, topic: str, make: Callable[[], bytes], time: int) -> None:
        """Make the message where it is subscribed to or recorded, and publish or record it."""

    def has_subscribers(self, topic: str) -> bool:
        """Whether anything subscribes to it."""

    def wait_until_received(self, patience: float) -> None:
        """Wait until all subscribers have all that was published, at most `patience` seconds."""

    def record_answer(self, topic: str, message_type: str, data: bytes, time: int) -> None:
        """Record what another node published, if a bag is written."""

    def write_recorded(self) -> None:
        """Write into the bag what was recorded since the last time."""


class Conductor:
    """A match, from waiting for its players to the end of its last episode.

    Attributes:
        world, settings: what is played; settings may be replaced while the match is running.
        match_id: identifies its messages among those of other matches.
        roster: who plays.
        recorders: how far those that record it have come.
        is_running: false while it pauses.
        num_finished: episodes that have ended, those before `first_episode` included.
        num_cycles: played by this simulator.
        time_played: that they took [s, wall].
        count_recorders: the number of recorders in the graph.
        on_begin, on_end: called once, before the first kick-off and after the last episode.
    """

    def __init__(
        self,
        world: World,
        settings: MatchSettings,
        outlet: Outlet,
        log: Log,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Kick off the first episode in the world; nothing is sent yet.

        Args:
            world: of one field.
            settings: of the match.
            outlet: that publishes and records.
            log: that takes what is reported in words.
            clock: the wall's [s].
        """
        self.world, self.settings = world, settings
        begin_match(world, settings.seed, settings.first_episode)
        self.match_id = settings.match_id or random_match_id()
        self.roster = Roster(world.task, world.config, self.match_id)
        self.recorders = RecorderProgress(settings.wait_for_recorder)
        self.is_running = settings.autostart
        self.num_finished, self.num_cycles, self.time_played = settings.first_episode, 0, 0.0
        self.count_recorders: Callable[[], int] = lambda: 0
        self.on_begin: Callable[[], None] = lambda: None
        self.on_end: Callable[[], None] = lambda: None
        self._outlet, self._clock = outlet, clock
        self._report = Reporter(log, clock)
        self._messages = FieldMessages(world, match_id=self.match_id)
        self._is_reset = self._has_begun = False
        self._arrived_at, self._refusal = clock(), ""
        self._publishers_of_match: set[bytes] = set()  # of this one, by their identities
        self._statuses: dict[int, dict[str, Any]] = {}
        self._first_counts: dict[int, int] = {}
        self._perceptions: list[bytes] = []
        self._due = self._remind_at = self._markers_at = 0.0  # [s] of the monotonic clock

    @property
    def recorder_lag(self) -> int:
        """How far the slowest recorder that is waited for is behind [cycles]."""
        return self.recorders.lag(self._messages.stamp_ns())

    def announce(self) -> None:
        """Publish what is played."""
        played = self.settings.seed, self.settings.speed, self.settings.first_episode
        self._outlet.publish("match", self._messages.match(*played), 0)

    def play(self, spin: Spin, must_end: Callable[[], bool] = lambda: False) -> None:
        """Play until all episodes have ended, or `must_end` is true.

        Raises:
            KeepawayError: another simulator was there before.
        """
        self._must_end, self._spin = must_end, spin
        while not self._is_over():
            if not self._can_play():
                spin(RESEND_PERIOD)
                continue
            began = self._clock()
            self._let_recorders_follow()
            self._send()
            if not self._is_played():
                self._collect()
                self._step()
            self.time_played += self._clock() - began
        if self._refusal:
            raise KeepawayError(self._refusal)

    def take_leave(self) -> None:
        """After `play`: give every subscriber time to take in what was published last."""
        if not self._has_begun:
            return
        until = self._clock() + FAREWELL
        while self._clock() < until and (not self._is_taken_in() or self.recorder_lag):
            self._spin(RESEND_PERIOD)
        self._record_statuses()
        self._outlet.wait_until_received(FAREWELL)
        self.on_end()

    # What others send and ask for.

    def take_request(self, player: int, data: bytes, sender: bytes) -> None:
        """Take an ActionRequest's bytes; what cannot be one is counted and warned of."""
        try:
            self.roster.take(player, data, sender)
        except KeepawayError as error:
            self._warn_rejected(player, error)

    def take_status(self, player: int, data: bytes, sender: bytes) -> None:
        """Take an AgentStatus's bytes: a player that is ready has a seat."""
        seat = self.roster.seats[player]
        was_there = seat.present or seat.returning
        try:
            status = checked_status(data, player, seat.name)
            if not status["ready"] or status["match_id"] not in (0, self.match_id):
                return
            self.roster.take_seat(player, sender)
        except KeepawayError as error:
            seat.rejected += 1
            self._warn_rejected(player, error)
            return
        self._statuses[player] = {**status, "data": data}
        if not was_there:
            self._report.info(f"{seat.name} is ready: {one_line(status['policy'])}")

    def take_match(self, data: bytes, sender: bytes) -> None:
        """Take a Match's bytes: an own one, or that of another simulator on the same topics."""
        try:
            other = codec(messages.MATCH).decode(data)
        except KeepawayError as error:
            self._report.warn("match", f"match: ignored: {error}")
            return
        if other["match_id"] == self.match_id:
            self._publishers_of_match.add(sender)
            if len(self._publishers_of_match) == 1:  # itself
                return
        found = f"another simulator publishes `match` here ({one_line(other['task'])})"
        has_just_come = self._clock() - self._arrived_at < ARRIVAL and not self._has_begun
        if has_just_come and not self.settings.force:
            self._refusal = (
                f"{found}: choose another namespace or domain, or force:=true (match.py: --domain,"
                " --force)"
            )
        else:
            self._report.warn(
                "match", f"{found}: match_id identifies them to players and scoreboards"
            )

    @property
    def is_refused(self) -> bool:
        """Does it not play, because another simulator was here first?"""
        return bool(self._refusal)

    def take_recorded(self, data: bytes, sender: bytes) -> None:
        """Take the bytes of the time that a recorder has reached."""
        try:
            self.recorders.take(data, sender)
        except struct.error as error:
            self._report.warn("recorded", f"recorded: ignored: {error}")

    def start(self) -> str:
        """Start or resume; what it does then, in words."""
        self.is_running = True
        return f"waits for {self.missing()}" if self.missing() else "plays"

    def pause(self) -> str:
        """Play no further cycle until it is started again; what it does then, in words."""
        self.is_running = False
        return "pauses"

    def reset(self) -> str:
        """End the episode, and kick off the next one; what it does then, in words."""
        self._is_reset = True
        return "ends the episode and kicks off the next one"

    def missing(self) -> str:
        """Players whom it waits for: before the match all, later any one."""
        if not self._has_begun:
            recorder = ["a recorder"] * self.recorders.is_missing(self.count_recorders())
            return ", ".join([*self.roster.absent, *recorder])
        return "any player" if self.roster.is_deserted else ""

    def state(self) -> str:
        """What the match does now, in words."""
        if not self.is_running:
            return "pauses"
        missing, absent = self.missing(), ", ".join(self.roster.absent)
        if missing:
            return f"waits for {missing}"
        return f"plays without {absent}" if absent else "plays"

    # Whether to play.

    def _is_over(self) -> bool:
        return self._is_played() or self._must_end() or bool(self._refusal)

    def _is_played(self) -> bool:
        """Have all episodes ended?"""
        return 0 < self.settings.episodes <= self.num_finished

    def _can_play(self) -> bool:
        """Is the match running, with at least one player present?"""
        if not self.is_running:
            return False
        missing = self.missing()
        if missing:
            self._report.waiting(f"waits for {missing}")
        elif not self._has_begun:
            self._begin()
        return not missing

    def _begin(self) -> None:
        self._has_begun = True
        self._first_counts = {p: s["episodes"] for p, s in self._statuses.items()}
        self._record_statuses()
        self._report.info(BEGINS)
        self.on_begin()

    def _let_recorders_follow(self) -> None:
        """Wait for recorders that have fallen far behind; for one that stays there, no longer."""
        until = self._clock() + self.settings.answer_timeout
        while self.recorders.is_behind(self._messages.stamp_ns()) and not self._is_over():
            self._spin(RESEND_PERIOD)
            if self._clock() > until:
                self._report.error("a recorder timed out: the match continues without it")
                self.recorders.time_out(self._messages.stamp_ns())

    # A cycle.

    def _send(self) -> None:
        """Publish this moment: first to the players, who then decide meanwhile."""
        now, stamp = self._clock(), self._messages.stamp_ns()
        for name in self.roster.begin(self.world, now):
            self._report.info(f"{name} is back")
        self._perceptions = self._messages.perceptions()
        for seat, data in zip(self.roster.seats, self._perceptions, strict=True):
            self._outlet.publish(f"{seat.name}/perception", data, stamp)
        seen = self.world.belief
        if seen.outcome[0] != Outcome.IN_PLAY and seen.episode[0] == self.num_finished:
            self._outlet.publish("episode", self._messages.episode(self.settings.seed), stamp)
            self.num_finished += 1
        self._send_to_viewers(now, stamp)

    def _send_to_viewers(self, now: float, stamp: int) -> None:
        outlet, make = self._outlet, self._messages
        outlet.publish_if_wanted("/clock", make.clock, stamp)
        outlet.publish_if_wanted("field_state", make.field_state, stamp)
        is_due = now >= self._markers_at - MARKER_PERIOD / 2  # cycles are not quite regular
        if is_due and outlet.has_subscribers("markers"):
            self._markers_at = max(self._markers_at, now - MARKER_PERIOD / 2) + MARKER_PERIOD
            outlet.publish("markers", make.markers(), stamp)

    def _collect(self) -> None:
        """Wait for the answers; unless in lock-step, until the cycle's time has passed."""
        until = self._end_of_cycle()
        self._outlet.write_recorded()
        while self._is_collecting(until):
            self._spin(min(RESEND_PERIOD, max(0.0, until - self._clock())))
            now = self._clock()
            if now >= self._remind_at:
                self._remind(now)

    def _end_of_cycle(self) -> float:
        """When the cycle's time has passed [s, monotonic]; never in lock-step."""
        if self.settings.speed == 0:
            return math.inf
        duration, now = CYCLE_TIME / self.settings.speed, self._clock()
        is_far_behind = self._due < now - duration  # then lost time is not caught up with
        self._due = (now if is_far_behind else self._due) + duration
        return self._due

    def _is_collecting(self, until: float) -> bool:
        if self._is_reset or self._must_end():
            return False
        if until < math.inf:
            return self._clock() < until
        return self.roster.num_awaited > 0

    def _remind(self, now: float) -> None:
        """Send again what may have been lost, and give up on who does not answer."""
        self._remind_at = now + RESEND_PERIOD
        timeout, seen = self.settings.answer_timeout, self.world.belief
        for name in self.roster.time_out(now, timeout):
            self._report.error(
                f"{name} timed out: no answer for {timeout} s, episode {seen.episode[0]} cycle"
                f" {seen.cycle[0]}; it does the default until it comes back"
            )
        for player in self.roster.unanswered(now - RESEND_PERIOD):
            name = self.roster.seats[player].name
            self._outlet.repeat(f"{name}/perception", self._perceptions[player])

    def _step(self) -> None:
        """Play the cycle; where a reset was asked for, the episode ends with it."""
        if self._must_end():
            return
        stamp, seen = self._messages.stamp_ns(), self.world.belief
        for name, data in self.roster.answers():
            topic = f"{name}/action_request"
            self._outlet.record_answer(topic, messages.ACTION_REQUEST, data, stamp)
        was_in_play = seen.outcome[0] == Outcome.IN_PLAY
        self.world.step(*self.roster.requests())
        self.num_cycles += 1
        reset, self._is_reset = self._is_reset, False
        if reset and was_in_play and seen.outcome[0] == Outcome.IN_PLAY:
            self.world.abort(0)  # after a cycle, so that the end has a moment of its own

    # Around the cycles.

    def _is_taken_in(self) -> bool:
        num_here = self.num_finished - self.settings.first_episode
        return not self._is_played() or all(
            self._statuses[player]["episodes"] >= self._first_counts[player] + num_here
            for player, seat in enumerate(self.roster.seats)
            if seat.present
        )

    def _record_statuses(self) -> None:
        """Record who plays, in match order."""
        stamp = self._messages.stamp_ns()
        for player, status in sorted(self._statuses.items()):
            topic = f"{self.roster.seats[player].name}/status"
            self._outlet.record_answer(topic, messages.AGENT_STATUS, status["data"], stamp)

    def _warn_rejected(self, player: int, error: KeepawayError) -> None:
        seen, name = self.world.belief, self.roster.seats[player].name
        self._report.warn(
            name, f"{name}, episode {seen.episode[0]} cycle {seen.cycle[0]}: rejected: {error}"
        )
