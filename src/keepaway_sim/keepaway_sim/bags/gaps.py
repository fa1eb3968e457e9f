"""Was everything recorded? Counts what a recording misses of what its match makes.

Perceptions and field states are stamped with simulated time and come once a cycle, so a step of
their stamps by more than one cycle names what is missing. A request is missed if a decision was
due and no answer came, an episode's end if it ended and no Episode message came. A match begins
at time 0: a recording that was joined to one that was running is counted from the first cycle in
which every topic was received, and its report says which.

A recorder feeds messages as they come; of a bag all are counted, in the order of the match.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from keepaway_sim.bags import checked
from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.moments import Moments, joined
from keepaway_sim.errors import one_line
from keepaway_sim.task import Outcome
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.messages import (
    ACTION_REQUEST,
    CYCLE_NS,
    EPISODE,
    FIELD_STATE,
    PERCEPTION,
    match_of,
    read_head,
)

_EVERY_CYCLE = (PERCEPTION, FIELD_STATE, ACTION_REQUEST)
_FORGET_AFTER = 1000  # [decisions] an answer that is so late does not come any more
_MOST_NAMED = 5  # episodes


@dataclass
class TopicCount:
    """What came on one topic."""

    received: int = 0
    missing: int = 0  # [cycles] between the first and the last that came
    repeated: int = 0  # came again
    first: int = -1  # [ns] simulated time
    last: int = -1
    ended: bool = False  # the last one had an episode's end

    def add(self, stamp: int, cycle: int, ended: bool, selected: bool) -> bool:
        """Count one more; whether it is a new one."""
        if self.received and (stamp, ended) == (self.last, self.ended):
            self.repeated += 1
            return False
        if not self.received:
            self.first = stamp
        elif stamp > self.last and not (selected and cycle == 0):
            self.missing += (stamp - self.last) // CYCLE_NS - 1
        self.received += 1
        self.last, self.ended = stamp, ended
        return True

    def add_all(self, stamps: np.ndarray, cycles: np.ndarray, selected: bool) -> None:
        """Count many that are new, in their order."""
        if not self.received:
            self.first = self.last = int(stamps[0])
        steps = np.diff(stamps, prepend=self.last) // CYCLE_NS - 1
        counted = (steps > 0) & ~(selected & (cycles == 0))
        self.missing += int(steps[counted].sum())
        self.received += len(stamps)
        self.last = int(stamps[-1])


@dataclass
class GapCounter:
    """Fed with every message of a recording in its order, knows what is missing.

    Attributes:
        selected: the recording has selected episodes only: an episode may begin at any time.
        topics: counts of the topics that come every cycle, by name.
        unanswered: by player index, decisions that were due and never answered.
        problems: of the recording's files, in words.
        repeated: messages that came again, besides those of `topics`.
        silent: topics of requests of which nothing came, where what was due is unknown.
        match_id: of the match that is counted; 0: none is known, and all messages are counted.
        strange: messages of other matches on the same topics, which are not counted.
    """

    selected: bool = False
    topics: dict[str, TopicCount] = field(default_factory=dict)
    unanswered: dict[int, int] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    repeated: int = 0
    silent: list[str] = field(default_factory=list)
    match_id: int = 0
    strange: int = 0
    _open: dict[int, dict[tuple[int, int], bool]] = field(default_factory=dict)
    _newest: tuple[int, int] = (-1, -1)  # episode and cycle of the last perception
    _begun: set[int] = field(default_factory=set)  # episodes of which something came
    _reported: set[int] = field(default_factory=set)  # episodes whose ends were published
    _ended: set[int] = field(default_factory=set)  # episodes whose last moment came

    def expect(self, topic: str) -> None:
        """A topic that comes every cycle, also if nothing ever comes on it."""
        self.topics.setdefault(topic, TopicCount())

    def feed(self, topic: str, message_type: str, data: bytes) -> None:
        """Count one message. Other types than those of episodes and cycles are passed over."""
        if self.match_id and match_of(message_type, data) not in (0, self.match_id):
            self.strange += 1
            return
        if message_type == EPISODE:
            self._reported.add(int(codec(EPISODE).decode(data)["number"]))
        if message_type not in _EVERY_CYCLE:
            return
        about = read_head(message_type, data)
        moment = about.episode, about.cycle
        if message_type == ACTION_REQUEST:
            self._pair(about.player_index, moment, False)
            return
        self._begun.add(about.episode)
        ended = about.outcome != Outcome.IN_PLAY
        if ended:
            self._ended.add(about.episode)
        self.expect(topic)
        is_new = self.topics[topic].add(about.time_ns, about.cycle, ended, self.selected)
        if is_new and about.decision_due:
            self._newest = moment
            self._pair(about.player_index, moment, True)

    def expect_match(self, match: Mapping[str, Any], namespace: str) -> None:
        """What comes every cycle of a match (a Match message's fields)."""
        for player in match["player_names"]:
            self.expect(f"{namespace}/{player}/perception")
        self.expect(f"{namespace}/field_state")

    def add(self, bag: MatchBag, moments: Moments) -> None:
        """Count all that was said in some moments of a bag's match, after those before."""
        self.repeated += moments.repeated
        self._add_topic(bag.topic("field_state"), moments.states)
        topics = bag.player_topics("perception")
        for player, seen in moments.perceptions.items():
            self._add_topic(topics[player], seen)
            self._add_decisions(player, seen, moments.requests.get(player, []))

    def tell_ends(self, bag: MatchBag) -> None:
        """Count the Episode messages of a bag's match, and those that came again."""
        self.repeated += bag.found.repeated
        self._reported |= {int(entry["number"]) for entry in bag.found.episodes}

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

    def missing_ends(self) -> list[int]:
        """Numbers of the episodes that ended and of whose end no Episode message came."""
        newest = max(self._begun, default=-1)
        over = self._ended | {number for number in self._begun if number < newest}
        return sorted(over - self._reported)

    def is_complete(self) -> bool:
        """Whether nothing is missing that the match must have made."""
        lost = any(self.missing().values()) or self.missing_ends() or self.problems or self.silent
        return bool(self.received) and not lost

    def report(self) -> str:
        """In words, naming what is missing, and what came again."""
        losses = self._losses()
        if not self.received:
            none = "no perception and no state was recorded"
            return one_line("; ".join([none, *self.problems]))
        parts = losses or [f"nothing is missing of {self.received} perceptions and states"]
        parts += self.problems
        again = self.repeated + sum(count.repeated for count in self.topics.values())
        if self.strange:
            parts = [*parts, f"{self.strange} messages are of another match"]
        if again:
            parts = [*parts, f"{again} messages came more than once, and count once"]
        joined_at = self.start() / 1e9
        report = one_line("; ".join(parts))
        return f"joined at {joined_at:.1f} s, since then {report}" if joined_at else report

    def _losses(self) -> list[str]:
        missing = {name: count for name, count in self.missing().items() if count}
        late = {player: count for player, count in self.unanswered_decisions().items() if count}
        ends = self.missing_ends()
        parts = [f"{name} misses {count} cycles" for name, count in missing.items()]
        parts += [f"{name} has nothing" for name in self.silent]
        parts += [f"player {player} left {count} decisions open" for player, count in late.items()]
        if ends:
            named = ", ".join(map(str, ends[:_MOST_NAMED])) + ", .." * (len(ends) > _MOST_NAMED)
            parts.append(f"{len(ends)} episodes miss their end ({named})")
        return parts

    def complete_until(self) -> int:
        """Simulated time [ns] that every topic that comes each cycle has reached; -1: none yet."""
        return min((count.last for count in self.topics.values()), default=-1)

    def _add_topic(self, topic: str, data: np.ndarray) -> None:
        self.expect(topic)
        if not len(data):
            return
        self.topics[topic].add_all(checked.stamps_of(data), data["cycle"], self.selected)
        self._begun |= set(np.unique(data["episode"]).tolist())
        ended = data["episode"][data["outcome"] != Outcome.IN_PLAY]
        self._ended |= set(ended.tolist())

    def _add_decisions(self, player: int, seen: np.ndarray, asked: list[np.ndarray]) -> None:
        """Count the decisions that were due; requests are of the same moments."""
        due = seen[seen["decision_due"]]
        episode, cycle = joined(asked, "episode", "cycle")
        answered = (episode.astype(np.int64) << 32) + cycle.astype(np.int64)
        wanted = (due["episode"].astype(np.int64) << 32) + due["cycle"]
        open_ = np.setdiff1d(wanted, answered)
        if len(seen):
            last = int(seen["episode"][-1]), int(seen["cycle"][-1])
            self._newest = max(self._newest, last)
        at = self._open.setdefault(player, {})
        self.unanswered[player] = self.unanswered.get(player, 0) + len(open_) + sum(at.values())
        at.clear()
        if len(open_):
            self.unanswered[player] -= 1
            newest = int(open_[-1])
            at[newest >> 32, newest & (2**32 - 1)] = True

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


def gap_counter(bag: MatchBag) -> GapCounter:
    """A counter of a bag's match that has counted no moment yet."""
    counter = GapCounter(selected=bag.reader.info.get("episodes") == "selected")
    counter.expect_match(bag.match, bag.namespace)
    counter.tell_ends(bag)
    counter.problems = list(bag.reader.problems)
    counter.strange = bag.found.strange
    counts = bag.found.counts
    for seen, asked in zip(*map(bag.player_topics, ("perception", "action_request")), strict=True):
        if not counts.get(seen) and not counts.get(asked):  # what was due is unknown
            counter.silent.append(asked)
    return counter


def count_gaps(bag: MatchBag) -> GapCounter:
    """What is missing in a bag's match.

    Raises:
        KeepawayError: messages that do not fit the match.
    """
    counter = gap_counter(bag)
    for moments in bag.moments():
        counter.add(bag, moments)
    return counter
