"""Signals that ask a program to end: it saves what is finished, and exits with their code.

Ctrl-C (SIGINT), `kill` (SIGTERM) and a closed terminal (SIGHUP) do the same: they raise `Stopped`
where the program is. A second one that follows soon, as when a terminal and a shell both send it,
changes nothing; nor does one while something is written that must be whole.
"""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Iterator
from types import FrameType
from typing import Any, Final, Self

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
GRACE: Final = 2.0
"""Seconds after a signal in which others are ignored: the program is ending."""


def restore_ctrl_c() -> None:
    """Let SIGINT end what this program starts: a shell lets its background jobs ignore it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


class Stopped(KeyboardInterrupt):
    """A signal asked the program to end.

    Attributes:
        code: with which the program ends, as shells expect it: 130 after SIGINT, 143 after SIGTERM.
    """

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.code = 128 + number


class Interruption:
    """Signals raise `Stopped` while a `with` of it lasts; for a program's main thread."""

    def __init__(self) -> None:
        self._before: dict[signal.Signals, Any] = {}
        self._since = -float("inf")  # [s] when the last signal came that counted
        self._is_shielded = False
        self._waiting: int | None = None  # a signal that came in the shield of `shield`

    def __enter__(self) -> Self:
        for each in SIGNALS:
            if signal.getsignal(each) is not signal.SIG_IGN:  # nohup stays nohup
                self._before[each] = signal.signal(each, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        for each, before in self._before.items():  # a program that is ending ignores all others
            signal.signal(each, before if self._since < 0 else signal.SIG_IGN)

    @contextlib.contextmanager
    def shield(self) -> Iterator[None]:
        """Let a signal wait until the block is done."""
        self._is_shielded = True
        try:
            yield
        finally:
            self._is_shielded = False
        if self._waiting is not None:
            raise Stopped(self._waiting)

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        now = time.monotonic()
        if now - self._since < GRACE:
            return
        self._since = now
        if self._is_shielded:
            self._waiting = number
        else:
            raise Stopped(number)
