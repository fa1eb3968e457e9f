"""Was everything recorded? Counts, by topic, the cycles that a recording misses.

Perceptions and field states are stamped with simulated time and come once a cycle, so a step of
their stamps by more than one cycle names what is missing. A request is missed if a decision was
due and nobody answered. A match begins at time 0: a recording that was joined to one that was on
is counted from the first cycle in which every topic was heard, and its report says which.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from keepaway_sim.bags.reader import BagReader
from keepaway_sim.wire.messages import (
    ACTION_REQUEST,
    CYCLE_NS,
    FIELD_STATE,
    PERCEPTION,
    read_saying,
)

_EVERY_CYCLE = (PERCEPTION, FIELD_STATE, ACTION_REQUEST)
_FORGET_AFTER = 1000  # [decisions] an answer that is so late does not come any more


@dataclass
class TopicCount:
    """What came on one topic."""

    received: int = 0
    missing: int = 0  # [cycles] between the first and the last that came
    repeated: int = 0  # sent again
    first: int = -1  # [ns] simulated time
    last: int = -1


@dataclass
class GapCounter:
    """Fed with every message of a recording in its order, knows what is missing.

    Attributes:
        selected: the recording has selected episodes only: an episode may begin at any time.
        topics: counts of the topics that come every cycle, by name.
        unanswered: by player index, decisions that were due and never answered.
    """

    selected: bool = False
    topics: dict[str, TopicCount] = field(default_factory=dict)
    unanswered: dict[int, int] = field(default_factory=dict)
    _open: dict[int, dict[tuple[int, int], bool]] = field(default_factory=dict)
    _newest: tuple[int, int] = (-1, -1)  # episode and cycle of the last perception

    def expect(self, topic: str) -> None:
        """A topic that comes every cycle, also if nothing ever comes on it."""
        self.topics.setdefault(topic, TopicCount())

    def feed(self, topic: str, message_type: str, data: bytes) -> None:
        """Count one message. Other types than the three that come every cycle are passed over."""
        if message_type not in _EVERY_CYCLE:
            return
        about = read_saying(message_type, data)
        moment = about.episode, about.cycle
        if message_type == ACTION_REQUEST:
            self._pair(about.player_index, moment, False)
        elif self._count(topic, about.time_ns, about.cycle) and about.decision_due:
            self._newest = moment
            self._pair(about.player_index, moment, True)

    @property
    def received(self) -> int:
        """Perceptions and field states that came."""
        return sum(count.received for count in self.topics.values())

    def start(self) -> int:
        """Simulated time [ns] from which on every cycle is expected of every topic."""
        first = [count.first for count in self.topics.values() if count.received]
        return max(first) if min(first, default=0) > 0 else 0

    def missing(self) -> dict[str, int]:
        """Cycles missing by topic, those before its first and after its last message included."""
        seen = [count for count in self.topics.values() if count.received]
        start = self.start()
        end = max((count.last for count in seen), default=0)
        whole = (end - start) // CYCLE_NS + 1 if seen else 0
        return {
            name: count.missing + (max(0, count.first - start) + end - count.last) // CYCLE_NS
            if count.received
            else whole
            for name, count in self.topics.items()
        }

    def unanswered_decisions(self) -> dict[int, int]:
        """Decisions without an answer by player, those of the last cycle left out."""
        return {
            player: self.unanswered.get(player, 0)
            + sum(due and key != self._newest for key, due in keys.items())
            for player, keys in sorted(self._open.items())
        }

    def report(self) -> str:
        """In words, naming the topics that miss something."""
        missing = {name: count for name, count in self.missing().items() if count}
        late = {player: count for player, count in self.unanswered_decisions().items() if count}
        if not self.received:
            return "no perception and no state was heard"
        parts = [f"{name} misses {count} cycles" for name, count in missing.items()]
        parts += [f"player {player} left {count} decisions open" for player, count in late.items()]
        report = "; ".join(parts) or f"nothing is missing of {self.received} perceptions and states"
        joined = self.start() / 1e9
        return f"joined at {joined:.1f} s, since then {report}" if joined else report

    def complete_until(self) -> int:
        """Simulated time [ns] that every topic that comes each cycle has reached; -1: none yet."""
        return min((count.last for count in self.topics.values()), default=-1)

    def _count(self, topic: str, stamp: int, cycle: int) -> bool:
        """Whether the message is a new one."""
        self.expect(topic)
        count = self.topics[topic]
        if count.received and stamp == count.last:
            count.repeated += 1
            return False
        if not count.received:
            count.first = stamp
        elif stamp > count.last and not (self.selected and cycle == 0):
            count.missing += (stamp - count.last) // CYCLE_NS - 1
        count.received += 1
        count.last = stamp
        return True

    def _pair(self, player: int, key: tuple[int, int], due: bool) -> None:
        """Let decisions and answers find each other, whichever comes first."""
        keys = self._open.setdefault(player, {})
        if keys.get(key, due) != due:
            del keys[key]
            return
        keys[key] = due
        if len(keys) > _FORGET_AFTER:
            oldest = next(iter(keys))
            self.unanswered[player] = self.unanswered.get(player, 0) + keys.pop(oldest)


def count_gaps(reader: BagReader) -> GapCounter:
    """What is missing in a bag."""
    counter = GapCounter(selected=reader.info.get("episodes") == "selected")
    for message in reader.messages():
        counter.feed(message.topic, message.message_type, message.data)
    return counter
