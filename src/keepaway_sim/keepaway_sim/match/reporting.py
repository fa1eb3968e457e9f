"""What a match reports in words: each thing once, or no more often than it can be read. No ROS."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

from keepaway_sim.errors import LOG_PERIOD

LONG_WAIT = 60.0  # [s] a wait for players is a warning only then


class Log(Protocol):
    """What a match reports in words: a ROS logger, or one of Python's."""

    def info(self, message: str) -> Any:
        """What a person may want to know."""

    def warning(self, message: str) -> Any:
        """What went wrong without harm."""

    def error(self, message: str) -> Any:
        """What went wrong."""


class Reporter:
    """Reports to a log; what may repeat every cycle, at most every `LOG_PERIOD`."""

    def __init__(self, log: Log, clock: Callable[[], float]) -> None:
        """Nothing is reported yet; `clock` is the wall's [s]."""
        self._log, self._clock = log, clock
        self._reported_at: dict[str, float] = {}  # [s] by subject

    def info(self, text: str) -> None:
        """Report what a person may want to know."""
        self._log.info(text)

    def error(self, text: str) -> None:
        """Report what went wrong."""
        self._log.error(text)

    def warn(self, subject: str, text: str) -> None:
        """Warn, of one subject at most every `LOG_PERIOD`."""
        if self._is_due(subject, LOG_PERIOD):
            self._log.warning(text)

    def waiting(self, text: str) -> None:
        """Report a wait every `LOG_PERIOD`, not at once; after `LONG_WAIT` as a warning."""
        now = self._clock()
        for subject in ("waiting", "waiting long"):
            self._reported_at.setdefault(subject, now)
        if self._is_due("waiting long", LONG_WAIT):
            self._log.warning(text)
        elif self._is_due("waiting", LOG_PERIOD):
            self._log.info(text)

    def _is_due(self, subject: str, period: float) -> bool:
        """Whether a subject was last reported that long ago [s]; if so, it is reported now."""
        now = self._clock()
        is_due = now - self._reported_at.get(subject, -math.inf) >= period
        if is_due:
            self._reported_at[subject] = now
        return is_due
