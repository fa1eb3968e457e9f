"""Progress for people, on standard error: a bar on a terminal, elsewhere a line now and then."""

import shutil
import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

from tqdm import tqdm

WITHOUT_ESTIMATE = "{percentage:3.0f}%|{bar}| {n_fmt}/{total_fmt}{unit} [{elapsed}{postfix}]"
PERIOD = 10.0
"""Wall time between two lines, where the output is no terminal [s]."""


class ProgressBar:
    """How much is done of something that takes long. Use it in a `with`."""

    def __init__(
        self,
        name: str,
        total: int,
        unit: str,
        *,
        done: int = 0,
        period: float = PERIOD,
        estimates: bool = True,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Show the beginning.

        Args:
            name: of the program; lines begin with it.
            total: how much there is to do.
            unit: of `total`, behind a number: "episodes".
            done: before.
            period: between two lines [s]; 0 writes one each time.
            estimates: the time left from the time so far; the text may know better.
            clock: tells the time [s].
        """
        self._name, self._unit, self._period, self._clock = name, unit, period, clock
        self._total, self._begun_with, self._estimates = total, done, estimates
        self._begun_at = self._written_at = clock()
        width, height = shutil.get_terminal_size()  # tqdm shows nothing where a terminal tells none
        self._bar: tqdm[Any] = tqdm(
            total=total, initial=done, unit=f" {unit}", disable=None, smoothing=0.05,
            ncols=width, nrows=height, bar_format=None if estimates else WITHOUT_ESTIMATE,
        )  # fmt: skip

    def show(self, done: int, text: str) -> None:
        """Show that so much is done, and what else is to be said."""
        self._bar.set_postfix_str(text, refresh=False)
        self._bar.update(done - self._bar.n)
        if self._bar.disable and self._clock() - self._written_at >= self._period:
            self._written_at = self._clock()
            line = f"{self._name}: {done:,}/{self._total:,} {self._unit}, {text}{self._left(done)}"
            sys.stderr.write(line + "\n")

    def _left(self, done: int) -> str:
        """The time left, by the pace so far."""
        made = done - self._begun_with
        if not self._estimates or made <= 0:
            return ""
        seconds = (self._clock() - self._begun_at) * (self._total - done) / made
        return f", {tqdm.format_interval(seconds)} left"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self._bar.close()
