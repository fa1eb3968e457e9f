"""Worker processes that may die at any moment: each has a pipe of its own, nothing is shared.

A process that is killed takes no lock with it that others wait for, and its pipe ends: the
reader knows at once. There is no shared memory or semaphore that could be left behind.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from typing import Any, Final

_CONTEXT: Final = multiprocessing.get_context("spawn")
_TERMINALS: Final = frozenset({signal.SIGINT, signal.SIGHUP})
"""What a terminal sends to all its processes; it is left to the one that started the others."""
END_TIMEOUT: Final = 5.0
"""Seconds that a process whose pipe has ended may take to end itself."""


class Worker:
    """A process that runs a function with one end of a pipe; `pipe` is the other end.

    It ends with the process that started it, however that ends.
    """

    def __init__(self, target: Callable[..., None], *arguments: Any) -> None:
        """Start it: `target(pipe, *arguments)`.

        Raises:
            OSError: no more processes can be started.
        """
        self.pipe, theirs = _CONTEXT.Pipe()
        self._process = _CONTEXT.Process(
            target=_run, args=(target, theirs, *arguments), daemon=True
        )
        with _blocked(_TERMINALS):  # a blocked signal stays blocked in the process
            self._process.start()
        theirs.close()

    @property
    def pid(self) -> int:
        """Its process's id."""
        assert self._process.pid is not None
        return self._process.pid

    def end(self) -> int:
        """Wait until it has ended, for END_TIMEOUT; its exit code, or minus the signal's number."""
        self._process.join(END_TIMEOUT)
        self._process.kill()
        self._process.join()
        self.pipe.close()
        return self._process.exitcode or 0

    def kill(self) -> None:
        """Let it end now, whatever it does; `end` waits for that."""
        self._process.kill()


def how_it_ended(code: int) -> str:
    """A worker's exit code in words.

    >>> how_it_ended(-9)
    'was ended by SIGKILL (out of memory?)'
    """
    if code >= 0:
        return f"ended with code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f"was ended by {name}" + (" (out of memory?)" if code == -signal.SIGKILL else "")


def _run(target: Callable[..., None], pipe: Connection, *arguments: Any) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with contextlib.suppress(BrokenPipeError):  # the other end has closed
        target(pipe, *arguments)


def _end_with_parent() -> None:
    if (parent := multiprocessing.parent_process()) is not None:
        parent.join()
        os._exit(1)


@contextlib.contextmanager
def _blocked(signals: frozenset[signal.Signals]) -> Iterator[None]:
    """Block signals of this thread; those that come meanwhile come later."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
