"""Playing a bag: everything once, in order, when it is due."""

import itertools
import math
from pathlib import Path

import pytest

from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.playback import Playback, episode_times
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.timeline import Timeline
from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire.messages import PERCEPTION


@pytest.fixture
def reader(bag_3v2: Path) -> BagReader:
    return BagReader(bag_3v2)


@pytest.fixture
def timeline(reader: BagReader) -> Timeline:
    return Timeline.of_bag(reader)


def played(playback: Playback, clock: float = 0.0, most: int = 10**6) -> list[tuple[float, int]]:
    """When every moment was due, by a clock that jumps to the next one, and its simulated time."""
    moments: list[tuple[float, int]] = []
    while not playback.finished and len(moments) < most:
        clock += playback.wait(clock)
        assert playback.due(clock)
        moments.append((clock, playback.time))
    return moments


def test_everything_is_said_once_and_in_order(timeline: Timeline) -> None:
    playback = Playback(timeline, rate=0.0)
    said = playback.prologue()
    while not playback.finished:
        said += playback.due(0.0)
    assert said == list(timeline.reader.messages())


@pytest.mark.parametrize("rate", [0.5, 1.0, 10.0])
def test_moments_are_as_far_apart_as_simulated_over_the_rate(
    timeline: Timeline, rate: float
) -> None:
    for clock, time in played(Playback(timeline, rate), clock=5.0):
        assert clock == pytest.approx(5.0 + time / 1e9 / rate)


def test_nothing_is_due_before_its_time(timeline: Timeline) -> None:
    playback = Playback(timeline)
    playback.due(10.0)
    assert playback.due(10.05) == []
    assert playback.wait(10.05) == pytest.approx(0.05)
    assert playback.due(10.1)


def test_a_pause_takes_its_time_and_the_rest_follows_on(timeline: Timeline) -> None:
    playback = Playback(timeline)
    assert played(playback, most=3)[-1] == pytest.approx((0.2, 200_000_000))
    playback.pause()
    assert playback.wait(1.0) == math.inf
    assert playback.due(1.0) == []
    playback.resume()
    later = played(playback, clock=60.0, most=2)
    assert later == [(60.0, 300_000_000), (pytest.approx(60.1), 400_000_000)]


def test_a_step_is_one_moment(timeline: Timeline) -> None:
    playback = Playback(timeline)
    playback.pause()
    for cycle in range(3):
        playback.step()
        assert {m.log_time for m in playback.due(0.0)} == {cycle * 100_000_000}
        assert playback.due(0.0) == []


def test_the_rate_changes_from_here_on(timeline: Timeline) -> None:
    playback = Playback(timeline, rate=1.0)
    played(playback, most=5)
    playback.rate = 4.0
    (first, t0), (second, t1) = played(playback, clock=20.0, most=2)
    assert (first, second) == (20.0, 20.025)
    assert t1 - t0 == 100_000_000


def test_a_loop_begins_again(timeline: Timeline) -> None:
    playback = Playback(timeline, rate=0.0, end=500_000_000, loop=True)
    times = [time for _, time in played(playback, most=12)]
    assert times == [100_000_000 * (k % 5) for k in range(12)]


def test_a_part_is_played_with_what_was_latched_before_it(timeline: Timeline) -> None:
    playback = Playback(timeline, start=1_000_000_000, end=1_500_000_000)
    assert [m.topic for m in playback.prologue()] == ["/match"]
    assert [time for _, time in played(playback)] == [
        1_000_000_000 + 100_000_000 * k for k in range(5)
    ]


def test_what_the_bag_begins_with_is_not_said_twice(timeline: Timeline) -> None:
    playback = Playback(timeline, end=1)
    assert [m.topic for m in playback.prologue()] == ["/match"]
    assert "/match" not in {m.topic for m in playback.due(0.0)}


def test_only_the_topics_asked_for_are_said(timeline: Timeline) -> None:
    topics = timeline.reader.of_type(PERCEPTION)[:2]
    playback = Playback(timeline, topics=topics)
    assert {m.topic for m in playback.due(0.0)} == set(topics)
    assert playback.prologue() == []


def test_episodes_are_found(bag_3v2: Path) -> None:
    episodes = list(MatchBag(bag_3v2).episodes())
    start, end = episode_times(MatchBag(bag_3v2), 1, 2)
    assert (start, end) == (episodes[1].start, episodes[2].end + 1)
    times = {m.log_time for m in BagReader(bag_3v2).messages(start=start, end=end)}
    assert len(times) == episodes[1].cycles + episodes[2].cycles + 2


def test_episodes_that_are_not_there_are_refused(bag_3v2: Path) -> None:
    with pytest.raises(KeepawayError, match=r"episodes 3\.\.9: .* has 0\.\.3"):
        episode_times(MatchBag(bag_3v2), 3, 9)


@pytest.mark.parametrize("rate", [-1.0, math.inf, math.nan])
def test_a_rate_that_is_none_is_refused(timeline: Timeline, rate: float) -> None:
    with pytest.raises(KeepawayError, match="rate="):
        Playback(timeline, rate)


def test_topics_and_times_that_are_not_there_are_refused(timeline: Timeline) -> None:
    with pytest.raises(KeepawayError, match="/nothing: the bag has /match"):
        Playback(timeline, topics=["/nothing"])
    with pytest.raises(KeepawayError, match="nothing was recorded in that time"):
        Playback(timeline, start=10**15)


def test_times_go_up(timeline: Timeline) -> None:
    times = [time for _, time in played(Playback(timeline, rate=0.0))]
    assert all(a < b for a, b in itertools.pairwise(times))
