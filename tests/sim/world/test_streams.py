"""Buffered random numbers are the generator's own, whatever the size of the buffer."""

import pickle

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
        drawn += [draw(streams.draws, 1) for _ in range(count)]
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
            drawn[stream] += [draw(together.draws, stream) for _ in range(count)]
    for stream, numbers in drawn.items():
        alone = np.random.default_rng(stream).random(len(numbers))
        np.testing.assert_array_equal(numbers, alone)


def test_seeding_again_starts_anew():
    streams = RandomStreams(1, reserve=4, block=16)
    first = []
    for _ in range(2):
        streams.seed(0, np.random.default_rng(3))
        first.append(draw(streams.draws, 0))
    assert first[0] == first[1]


def test_a_buffer_that_could_run_dry_is_refused():
    with pytest.raises(KeepawayError, match="reserve=9 is more than block=8"):
        RandomStreams(1, reserve=9, block=8)


def test_a_stream_goes_on_from_a_snapshot_anywhere():
    streams = RandomStreams(2, reserve=4, block=16)
    streams.seed(0, np.random.default_rng(3))
    [draw(streams.draws, 0) for _ in range(11)]
    kept = pickle.loads(pickle.dumps(streams.snapshot(0)))

    def following(owner: RandomStreams, stream: int) -> list[float]:
        drawn = []
        for _ in range(40):
            owner.refill()
            drawn.append(draw(owner.draws, stream))
        return drawn

    expected = following(streams, 0)
    larger = RandomStreams(3, reserve=4, block=32)
    for owner, stream in ((streams, 0), (streams, 1), (larger, 2), (streams, 0)):
        owner.restore(stream, kept)
        assert following(owner, stream) == expected


def test_a_snapshot_that_does_not_fit_is_refused():
    streams = RandomStreams(1, reserve=4, block=32)
    streams.seed(0, np.random.default_rng(3))
    with pytest.raises(KeepawayError, match="32 numbers: there is room for 16"):
        RandomStreams(1, reserve=4, block=16).restore(0, streams.snapshot(0))


def test_who_watches_the_cursors_never_runs_dry():
    streams = RandomStreams(1, reserve=4, block=16)
    streams.seed(0, np.random.default_rng(5))
    drawn, num_looks = [], 0
    for _ in range(40):
        if streams.draws.cursor[0] > streams.latest:
            streams.top_up()
            num_looks += 1
        drawn += [draw(streams.draws, 0) for _ in range(4)]
    np.testing.assert_array_equal(drawn, np.random.default_rng(5).random(len(drawn)))
    assert num_looks == 9  # every fourth time, but for the first block
