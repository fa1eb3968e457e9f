"""A bag's messages at their own times: simulated, also where log times are the wall's.

`ros2 bag record` stamps what it receives with the wall's time. What a match says has its own
time: a stamp, or the moment that it answers; everything else happened when the last of those did.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator

from keepaway_sim.bags.matches import Found, find_matches
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.topics import Recorded, Topic
from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire.messages import (
    ACTION_REQUEST,
    CLOCK,
    CYCLE_NS,
    EPISODE,
    FIELD_STATE,
    PERCEPTION,
    read_head,
    stamp_of,
)

_REMEMBERED_EPISODES = 4  # whose kick-off is known when a request of theirs comes
_STAMPED = (PERCEPTION, FIELD_STATE, EPISODE, CLOCK)


class OwnTimes:
    """Finds when each message of a match was published, simulated [ns], as they come."""

    def __init__(self) -> None:
        """Nothing was said yet."""
        self._last = 0
        self._kick_offs: dict[int, int] = {}  # [ns] by episode

    def of(self, message_type: str, data: bytes) -> int:
        """By its stamp, or the moment that it answers, or the last time that is known.

        Raises:
            KeepawayError: too few bytes for its type.
        """
        try:
            own = stamp_of(message_type, data)
            if own is not None:
                self._last = own
                if message_type == PERCEPTION:
                    self._remember(*read_head(PERCEPTION, data)[:2], own)
                return own
            if message_type == ACTION_REQUEST:
                return self._answered(*read_head(ACTION_REQUEST, data)[:2])
        except struct.error as error:
            raise KeepawayError(f"{len(data)} bytes are no {message_type}: {error}") from error
        return self._last

    def _remember(self, episode: int, cycle: int, time_ns: int) -> None:
        self._kick_offs[episode] = time_ns - cycle * CYCLE_NS
        if len(self._kick_offs) > _REMEMBERED_EPISODES:
            del self._kick_offs[next(iter(self._kick_offs))]

    def _answered(self, episode: int, cycle: int) -> int:
        """When the cycle was that a request answers, even if its perception comes later."""
        if episode not in self._kick_offs:
            return self._last
        return self._kick_offs[episode] + cycle * CYCLE_NS


class Timeline:
    """The messages of one match of a bag and of what was recorded with it, at their own times.

    Attributes:
        reader: the bag.
        topics: by name, without those of the bag's other matches.
        found: the match; None: the bag has none, and log times count.
    """

    def __init__(self, reader: BagReader, found: Found | None, others: Collection[Found]) -> None:
        """Choose the match's messages.

        Args:
            reader: the bag.
            found: the match.
            others: the bag's other matches.
        """
        self.reader, self.found = reader, found
        names = {match.namespace for match in others} - {found.namespace if found else None}
        self.topics: dict[str, Topic] = {
            name: topic
            for name, topic in reader.topics.items()
            if not any(other and name.startswith(f"{other}/") for other in names)
            and not (found and "" in names and not name.startswith(f"{found.namespace}/"))
        }
        self._shares_topics = (
            any(match.topic == found.topic for match in others) if found else False
        )

    @classmethod
    def of_bag(cls, reader: BagReader, number: int | None = None) -> Timeline:
        """Of a bag's only match, or of the one with a number, from 1 on.

        Raises:
            KeepawayError: there are several, and none or one that is not there was chosen.
        """
        matches = find_matches(reader)
        if not matches:
            return cls(reader, None, ())
        found = chosen_match(matches, number, reader)
        return cls(reader, found, [match for match in matches if match is not found])

    def messages(
        self,
        topics: Collection[str] | None = None,
        start: int | None = None,
        end: int | None = None,
    ) -> Iterator[Recorded]:
        """The messages of these topics (or of all) with start <= own time < end [ns].

        Raises:
            KeepawayError: a damaged chunk, or bytes that are not what their topic carries.
        """
        wanted = self.topics.keys() if topics is None else self.topics.keys() & set(topics)
        chosen = self.found.own if self.found and self._shares_topics else None
        if self.found is None or self.found.simulated:
            yield from self.reader.messages(wanted, start, end, chosen)
            return
        times, own = OwnTimes(), self._stamped()
        for message in self.reader.messages(wanted | own, chosen=chosen):
            is_own = message.topic in own or message.message_type == ACTION_REQUEST
            time = times.of(message.message_type if is_own else "", message.data)
            if message.topic not in wanted or (start is not None and time < start):
                continue
            if end is None or time < end:
                yield message._replace(log_time=time)

    def _stamped(self) -> set[str]:
        """The match's topics whose messages have stamps."""
        assert self.found
        return {
            topic.name
            for topic in self.topics.values()
            if topic.message_type in _STAMPED and topic.is_ros
        }


def chosen_match(matches: list[Found], number: int | None, reader: BagReader) -> Found:
    """The match that is meant.

    Raises:
        KeepawayError: there are several and none was chosen, or fewer than the chosen number.
    """
    if not number and len(matches) == 1:
        return matches[0]
    listed = "; ".join(f"{n}: {_about(match)}" for n, match in enumerate(matches[:20], start=1))
    if not number:
        raise KeepawayError(
            f"{reader.path} has {len(matches)} matches, choose one (--match 1): {listed}"
        )
    if not 1 <= number <= len(matches):
        raise KeepawayError(f"match {number}: {reader.path} has {listed}")
    return matches[number - 1]


def _about(match: Found) -> str:
    values, count = match.values, len(match.episodes)
    return f"{match.topic} {match.task.name}, seed {values['seed']}, {count} episodes"
