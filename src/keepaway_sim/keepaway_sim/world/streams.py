"""Random numbers for compiled loops: one buffered stream of uniforms per numpy Generator.

Compiled code reads ready-made uniforms from an array, so every number still comes from a passed
`numpy.random.Generator`, and a stream gives the same numbers whoever runs beside it: block
sizes do not matter, because `Generator.random(n)` is n times `Generator.random()`.
"""

from __future__ import annotations

import numpy as np

from keepaway_sim.errors import KeepawayError
from keepaway_sim.world.compiled import compiled


class RandomStreams:
    """`num_streams` independent streams of uniforms in [0, 1).

    Attributes:
        uniforms: (num_streams, block) float64, ready-made numbers.
        cursor: (num_streams,) int64, the next unread one of each stream.
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
        self.uniforms = np.empty((num_streams, block))
        self.cursor = np.full(num_streams, block, dtype=np.int64)
        self._reserve = reserve
        self._generators: list[np.random.Generator | None] = [None] * num_streams

    def seed(self, stream: int, generator: np.random.Generator) -> None:
        """Let a stream read from `generator` from now on."""
        self._generators[stream] = generator
        generator.random(out=self.uniforms[stream])
        self.cursor[stream] = 0

    def refill(self) -> None:
        """Make sure that every seeded stream can give `reserve` more numbers."""
        low = self.cursor > self.uniforms.shape[1] - self._reserve
        if not low.any():
            return
        for stream in np.flatnonzero(low):
            generator = self._generators[stream]
            if generator is None:
                continue
            row, start = self.uniforms[stream], self.cursor[stream]
            left = len(row) - start
            row[:left] = row[start:].copy()
            generator.random(out=row[left:])
            self.cursor[stream] = 0


@compiled
def draw(uniforms, cursor, stream):
    """The next uniform of a stream. Shapes: (num_streams, block), (num_streams,)."""
    value = uniforms[stream, cursor[stream]]
    cursor[stream] += 1
    return value
