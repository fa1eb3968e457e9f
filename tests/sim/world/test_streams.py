"""Buffered random numbers are the generator's own, whatever the size of the buffer."""

import numpy as np
import pytest

from keepaway_sim.errors import KeepawayError
from keepaway_sim.world.streams import RandomStreams, draw


@pytest.mark.parametrize("block", [8, 13, 64, 2048])
def test_a_stream_gives_the_generators_numbers_in_order(block):
    streams = RandomStreams(2, reserve=8, block=block)
    streams.seed(1, np.random.default_rng(5))
    drawn = []
    for count in (8, 1, 7, 8, 3, 8, 8, 2) * 5:
        streams.refill()
        drawn += [draw(streams.uniforms, streams.cursor, 1) for _ in range(count)]
    np.testing.assert_array_equal(drawn, np.random.default_rng(5).random(len(drawn)))


def test_streams_do_not_disturb_each_other():
    together = RandomStreams(3, reserve=4, block=16)
    for stream in range(3):
        together.seed(stream, np.random.default_rng(stream))
    drawn: dict[int, list[float]] = {stream: [] for stream in range(3)}
    for cycle in range(60):
        together.refill()
        for stream in range(3):
            count = (cycle * (stream + 1)) % 5
            drawn[stream] += [
                draw(together.uniforms, together.cursor, stream) for _ in range(count)
            ]
    for stream, numbers in drawn.items():
        alone = np.random.default_rng(stream).random(len(numbers))
        np.testing.assert_array_equal(numbers, alone)


def test_seeding_again_starts_anew():
    streams = RandomStreams(1, reserve=4, block=16)
    first = []
    for _ in range(2):
        streams.seed(0, np.random.default_rng(3))
        first.append(draw(streams.uniforms, streams.cursor, 0))
    assert first[0] == first[1]


def test_a_buffer_that_could_run_dry_is_refused():
    with pytest.raises(KeepawayError, match="reserve=9 is more than block=8"):
        RandomStreams(1, reserve=9, block=8)
