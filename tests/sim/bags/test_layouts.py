"""Bags as other writers lay them out give the same numbers, or one sentence says why not."""

import copy
from collections.abc import Callable
from pathlib import Path

import layouts
import numpy as np
import pytest
import yaml
import zstandard
from layouts import Many, Said, of_the_wall, shuffled, write
from recorded import record_match

from keepaway_sim.analysis.tally import episode_table
from keepaway_sim.bags import merging
from keepaway_sim.bags.belonging import Belonging
from keepaway_sim.bags.gaps import count_gaps
from keepaway_sim.bags.marked import with_markers
from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.repair import repair
from keepaway_sim.bags.verify import check_world
from keepaway_sim.errors import KeepawayError
from keepaway_sim.view.page import replay_page
from keepaway_sim.wire.cdr import codec

ODD = 8


@pytest.fixture(scope="module")
def match(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return layouts.record(tmp_path_factory.mktemp("layouts"))


@pytest.fixture(scope="module")
def messages(match: Path) -> Many:
    return layouts.read(match)


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Many:
    return layouts.read(record_match(tmp_path_factory.mktemp("o") / "other", "3v2", 9, 2))


def rows(path: Path, number: int | None = None) -> list[tuple[object, ...]]:
    return list(episode_table(path, number).itertuples(index=False, name=None))


def test_the_table_of_the_docs_is_what_tools_make_of_every_layout(
    match: Path, tmp_path: Path
) -> None:
    made = layouts.table(match, tmp_path)
    assert made == layouts.in_page(layouts.PAGE.read_text())
    ordinary = made.splitlines()[2:-ODD]
    assert len(ordinary) == 10
    for line in ordinary:
        assert line.count(layouts.SAME) == len(layouts.TOOLS), line


def test_chunks_that_overlap_in_several_files_are_read_in_order(
    messages: Many, match: Path, tmp_path: Path
) -> None:
    for part in range(3):
        write(tmp_path / f"bag_{part}.mcap", messages[part::3], chunk_size=9000)
    times = [message.log_time for message in BagReader(tmp_path).messages()]
    assert times == sorted(times)
    assert rows(tmp_path) == rows(match)


@pytest.mark.parametrize(
    "change", [of_the_wall, shuffled, lambda m: [s._replace(time=0) for s in m]]
)
def test_windows_that_are_too_small_change_nothing(
    messages: Many,
    match: Path,
    tmp_path: Path,
    change: Callable[[Many], Many],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Memory is bounded by sorting on the disk: with windows of 20 kB, hundreds of runs."""
    path = write(tmp_path / "bag.mcap", change(messages), chunk_size=30_000)
    expected = sorted(m.data for m in BagReader(match).messages())
    monkeypatch.setattr(merging, "WINDOW_SIZE", 20_000)
    found = list(BagReader(path).messages())
    assert sorted(m.data for m in found) == expected
    assert [m.log_time for m in found] == sorted(m.log_time for m in found)
    assert rows(path) == rows(match)


def test_messages_packed_one_by_one_are_read(messages: Many, match: Path, tmp_path: Path) -> None:
    packed = [said._replace(data=zstandard.compress(said.data)) for said in messages]
    assert rows(write(tmp_path / "bag.mcap", packed)) == rows(match)


def test_a_file_packed_as_a_whole_is_told_how_to_unpack(messages: Many, tmp_path: Path) -> None:
    file = write(tmp_path / "bag_0.mcap", messages)
    packed = file.with_name("bag_0.mcap.zstd")
    packed.write_bytes(zstandard.compress(file.read_bytes()))
    file.unlink()
    for path in (tmp_path, packed):
        with pytest.raises(KeepawayError, match="unzstd"):
            MatchBag(path)


def test_files_are_those_that_metadata_lists_and_a_missing_one_is_said(
    messages: Many, tmp_path: Path
) -> None:
    third = len(messages) // 3
    for part in range(3):
        own = messages[part * third : (part + 1) * third if part < 2 else None]
        write(tmp_path / f"{'cab'[part]}.mcap", own)
    listed = {"relative_file_paths": ["c.mcap", "a.mcap", "b.mcap"], "message_count": len(messages)}
    (tmp_path / "metadata.yaml").write_text(yaml.dump({"rosbag2_bagfile_information": listed}))
    assert [place.file.path.name[0] for place in BagReader(tmp_path).places] == ["c", "a", "b"]
    (tmp_path / "a.mcap").unlink()
    report = count_gaps(MatchBag(tmp_path)).report()
    assert "a.mcap, which metadata.yaml lists, is missing" in report
    assert "/field_state misses" in report
    table = episode_table(tmp_path)
    assert table["passes"].isna().any()
    assert table["duration_s"].notna().all()


def test_metadata_at_odds_with_the_files_is_said(messages: Many, tmp_path: Path) -> None:
    write(tmp_path / "bag_0.mcap", messages)
    listed = {"relative_file_paths": ["bag_0.mcap"], "message_count": 7}
    (tmp_path / "metadata.yaml").write_text(yaml.dump({"rosbag2_bagfile_information": listed}))
    assert "metadata.yaml counts 7 messages" in count_gaps(MatchBag(tmp_path)).report()
    (tmp_path / "metadata.yaml").write_text("- nothing\n")
    assert "metadata.yaml is not rosbag2's" in count_gaps(MatchBag(tmp_path)).report()


# --- two matches ---


def in_namespace(said: Said) -> Said:
    return said if said.topic == "/clock" else said._replace(topic=f"/red{said.topic}")


TOGETHER: dict[str, Callable[[Many, Many], Many]] = {
    "one after the other": lambda a, b: a + b,
    "by the wall's time": lambda a, b: of_the_wall(a) + of_the_wall(b, layouts.WALL + 10**12),
    "in disorder": lambda a, b: shuffled(of_the_wall(a) + of_the_wall(b, layouts.WALL + 10**12)),
    "in namespaces": lambda a, b: shuffled(a + [in_namespace(said) for said in b]),
}


@pytest.mark.parametrize("how", TOGETHER)
def test_two_matches_of_a_bag_are_two(
    messages: Many, other: Many, match: Path, tmp_path: Path, how: str
) -> None:
    path = write(tmp_path / "bag.mcap", TOGETHER[how](messages, other), chunk_size=20_000)
    with pytest.raises(KeepawayError, match=r"has 2 matches, choose one \(--match 1\): 1: /"):
        MatchBag(path)
    with pytest.raises(KeepawayError, match="match 3: "):
        MatchBag(path, 3)
    alone = write(tmp_path / "other.mcap", other)
    expected = {3: rows(match), 9: rows(alone)}
    for number in (1, 2):
        bag = MatchBag(path, number)
        assert rows(path, number) == expected[bag.match["seed"]]
        assert count_gaps(bag).report().startswith("nothing is missing")
        said = {m.data for m in bag.timeline.messages() if m.topic.endswith("/match")}
        assert len(said) == 1
    whole = repair(path, tmp_path / "whole")
    assert [len(rows(whole.path, number)) for number in (1, 2)] == [
        len(expected[MatchBag(path, number).match["seed"]]) for number in (1, 2)
    ]


def numbered(messages: Many, match_id: int) -> Many:
    """The same, as of a match with that number."""

    def one(said: Said) -> Said:
        if not said.message_type.startswith("keepaway_msgs/"):
            return said
        layout = codec(said.message_type)
        return said._replace(data=layout.encode({**layout.decode(said.data), "match_id": match_id}))

    return [one(said) for said in messages]


def in_turn(one: Many, other: Many) -> Many:
    """As two simulators in one namespace publish at the same time."""
    return sorted(one + other, key=lambda said: said.time)


@pytest.mark.parametrize("task", ["3v2", "4v3"])
@pytest.mark.parametrize("mixed", [in_turn, lambda a, b: shuffled(a + b)])
def test_two_matches_at_once_on_the_same_topics_are_told_apart_by_their_numbers(
    messages: Many, tmp_path: Path, task: str, mixed: Callable[[Many, Many], Many]
) -> None:
    second = layouts.read(record_match(tmp_path / "second", task, 3, 2))
    alone = [numbered(messages, 7), numbered(second, 2**63 + 9)]
    bags = [write(tmp_path / f"{n}.mcap", said) for n, said in enumerate(alone)]
    path = write(tmp_path / "bag.mcap", mixed(*alone), chunk_size=20_000)
    found = {MatchBag(path, n).match["match_id"]: n for n in (1, 2)}
    for bag, said, number in zip(bags, alone, (found[7], found[2**63 + 9]), strict=True):
        match = MatchBag(path, number)
        assert rows(path, number) == rows(bag)
        assert count_gaps(match).report() == count_gaps(MatchBag(bag)).report()
        assert replay_page(path, number=number)[0] == replay_page(bag)[0]
        assert str(check_world(match)) == str(check_world(MatchBag(bag)))
        counted = ("/perception", "/field_state", "/action_request")
        assert match.message_count == sum(m.topic.endswith(counted) for m in said)
        own = {m.data for m in said if m.message_type.startswith("keepaway_msgs/")}
        assert {m.data for m in match.timeline.messages(kept(match))} == own
        marked = with_markers(path, tmp_path / f"marked_{number}", number)
        assert {m.data for m in marked.messages(kept(match))} == own
        assert rows(marked.path) == rows(bag)
    whole = repair(path, tmp_path / "whole").path
    assert {MatchBag(whole, n).match["match_id"]: rows(whole, n) for n in (1, 2)} == {
        7: rows(bags[0]), 2**63 + 9: rows(bags[1])
    }  # fmt: skip


def kept(match: MatchBag) -> set[str]:
    """The topics of a bag whose messages carry a match's number."""
    return {t.name for t in match.reader.topics.values() if "keepaway_msgs" in t.message_type}


def test_messages_of_a_match_that_nobody_described_are_not_counted_and_are_said(
    messages: Many, match: Path, tmp_path: Path
) -> None:
    stray = [said for said in numbered(messages, 8) if not said.topic.endswith("/match")]
    path = write(tmp_path / "bag.mcap", in_turn(numbered(messages, 7), stray))
    assert rows(path) == rows(match)
    numbers = sum("keepaway_msgs" in said.message_type for said in stray)
    assert f"{numbers} messages are of another match" in said_of(path)
    unnumbered = write(tmp_path / "old.mcap", in_turn(numbered(messages, 7), messages[1:]))
    assert "messages came more than once" in said_of(unnumbered)


def test_matches_in_other_namespaces_are_no_match_on_the_same_topics(
    messages: Many, tmp_path: Path
) -> None:
    """Also for the root, whose name all others begin with."""
    beside = [in_namespace(said) for said in numbered(messages, 8)]
    path = write(tmp_path / "bag.mcap", in_turn(numbered(messages, 7), beside))
    for number in (1, 2):
        assert count_gaps(MatchBag(path, number)).report().startswith("nothing is missing")
        assert MatchBag(path, number).found.strange == 0


def test_large_numbers_of_matches_are_told_apart_to_the_last_digit() -> None:
    ids = np.array([2**63 + 1, 2**63 + 2], np.uint64)
    unnumbered = Belonging(0, (5, 2**63 + 1))
    assert unnumbered.chosen(ids, 0, np.zeros((2, 4), np.int64)).tolist() == [False, True]


def said_of(path: Path) -> str:
    return count_gaps(MatchBag(path)).report()


def test_a_match_that_is_told_again_is_one(messages: Many, match: Path, tmp_path: Path) -> None:
    told = [copy.copy(messages[0])._replace(time=messages[len(messages) // 2].time)]
    middle = len(messages) // 2
    path = write(tmp_path / "bag.mcap", messages[:middle] + told + messages[middle:])
    assert rows(path) == rows(match)
    assert "1 messages came more than once" in count_gaps(MatchBag(path)).report()


# --- what is missing ---


def test_no_number_rests_on_what_is_missing(messages: Many, tmp_path: Path) -> None:
    lost = next(n for n, said in enumerate(messages) if said.topic == "/field_state" and n > 200)
    path = write(tmp_path / "bag.mcap", messages[:lost] + messages[lost + 1 :])
    table = episode_table(path)
    assert (
        table["passes"].isna().tolist() == [True, False, False] or table["passes"].isna().sum() == 1
    )
    assert np.isfinite(table["decisions"]).all()
    asked = layouts.without(messages, "keeper_1/action_request")
    assert episode_table(write(tmp_path / "asked.mcap", asked))["decisions"].isna().all()


def test_a_sequence_that_no_reader_needs_may_be_missing(
    messages: Many, match: Path, tmp_path: Path
) -> None:
    """Perceptions without velocities, of a writer whose definition has none."""
    name, ours = "keepaway_msgs/msg/Perception", codec("keepaway_msgs/msg/Perception")
    definition = b"\n".join(
        line
        for line in next(s.definition for s in messages if s.message_type == name).split(b"\n")
        if line.split()[1:2] != [b"velocities"]
    )
    theirs = codec(name, definition.decode())

    def without(said: Said) -> Said:
        if said.message_type != name:
            return said
        values = {k: v for k, v in ours.decode(said.data).items() if k != "velocities"}
        return said._replace(definition=definition, data=theirs.encode(values))

    path = write(tmp_path / "bag.mcap", [without(said) for said in messages])
    assert rows(path) == rows(match)
