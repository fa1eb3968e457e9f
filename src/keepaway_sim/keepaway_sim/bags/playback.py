"""When which message of a bag is due again: rate, pause, step, loop. No ROS, no own clock.

Time in a bag is simulated; `now` is any clock's time [s] that the caller keeps passing in.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator

from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.timeline import Timeline
from keepaway_sim.bags.topics import Recorded, Topic
from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire import cdr
from keepaway_sim.wire.definitions import type_hash
from keepaway_sim.wire.messages import SECOND


class Playback:
    """A bag being played.

    Attributes:
        rate: simulated over real time; 0 plays as fast as it is asked.
        paused: nothing is due until it is resumed, but steps.
        time: of what was due last, simulated [ns].
        finished: nothing is left.
    """

    def __init__(
        self,
        timeline: Timeline,
        rate: float = 1.0,
        start: int | None = None,
        end: int | None = None,
        topics: Collection[str] | None = None,
        loop: bool = False,
    ) -> None:
        """Be ready to play start <= time < end [ns] of some topics, or of all.

        Raises:
            KeepawayError: a rate that is none, a topic that the bag has not, or nothing to play.
        """
        unknown = set(topics or ()) - timeline.topics.keys()
        if unknown:
            raise KeepawayError(
                f"{', '.join(sorted(unknown))}: the bag has {', '.join(timeline.topics)}"
            )
        self._timeline, self._topics = timeline, topics
        self._latched = {
            topic.name
            for topic in timeline.topics.values()
            if topic.qos.transient_local and (topics is None or topic.name in topics)
        }
        self._start, self._end = start, end
        self.loop, self.paused, self.finished = loop, False, False
        self._steps = 0
        self._origin: float | None = None  # [s] now, when `_origin_time` was due
        self._begin()
        self.time = self._pending[0].log_time if self._pending else 0
        if self.finished:
            raise KeepawayError(f"{timeline.reader.path}: nothing was recorded in that time")
        self.rate = rate

    @property
    def rate(self) -> float:
        """Simulated over real time; 0 plays as fast as it is asked."""
        return self._rate

    @rate.setter
    def rate(self, rate: float) -> None:
        if not 0 <= rate < math.inf:
            raise KeepawayError(f"rate={rate}: give 0 (as fast as possible) or more")
        self._rate = rate
        self._origin = None

    def prologue(self) -> list[Recorded]:
        """What is to be said before anything is due: what listeners must know to follow.

        That is the last message of each latched topic before the start, and the latched messages
        that the rest begins with; those are not played again.
        """
        said: dict[str, Recorded] = {}
        if self._start is not None:
            for message in self._timeline.messages(self._latched, end=self._start):
                said[message.topic] = message
        return [*said.values(), *self._opening]

    def pause(self) -> None:
        """Stop here."""
        self.paused = True

    def resume(self) -> None:
        """Go on from here."""
        self.paused, self._origin = False, None

    def step(self) -> None:
        """Let the next moment be due, although it is paused."""
        self.paused = True
        self._steps += 1

    def wait(self, now: float) -> float:
        """How long nothing will be due [s]; infinite while paused."""
        if self.finished or (self.paused and not self._steps):
            return math.inf
        if self.paused or not self._rate:
            return 0.0
        return max(0.0, self._due_at(now) - now)

    def due(self, now: float) -> list[Recorded]:
        """The messages of the next moment if they are due now, in the order of their recording."""
        if self.wait(now) > 0:
            return []
        self._steps = max(0, self._steps - 1)
        if self.paused:
            self._origin = None
        moment = self._pending
        self.time = moment[-1].log_time
        self._read_moment()
        if self.finished and self.loop:
            self._begin()
            self._origin = None
        return moment

    def _due_at(self, now: float) -> float:
        time = self._pending[0].log_time
        if self._origin is None:
            self._origin, self._origin_time = now, time
        return self._origin + (time - self._origin_time) / (SECOND * self._rate)

    def _begin(self) -> None:
        self.finished = False
        self._messages: Iterator[Recorded] = self._timeline.messages(
            self._topics, self._start, self._end
        )
        self._opening: list[Recorded] = []
        self._next = next(self._messages, None)
        while self._next and self._next.topic in self._latched:
            self._opening.append(self._next)
            self._next = next(self._messages, None)
        self._read_moment()

    def _read_moment(self) -> None:
        """Put the next messages of one time into `_pending`."""
        self._pending: list[Recorded] = []
        self.finished = self._next is None
        while self._next and (
            not self._pending or self._next.log_time <= self._pending[0].log_time
        ):
            self._pending.append(self._next)
            self._next = next(self._messages, None)


def episode_times(bag: MatchBag, first: int, last: int) -> tuple[int, int]:
    """From when until when episodes first..last were played [ns], the end excluded.

    Raises:
        KeepawayError: the bag has not all of them.
    """
    episodes = list(bag.episodes())
    wanted = [episode for episode in episodes if first <= episode.number <= last]
    if not wanted or wanted[0].number != first or wanted[-1].number != last:
        known = f"{episodes[0].number}..{episodes[-1].number}" if episodes else "none"
        raise KeepawayError(f"episodes {first}..{last}: {bag.reader.path} has {known}")
    return wanted[0].start, wanted[-1].end + 1


def difference_from_installed(topic: Topic) -> str:
    """How a recorded topic's type differs from the installed one; empty where it does not.

    Raises:
        KeepawayError: its type is not installed, or it is not ROS 2's.
    """
    if not topic.is_ros:
        raise KeepawayError(f"its messages are not ROS 2's ({topic.schema_encoding or 'no type'})")
    installed = cdr.codec(topic.message_type)
    hash_ = type_hash(topic.message_type)
    try:
        recorded = cdr.Codec(topic.message_type, topic.definition)
    except (ValueError, RecursionError):
        return f"its definition of {topic.message_type} cannot be read"
    if topic.type_hash not in ("", hash_) or not recorded.is_laid_out_like(installed):
        return f"it was recorded with another {topic.message_type} than the installed one"
    return ""
