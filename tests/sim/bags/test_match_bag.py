"""Episodes recorded without ROS, and read back as arrays: what the world was is what is read."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from recorded import in_play, simple_requests

from keepaway_sim.bags.field_recorder import FieldRecorder, world_info
from keepaway_sim.bags.gaps import GapCounter
from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Outcome, Task
from keepaway_sim.wire.messages import ACTION_REQUEST, FIELD_STATE, MATCH, PERCEPTION
from keepaway_sim.world.config import CYCLE_TIME, Config
from keepaway_sim.world.world import World

SEED = np.random.SeedSequence(entropy=7, spawn_key=(0, 0))


def test_a_bag_tells_what_was_played(bag_3v2: Path) -> None:
    match = MatchBag(bag_3v2)
    assert match.task == Task()
    assert match.config == Config()
    assert match.match["seed"] == 7
    assert match.player_topics("perception")[3] == "/taker_1/perception"


def test_episodes_follow_each_other_with_one_cycle_between(bag_3v2: Path) -> None:
    episodes = list(MatchBag(bag_3v2).episodes())
    assert [episode.number for episode in episodes] == [0, 1, 2, 3]
    assert episodes[0].start == 0
    for before, after in pairwise(episodes):
        assert after.start - before.end == 100_000_000
    for episode in episodes:
        assert episode.duration == pytest.approx(episode.cycles * CYCLE_TIME)
        assert episode.outcome in (Outcome.TAKEN_AWAY, Outcome.OUT_OF_BOUNDS)
        assert -1 <= episode.lost_by < 3


def test_a_track_is_what_the_world_was(bag_3v2: Path) -> None:
    """Played again with the same seed, the world is at every cycle what the bag says."""
    match = MatchBag(bag_3v2)
    world = World(match.task, match.config)
    world.start(0, SEED)
    for episode in match.episodes():
        track = match.track(episode)
        assert len(track.time) == episode.cycles + 1
        for t in range(episode.cycles + 1):
            seen = world.belief
            np.testing.assert_array_equal(track.position[t], world.truth.position[0])
            np.testing.assert_array_equal(track.velocity[t], world.truth.velocity[0] / CYCLE_TIME)
            np.testing.assert_array_equal(track.yaw[t], world.truth.yaw[0])
            np.testing.assert_array_equal(track.believed[t], seen.position[0])
            np.testing.assert_array_equal(track.age[t], seen.age[0])
            action, target, values = simple_requests(seen, world.task)
            due = seen.decision_due[0]
            np.testing.assert_array_equal(track.requested[t], np.where(due, action, -1))
            np.testing.assert_array_equal(track.requested_target[t], np.where(due, target, -1))
            for player in np.flatnonzero(due):
                expected = values[player] or [np.nan] * 3
                np.testing.assert_array_equal(track.values[t, player], expected)
            world.step(action[None], target[None])


def test_chosen_episodes_of_a_chosen_field_are_recorded(tmp_path: Path) -> None:
    """As a trainer does it: field 2 of 3, episodes 1 and 3; the others leave no trace."""
    world = World(Task.parse("4v3"), Config(), num_fields=3)
    for field in range(3):
        world.start(field, np.random.SeedSequence(field))
    with BagWriter(tmp_path / "bag", world_info(world, 2)) as bag:
        recorder = FieldRecorder(bag, world, 2, seed=2, wanted=lambda number: number in (1, 3))
        recorder.moment()
        while world.belief.episode[2] < 4:
            action, target, _ = simple_requests(world.belief, world.task)
            recorder.requests(action, target)
            world.step(np.tile(action, (3, 1)), np.tile(target, (3, 1)))
            recorder.moment()
    match = MatchBag(tmp_path / "bag")
    assert [episode.number for episode in match.episodes()] == [1, 3]
    counter = GapCounter(selected=True)
    for message in match.reader.messages():
        counter.feed(message.topic, message.message_type, message.data)
    assert set(counter.missing().values()) == {0}
    assert match.reader.counts["/clock"] == sum(e.cycles + 1 for e in match.episodes())


def test_requests_are_recorded_where_a_decision_is_due(bag_3v2: Path) -> None:
    reader = BagReader(bag_3v2)
    for player in ("keeper_1", "taker_2"):
        perceptions = next(reader.batches([f"/{player}/perception"])).data
        due = perceptions[perceptions["decision_due"]]
        asked = [
            (int(entry["episode"]), int(entry["cycle"]))
            for batch in reader.batches([f"/{player}/action_request"])
            for entry in batch.data
        ]
        expected = list(zip(due["episode"].tolist(), due["cycle"].tolist(), strict=True))
        assert asked[: len(expected)] == expected


def test_a_namespace_is_found(tmp_path: Path, bag_3v2: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for m in BagReader(bag_3v2).messages():
            bag.write(f"/red{m.topic}", m.message_type, m.data, m.log_time)
    match = MatchBag(tmp_path / "bag")
    assert match.topic("field_state") == "/red/field_state"
    first = next(match.episodes())
    assert len(match.track(first).time) == first.cycles + 1


def test_a_bag_without_a_match_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/field_state", FIELD_STATE)
    with pytest.raises(KeepawayError, match=f"one topic of {MATCH} was expected, found none"):
        MatchBag(tmp_path / "bag")


def test_what_was_not_recorded_is_not_made_up(tmp_path: Path, bag_3v2: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for m in BagReader(bag_3v2).messages():
            if m.message_type not in (PERCEPTION, ACTION_REQUEST):
                bag.write(m.topic, m.message_type, m.data, m.log_time)
    match = MatchBag(tmp_path / "bag")
    track = match.track(next(match.episodes()))
    assert np.isnan(track.believed).all()
    assert (track.requested == -1).all()
    assert np.isfinite(track.position).all()


def test_the_world_goes_on_while_it_is_recorded(bag_3v2: Path) -> None:
    world = World(Task(), Config())
    world.start(0, SEED)
    cycles = 0
    while in_play(world):
        action, target, _ = simple_requests(world.belief, world.task)
        world.step(action[None], target[None])
        cycles += 1
    assert next(MatchBag(bag_3v2).episodes()).cycles == cycles
