"""Random numbers for compiled loops: one buffered stream of uniforms per numpy Generator.

Compiled code reads ready-made uniforms from an array, so every number still comes from a passed
`numpy.random.Generator`, and a stream gives the same numbers whichever run beside it: block
sizes do not matter, because `Generator.random(n)` is n times `Generator.random()`.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import numpy as np

from keepaway_sim.errors import KeepawayError
from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.passing import record


@record
class Draws(NamedTuple):
    """Ready-made random numbers, as compiled functions take them."""

    uniforms: np.ndarray  # (num_streams, block) in [0, 1)
    cursor: np.ndarray  # (num_streams,) int64, the next unread one of each stream


class StreamSnapshot(NamedTuple):
    """Where a stream stands: what it gives from there on is fixed by it."""

    generator: np.random.Generator | None  # a copy; None where the stream was never seeded
    unread: np.ndarray  # uniforms drawn from it and not read yet


class RandomStreams:
    """`num_streams` independent streams of uniforms in [0, 1).

    Attributes:
        draws: the ready-made numbers (`Draws`).
        latest: the last cursor at which a stream gives `reserve` numbers.
    """

    def __init__(self, num_streams: int, reserve: int, block: int = 2048) -> None:
        """Make room for streams.

        Args:
            num_streams: how many.
            reserve: the most numbers that may be read between two calls of `refill`.
            block: numbers kept ready per stream.
        """
        if reserve > block:
            raise KeepawayError(f"reserve={reserve} is more than block={block}")
        self.draws = Draws(
            np.zeros((num_streams, block)), np.full(num_streams, block, dtype=np.int64)
        )
        self._interval = max(1, block // (4 * reserve))  # calls of `refill` between two looks
        self._lowest = reserve * self._interval  # numbers that last until the next look
        self._calls_left = 0
        self.latest = block - reserve
        self._generators: list[np.random.Generator | None] = [None] * num_streams

    def seed(self, stream: int, generator: np.random.Generator) -> None:
        """Let a stream read from `generator` from now on."""
        self._generators[stream] = generator
        generator.random(out=self.draws.uniforms[stream])
        self.draws.cursor[stream] = 0

    def refill(self) -> None:
        """Make sure that every seeded stream can give `reserve` more numbers."""
        if self._calls_left > 0:
            self._calls_left -= 1
        else:
            self._calls_left = self._interval - 1
            self.top_up()

    def top_up(self) -> None:
        """Do what `refill` does now and then, for who looks at the cursors himself."""
        low = self.draws.cursor > self.draws.uniforms.shape[1] - self._lowest
        if not low.any():
            return
        for stream in np.flatnonzero(low):
            generator = self._generators[stream]
            if generator is None:
                continue
            row, start = self.draws.uniforms[stream], self.draws.cursor[stream]
            left = len(row) - start
            row[:left] = row[start:].copy()
            generator.random(out=row[left:])
            self.draws.cursor[stream] = 0

    def snapshot(self, stream: int) -> StreamSnapshot:
        """Take down where a stream stands."""
        unread = self.draws.uniforms[stream, self.draws.cursor[stream] :].copy()
        return StreamSnapshot(copy.deepcopy(self._generators[stream]), unread)

    def restore(self, stream: int, snapshot: StreamSnapshot) -> None:
        """Let a stream give what it gave after `snapshot` was taken, here or elsewhere."""
        generator = copy.deepcopy(snapshot.generator)
        row, num_unread = self.draws.uniforms[stream], len(snapshot.unread)
        if num_unread > len(row):
            raise KeepawayError(f"a snapshot of {num_unread} numbers: there is room for {len(row)}")
        self._generators[stream] = generator
        start = len(row) - num_unread
        row[start:] = snapshot.unread
        self.draws.cursor[stream] = start
        self._calls_left = 0  # it may stand at its last number


@compiled
def draw(draws, stream):
    """The next uniform of a stream of `Draws`."""
    value = draws.uniforms[stream, draws.cursor[stream]]
    draws.cursor[stream] += 1
    return value
