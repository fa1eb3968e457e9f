"""A node that counts a match's episodes and shows how it goes."""

from __future__ import annotations

import sys
import time
from typing import Any, TextIO

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from keepaway_msgs.msg import Episode
from keepaway_sim.nodes.voice import ALL, QUEUE
from keepaway_sim.scores import Score, summary
from keepaway_sim.task import Outcome

TERMINAL_PERIOD, FILE_PERIOD = 0.5, 10.0
"""[s] between two reports."""
RECENT = 20
"""Episodes of the mean that is shown."""


class Scoreboard(Node):
    """Listens to `episode` and `diagnostics` of one match.

    Attributes:
        scores: of the episodes by number.
        state: of the match, in the simulator's words.
        figures: the simulator's, by name.
        troubles: by player, how many answers were late, missed and rejected.
    """

    def __init__(self, num_wanted: int = 0, out: TextIO = sys.stderr, **node_options: Any) -> None:
        """Nothing heard yet; `num_wanted` is how many episodes are to be played, 0 if unknown."""
        super().__init__("scoreboard", **node_options)
        self.scores: dict[int, Score] = {}
        self.state = "no simulator was heard"
        self.figures: dict[str, str] = {}
        self.troubles: dict[str, dict[str, int]] = {}
        self._num_wanted, self._out = num_wanted, out
        self._show_at = 0.0
        self.create_subscription(Episode, "episode", self._on_episode, ALL)
        self.create_subscription(DiagnosticArray, "diagnostics", self._on_health, QUEUE)

    @property
    def has_begun(self) -> bool:
        """Has there been a kick-off?"""
        return bool(self.scores) or self.state == "plays"

    def summary(self) -> dict[str, Any]:
        """The match in numbers."""
        rate = self.figures.get("mean_cycles_per_second")
        return {
            **summary([score for _, score in sorted(self.scores.items())]),
            "cycles_per_second": float(rate) if rate else None,
            "troubles": {
                name: counts for name, counts in self.troubles.items() if any(counts.values())
            },
        }

    def show(self) -> None:
        """Report, if it is time to."""
        now = time.monotonic()
        if now < self._show_at or not self.scores:
            return
        is_terminal = self._out.isatty()
        self._show_at = now + (TERMINAL_PERIOD if is_terminal else FILE_PERIOD)
        self._out.write(f"\r\x1b[K{self._line()}" if is_terminal else f"{self._line()}\n")
        self._out.flush()

    def conclude(self) -> None:
        """Make the last report, and end its line."""
        self._show_at = 0.0
        self.show()
        if self._out.isatty():
            self._out.write("\n")

    def _line(self) -> str:
        recent = summary([self.scores[number] for number in sorted(self.scores)[-RECENT:]])
        mean = recent["mean_duration_s"]
        of = f"/{self._num_wanted}" if self._num_wanted else ""
        held = f", last {recent['episodes']} held {mean:.2f} s" if mean is not None else ""
        return (
            f"{len(self.scores)}{of} episodes{held},"
            f" {self.figures.get('cycles_per_second', '?')} cycles/s, {self.state}"
        )

    def _on_episode(self, message: Episode) -> None:
        self.scores[message.number] = Score(message.duration, Outcome(message.outcome))

    def _on_health(self, message: DiagnosticArray) -> None:
        prefix = self.get_namespace().rstrip("/") + "/"
        for status in message.status:
            if not status.name.startswith(prefix):
                continue
            values = {entry.key: entry.value for entry in status.values}
            name = status.name.removeprefix(prefix)
            if name == "simulator":
                self.state, self.figures = status.message, values
            else:
                self.troubles[name] = {key: int(value) for key, value in values.items()}
