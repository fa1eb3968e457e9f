"""Pictures and the page's data: what they show is what the bag says."""

import base64
import json
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from matplotlib.patches import Circle

from keepaway_sim.bags.match_bag import EpisodeSummary, MatchBag, Track
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Outcome, Task
from keepaway_sim.view.page import (
    NO_VALUE,
    chosen_episodes,
    frames,
    layout,
    match_data,
    page,
    replay_page,
)
from keepaway_sim.view.picture import picture


@pytest.fixture(scope="module")
def bag(bag_3v2: Path) -> MatchBag:
    return MatchBag(bag_3v2)


@pytest.fixture(scope="module")
def track(bag: MatchBag) -> Track:
    return bag.track(next(bag.episodes()))


def part(rows: np.ndarray, name: str, task: Task) -> np.ndarray:
    """A named part of frames."""
    starts, size = layout(task)
    ends = [*list(starts.values())[1:], size]
    return rows[:, starts[name] : ends[list(starts).index(name)]]


def data_of(text: str) -> dict[str, object]:
    """The data in a page."""
    found = re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)
    assert found
    return dict(json.loads(found[1]))


def summary(number: int, cycles: int) -> EpisodeSummary:
    return EpisodeSummary(number, 0, 0, cycles, cycles / 10, Outcome.TAKEN_AWAY, -1)


@pytest.mark.parametrize("name", ["3v2", "5v4"])
def test_a_frame_has_room_for_everything_once(name: str) -> None:
    task = Task.parse(name)
    starts, size = layout(task)
    num, objects, keepers = task.num_players, task.num_players + 1, task.num_keepers
    assert size == 3 + 2 * objects + 6 * num + 3 * num * objects + num * keepers
    assert list(starts.values()) == sorted(set(starts.values()))


def test_frames_are_the_track_to_a_centimetre(track: Track, bag: MatchBag) -> None:
    rows = frames(track, bag.task)
    count = len(track.time)
    position = part(rows, "position", bag.task).reshape(count, 6, 2) / 100
    np.testing.assert_allclose(position, track.position, atol=0.00501)
    believed = part(rows, "believed", bag.task).reshape(count, 5, 6, 2)
    known = track.age < 65535
    np.testing.assert_allclose(believed[known] / 100, track.believed[known], atol=0.00501)
    assert (believed[~known] == NO_VALUE).all()
    np.testing.assert_allclose(part(rows, "yaw", bag.task) / 1e4, track.yaw, atol=0.0001)
    np.testing.assert_array_equal(part(rows, "requested", bag.task), track.requested)
    values = part(rows, "values", bag.task).reshape(count, 5, 3)
    expected = np.where(np.isnan(track.values), NO_VALUE, np.rint(10 * track.values))
    np.testing.assert_array_equal(values, expected)


def test_what_a_page_cannot_hold_is_unknown_without_a_warning(track: Track, bag: MatchBag) -> None:
    wild = track._replace(neck=np.full_like(track.neck, np.finfo(track.neck.dtype).max))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rows = frames(wild, bag.task)
    assert (part(rows, "neck", bag.task) == NO_VALUE).all()


def test_the_page_lists_all_episodes_and_holds_the_chosen_ones(
    bag_3v2: Path, bag: MatchBag
) -> None:
    data = data_of(replay_page(bag_3v2, {1, 3})[0])
    entries = data["episodes"]
    assert isinstance(entries, list)
    assert [entry["number"] for entry in entries] == [0, 1, 2, 3]
    assert [entry["number"] for entry in entries if "frames" in entry] == [1, 3]
    for entry, episode in zip(entries, bag.episodes(), strict=True):
        assert entry["duration"] == pytest.approx(episode.duration)
        assert entry["outcome"] == episode.outcome
    raw = np.frombuffer(base64.b64decode(entries[1]["frames"]), "<i2")
    rows = raw.reshape(-1, layout(bag.task)[1])
    np.testing.assert_array_equal(rows, frames(bag.track(list(bag.episodes())[1]), bag.task))


def test_the_page_needs_no_network(bag_3v2: Path) -> None:
    text, _ = replay_page(bag_3v2)
    assert not re.search(
        r"https?://|url\(|@import|<link[^>]+href=\"(?!data:)|<script[^>]+src", text
    )
    assert "{{" not in text


def test_nothing_that_is_said_in_a_bag_becomes_part_of_the_page(bag: MatchBag) -> None:
    said = "</script><script>alert(1)</script>"
    match = {**bag.match, "task": said, "profile": said, "code_version": said}
    text = page({"live": False, "match": match_data(match), "episodes": []})
    assert text.count("<script") == 2
    assert said not in text


def test_an_episode_that_was_cut_off_is_shown_as_far_as_it_went(
    bag_3v2: Path, tmp_path: Path
) -> None:
    third = list(MatchBag(bag_3v2).episodes())[2]
    with BagWriter(tmp_path / "cut") as cut:
        for m in BagReader(bag_3v2).messages(end=third.start + 1_000_000_001):
            cut.write(m.topic, m.message_type, m.data, m.log_time)
    data = data_of(replay_page(tmp_path / "cut")[0])
    entries = data["episodes"]
    assert isinstance(entries, list)
    last = entries[-1]
    assert (last["number"], last["duration"], last["outcome"]) == (2, 1.0, Outcome.IN_PLAY)
    assert last["frames"]


def test_few_episodes_are_all_shown_many_are_spread_over_the_match() -> None:
    episodes = [summary(k, 100) for k in range(1000)]
    assert chosen_episodes(episodes[:50], None, 5000) == set(range(50))
    chosen = chosen_episodes(episodes, None, 5000)
    assert chosen == set(range(0, 1000, 20))


def test_episodes_that_are_not_there_are_refused(bag_3v2: Path) -> None:
    with pytest.raises(KeepawayError, match=r"the bag has 0\.\.3"):
        replay_page(bag_3v2, {7})


def test_a_picture_shows_everybody_where_they_were(
    track: Track, bag: MatchBag, tmp_path: Path
) -> None:
    figure = picture(track, 10, bag.task, visible_angle=1.57, player=0)
    axes = figure.axes[0]
    discs = [patch for patch in axes.patches if isinstance(patch, Circle) and patch.get_fill()]
    for place in track.position[10]:
        assert any(np.allclose(place, disc.center) for disc in discs)
    figure.savefig(tmp_path / "moment.png")
    assert (tmp_path / "moment.png").stat().st_size > 10_000
