"""A node that counts a match's episodes and shows how it goes."""

from __future__ import annotations

import re
import sys
import time
from typing import Any, TextIO

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from tqdm import tqdm

from keepaway_msgs.msg import Episode, Match
from keepaway_sim.errors import LOG_PERIOD, one_line
from keepaway_sim.match.scores import Score, summary
from keepaway_sim.ros.publishing import ALL, MATCHES, QUEUE
from keepaway_sim.task import Outcome

TERMINAL_PERIOD, FILE_PERIOD = 0.5, 10.0
"""[s] between two reports."""
RECENT = 20
"""Episodes of the mean that is shown."""
_COUNT = re.compile(r"[0-9]{1,18}")


def score(episode: Episode) -> Score:
    """What counts of an episode."""
    return Score(episode.duration, Outcome(episode.outcome))


class Scoreboard(Node):
    """Subscribes to `episode` and `diagnostics` of one match; those of others do not count.

    Attributes:
        match_id: of the match whose episodes count; 0 until one is known.
        num_ignored: messages of other matches.
        episodes: that have ended, by number.
        state: of the match, in the simulator's words.
        figures: the simulator's, by name.
        troubles: by player, how many answers were late, missed and rejected.
    """

    def __init__(
        self,
        num_wanted: int = 0,
        match_id: int = 0,
        out: TextIO = sys.stderr,
        **node_options: Any,
    ) -> None:
        """Count nothing yet.

        Args:
            num_wanted: episodes that are to be played; 0 if unknown.
            match_id: of the match; 0: of the first one that is published here.
            out: where to report.
            node_options: for `rclpy.node.Node`.
        """
        super().__init__("scoreboard", **node_options)
        self.match_id, self.num_ignored = match_id, 0
        self.episodes: dict[int, Episode] = {}
        self.state = "no simulator was found"
        self.figures: dict[str, str] = {}
        self.troubles: dict[str, dict[str, int]] = {}
        self._num_wanted, self._out = num_wanted, out
        self._show_at = 0.0
        self._bar: tqdm[Any] | None = None
        self.create_subscription(Match, "match", self._on_match, MATCHES)
        self.create_subscription(Episode, "episode", self._on_episode, ALL)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, QUEUE)

    @property
    def has_begun(self) -> bool:
        """Has there been a kick-off?"""
        return bool(self.episodes) or self.state.startswith("plays")

    @property
    def next_episode(self) -> int:
        """The number after the last that has ended."""
        return max(self.episodes, default=-1) + 1

    def summary(self) -> dict[str, Any]:
        """The match in numbers, and every episode's cycles and outcome in order."""
        episodes = [episode for _, episode in sorted(self.episodes.items())]
        rate = self.figures.get("mean_cycles_per_second")
        return {
            **summary(list(map(score, episodes))),
            "cycles_per_second": float(rate) if rate else None,
            "troubles": {name: each for name, each in self.troubles.items() if any(each.values())},
            "episode_cycles": [episode.cycles for episode in episodes],
            "episode_outcomes": [episode.outcome for episode in episodes],
        }

    def show(self) -> None:
        """Report, if it is time to."""
        now = time.monotonic()
        if now < self._show_at or not self.episodes:
            return
        if self._bar is None:  # a bar without a total has no truth value
            self._bar = self._opened_bar()
        bar = self._bar
        bar.set_postfix_str(self._words(), refresh=False)
        bar.update(len(self.episodes) - bar.n)
        if bar.disable:  # the output is no terminal
            plural = "s" if len(self.episodes) > 1 else ""
            self._out.write(f"{len(self.episodes)} episode{plural}, {self._words()}\n")
            self._out.flush()
        else:
            bar.refresh()
        self._show_at = now + (FILE_PERIOD if bar.disable else TERMINAL_PERIOD)

    def conclude(self) -> None:
        """Make the last report."""
        self._show_at = 0.0
        self.show()
        if self._bar is not None:
            self._bar.close()

    def _opened_bar(self) -> tqdm[Any]:
        return tqdm(total=self._num_wanted or None, unit=" episodes", disable=None, file=self._out)

    def _words(self) -> str:
        recent = summary(
            [score(self.episodes[number]) for number in sorted(self.episodes)[-RECENT:]]
        )
        mean = recent["mean_duration_s"]
        held = f"last {recent['episodes']} held {mean:.2f} s, " if mean is not None else ""
        rate = self.figures.get("cycles_per_second", "0")
        pace = f"{rate} cycles/s, " if rate != "0" else ""  # at first it is not known yet
        return f"{held}{pace}{self.state}"

    def _on_match(self, message: Match) -> None:
        self._is_own(message.match_id, f"a simulator of {one_line(message.task)} publishes `match`")

    def _on_episode(self, message: Episode) -> None:
        if self._is_own(message.match_id, "`episode` is published"):
            self.episodes.setdefault(message.number, message)

    def _is_own(self, match_id: int, what: str) -> bool:
        """Whether a message is of the own match; if not, warn now and then."""
        self.match_id = self.match_id or match_id
        if match_id == self.match_id:
            return True
        self.num_ignored += 1
        self.get_logger().warning(
            f"{what} in match {match_id}, too: not counted, this is match {self.match_id}",
            throttle_duration_sec=LOG_PERIOD,
        )
        return False

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        prefix = self.get_namespace().rstrip("/") + "/"
        for status in message.status:
            if not status.name.startswith(prefix) or status.hardware_id != str(self.match_id):
                continue
            values = {entry.key: one_line(entry.value) for entry in status.values}
            name = status.name.removeprefix(prefix)
            if name == "simulator":
                self.state, self.figures = one_line(status.message), values
            else:
                counts = {key: value for key, value in values.items() if _COUNT.fullmatch(value)}
                self.troubles[name] = {key: int(value) for key, value in counts.items()}
