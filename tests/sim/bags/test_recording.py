"""Bags: whole, readable by others, readable when their writer was killed, and never overwritten."""

import os
import resource
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from recorded import record_match
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.repair import repair
from keepaway_sim.bags.topics import Qos, Recorded, Topic
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.messages import (
    ACTION_REQUEST,
    CLOCK,
    EPISODE,
    FIELD_STATE,
    MATCH,
    PERCEPTION,
    Request,
    action_request,
)

REQUEST = action_request(Request(0, 1, 2, 0, 0), [1.0, 2.0])


def request_at(cycle: int, num_values: int = 3) -> bytes:
    return action_request(Request(0, 0, cycle, 0, 0), [float(cycle)] * num_values)


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_what_is_written_is_read_back(tmp_path: Path, compression: str) -> None:
    written = [
        Recorded(f"/{name}", ACTION_REQUEST, 100 * cycle, request_at(cycle))
        for cycle in range(500)
        for name in ("a", "b")
    ]
    with BagWriter(tmp_path / "bag", compression=compression, chunk_size=4096) as bag:
        for message in written:
            bag.write(*message[:2], message.data, message.log_time)
    assert list(BagReader(tmp_path / "bag").messages()) == written


def test_a_bag_says_what_made_it_and_what_is_in_it(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", {"task": "3v2", "seed": "1"}) as bag:
        bag.write("/x", ACTION_REQUEST, REQUEST, 7)
        bag.add_info(seed="2", command="scripts/match.py")
        bag.attach("keeper_1.weights", b"\x00\x01")
        bag.write("/y", ACTION_REQUEST, REQUEST, 9)
    reader = BagReader(tmp_path / "bag")
    assert reader.complete
    assert reader.info == {"task": "3v2", "seed": "2", "command": "scripts/match.py"}
    assert reader.counts == {"/x": 1, "/y": 1}
    assert (reader.start_time, reader.end_time) == (7, 9)
    assert list(reader.attachments()) == [("keeper_1.weights", b"\x00\x01")]


@pytest.fixture
def long_bag(tmp_path: Path) -> tuple[Path, list[Recorded]]:
    """A bag in several files, and what was written to it."""
    written = [Recorded("/a", ACTION_REQUEST, 10 * n, request_at(n)) for n in range(1000)]
    written[500:500] = [Recorded("/b", EPISODE, 7, codec(EPISODE).encode({}))]
    with BagWriter(tmp_path / "long", chunk_size=4096, file_chunks=3) as bag:
        for message in written:
            bag.write(*message[:2], message.data, message.log_time)
        bag.add_info(gaps="none")
    return tmp_path / "long", written


def test_a_long_bag_goes_on_in_further_files(long_bag: tuple[Path, list[Recorded]]) -> None:
    path, written = long_bag
    files = yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    names = [f"long_{number}.mcap" for number in range(len(files["files"]))]
    assert len(names) > 4
    assert files["relative_file_paths"] == names == [part["path"] for part in files["files"]]
    assert sum(part["message_count"] for part in files["files"]) == len(written)
    assert files["starting_time"] == {"nanoseconds_since_epoch": 0}
    assert files["duration"] == {"nanoseconds": 9990}
    for part in files["files"]:
        with (path / part["path"]).open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert 1 <= len(summary.chunk_indexes) <= 4
        assert summary.statistics.message_count == part["message_count"]


def test_a_long_bag_is_read_as_one(long_bag: tuple[Path, list[Recorded]]) -> None:
    path, written = long_bag
    reader = BagReader(path)
    assert list(reader.messages()) == sorted(written, key=lambda message: message.log_time)
    assert reader.complete
    assert reader.info == {"gaps": "none"}
    assert reader.counts == {"/a": 1000, "/b": 1}
    with AnyReader([path]) as theirs:
        messages = [(c.topic, time, bytes(data)) for c, time, data in theirs.messages()]
    assert sorted(messages) == sorted((m.topic, m.log_time, m.data) for m in written)


def test_memory_does_not_grow_with_a_long_bag(tmp_path: Path) -> None:
    in_many_files = memory_growth(tmp_path / "many", file_chunks=100)
    in_one_file = memory_growth(tmp_path / "one", file_chunks=10_000)
    assert in_many_files < in_one_file / 10


def memory_growth(path: Path, file_chunks: int) -> int:
    """Bytes that 900 chunks of a bag add to what its writers hold.

    Only memory that the bag's own code and `mcap` asked for counts: other threads of the test's
    process, and caches of other libraries, grow as they like.
    """
    held = []
    writers = [tracemalloc.Filter(True, f"*{part}*") for part in ("/mcap/", "/keepaway_sim/bags/")]
    tracemalloc.start()
    with BagWriter(path, file_chunks=file_chunks) as bag:
        for number in range(1000):
            bag.write(f"/{number % 10}", ACTION_REQUEST, REQUEST, number)
            bag.flush()
            if number in {99, 999}:
                traces = tracemalloc.take_snapshot().filter_traces(writers).traces
                held.append(sum(trace.size for trace in traces))
    tracemalloc.stop()
    return held[1] - held[0]


def test_a_file_that_was_only_just_begun_is_no_harm(long_bag: tuple[Path, list[Recorded]]) -> None:
    path, written = long_bag
    for begun in (b"", b"\x89MCAP"):
        (path / "long_99.mcap").write_bytes(begun)
        assert sorted(BagReader(path).messages()) == sorted(written)


def test_a_bag_is_whole_after_an_error(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), BagWriter(tmp_path / "bag") as bag:  # noqa: PT012
        bag.write("/x", ACTION_REQUEST, REQUEST, 0)
        raise ZeroDivisionError
    assert BagReader(tmp_path / "bag").complete
    assert (tmp_path / "bag" / "metadata.yaml").is_file()


def test_a_bag_is_never_overwritten(bag_3v2: Path) -> None:
    with pytest.raises(KeepawayError, match="exists already"):
        BagWriter(bag_3v2)


def test_a_topic_carries_one_type(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/x", ACTION_REQUEST)
        with pytest.raises(KeepawayError, match="carries keepaway_msgs/msg/ActionRequest"):
            bag.add_topic("/x", EPISODE)


@pytest.mark.parametrize("content", [None, b"", b"not an mcap file"])
def test_what_is_no_bag_is_refused(tmp_path: Path, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / "x.mcap").write_bytes(content)
    with pytest.raises(KeepawayError, match=r"no bag there|no MCAP file"):
        BagReader(tmp_path)


def test_equal_matches_give_equal_bags(tmp_path: Path, bag_3v2: Path) -> None:
    again = record_match(tmp_path / bag_3v2.name, "3v2", seed=7, episodes=4)
    for file in sorted(bag_3v2.iterdir()):
        assert file.read_bytes() == (again / file.name).read_bytes()


def test_times_are_half_open(bag_3v2: Path) -> None:
    reader = BagReader(bag_3v2)
    topic = ["/keeper_1/perception"]
    times = [m.log_time for m in reader.messages(topic)]
    first, last = times[10], times[20]
    assert [m.log_time for m in reader.messages(topic, first, last)] == times[10:20]
    batches = [batch.log_time for batch in reader.batches(topic, first, last)]
    assert np.concatenate(batches).tolist() == times[10:20]


def test_batches_hold_the_same_messages_one_by_one(bag_3v2: Path) -> None:
    reader = BagReader(bag_3v2)
    for topic in reader.of_type(PERCEPTION) + reader.of_type(ACTION_REQUEST):
        single = [m.data for m in reader.messages([topic])]
        batched = [row.tobytes() for batch in reader.batches([topic]) for row in batch.data]
        assert batched == single


def test_batches_split_where_lengths_change_and_bytes_do_not(tmp_path: Path) -> None:
    state = codec(FIELD_STATE)
    rows = [{"positions": [1.0], "velocities": []}, {"positions": [], "velocities": [2.0]}]
    with BagWriter(tmp_path / "bag") as bag:
        for time, row in enumerate(rows):
            bag.write("/field_state", FIELD_STATE, state.encode(row), time)
    batches = list(BagReader(tmp_path / "bag").batches(["/field_state"]))
    assert [len(batch.data) for batch in batches] == [1, 1]
    assert [batch.data["positions.length"][0] for batch in batches] == [1, 0]


# --- other people's readers ---


def test_rosbags_reads_the_same_counts_and_values(bag_3v2: Path) -> None:
    ours = BagReader(bag_3v2)
    with AnyReader([bag_3v2]) as reader:
        assert {c.topic: c.msgcount for c in reader.connections} == ours.counts
        theirs = sorted((c.topic, time, bytes(raw)) for c, time, raw in reader.messages())
        assert theirs == sorted((m.topic, m.log_time, m.data) for m in ours.messages())
        connection = next(c for c in reader.connections if c.topic == "/keeper_2/perception")
        _, _, raw = next(reader.messages([connection]))
        theirs_decoded: Any = reader.deserialize(raw, connection.msgtype)
    first = next(ours.messages(["/keeper_2/perception"]))
    decoded = ours.codec(first.topic).decode(first.data)
    assert theirs_decoded.positions.tolist() == decoded["positions"]
    assert theirs_decoded.ages.tolist() == decoded["ages"]
    assert theirs_decoded.player_index == 1


def test_mcap_ros2_support_reads_the_same_counts_and_values(bag_3v2: Path) -> None:
    ours = BagReader(bag_3v2)
    file = next(bag_3v2.glob("*.mcap"))
    counts: dict[str, int] = {}
    states = []
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, decoded in reader.iter_decoded_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            if channel.topic == "/field_state":
                states.append(list(decoded.positions))
    assert counts == ours.counts
    decode = ours.codec("/field_state").decode
    assert states == [decode(m.data)["positions"] for m in ours.messages(["/field_state"])]


def test_metadata_is_as_rosbags_writer_makes_it(bag_3v2: Path, tmp_path: Path) -> None:
    """Rewritten by rosbags, it differs in who wrote it and in the names of files."""
    with (
        Reader(bag_3v2) as reader,
        Writer(tmp_path / "copy", version=9, storage_plugin=StoragePlugin.MCAP) as writer,
    ):
        copies: dict[int, Any] = {}
        for c in reader.connections:
            copies[c.id] = writer.add_connection(
                c.topic, c.msgtype, msgdef=c.msgdef.data, rihs01=c.digest,
                offered_qos_profiles=getattr(c.ext, "offered_qos_profiles", ()),
            )  # fmt: skip
        for c, time, raw in reader.messages():
            writer.write(copies[c.id], time, raw)
    ours, theirs = (
        yaml.safe_load((folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
        for folder in (bag_3v2, tmp_path / "copy")
    )
    assert ours.keys() == theirs.keys()
    for key in ours.keys() - {"relative_file_paths", "files", "ros_distro", "custom_data"}:
        assert ours[key] == theirs[key]
    assert ours["files"][0].keys() == theirs["files"][0].keys()


def test_a_file_has_profile_index_and_whole_definitions(bag_3v2: Path) -> None:
    with next(bag_3v2.glob("*.mcap")).open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == BagReader(bag_3v2).message_count
        assert sum(1 for _ in reader.iter_messages()) == summary.statistics.message_count
        episode = next(s for s in summary.schemas.values() if s.name == EPISODE)
        assert episode.encoding == "ros2msg"
        assert "=" * 80 + "\nMSG: builtin_interfaces/Time\n" in episode.data.decode()


def test_latched_topics_are_offered_latched(bag_3v2: Path) -> None:
    topics = BagReader(bag_3v2).topics
    assert topics["/match"].qos == Qos(1, transient_local=True)
    assert topics["/keeper_1/perception"].qos == Qos(10)


# --- a writer that was killed ---

KILLED = """
import os, signal, sys
from keepaway_sim.wire.messages import ACTION_REQUEST, Request, action_request
from keepaway_sim.bags.writer import BagWriter
bag = BagWriter(sys.argv[1], {"task": "3v2"}, chunk_size=4096)
bag.attach("keeper_1.weights", b"weights")
for cycle in range(1000):
    bag.write("/x", ACTION_REQUEST, action_request(Request(0, 0, cycle, 0, 0), [0.5]), cycle)
bag.flush()
bag.write("/x", ACTION_REQUEST, action_request(Request(0, 0, 1000, 0, 0)), 1000)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def killed(tmp_path: Path) -> Path:
    """A bag whose writer was killed with one message in its last chunk."""
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "killed")], check=False)
    assert done.returncode == -signal.SIGKILL
    return tmp_path / "killed"


def test_a_killed_writers_bag_opens_up_to_its_last_chunk(killed: Path) -> None:
    reader = BagReader(killed)
    assert not reader.complete
    assert reader.info == {"task": "3v2"}
    assert reader.counts == {"/x": 1000}
    assert [m.log_time for m in reader.messages()] == list(range(1000))


def test_a_repaired_bag_is_whole_for_everybody(killed: Path, tmp_path: Path) -> None:
    repaired = repair(killed, tmp_path / "repaired")
    assert repaired.complete
    assert list(repaired.messages()) == list(BagReader(killed).messages())
    assert list(repaired.attachments()) == [("keeper_1.weights", b"weights")]
    assert repaired.info == {"task": "3v2"}
    assert repaired.topics == BagReader(killed).topics
    with AnyReader([tmp_path / "repaired"]) as theirs:
        assert theirs.message_count == 1000


def test_whatever_is_cut_off_the_whole_chunks_before_it_are_read(killed: Path) -> None:
    file = next(killed.glob("*.mcap"))
    whole = list(BagReader(killed).messages())
    size = file.stat().st_size
    counts = []
    for length in range(size, 200, -size // 50):
        os.truncate(file, length)
        messages = list(BagReader(killed).messages())
        assert messages == whole[: len(messages)]
        counts.append(len(messages))
    assert counts == sorted(counts, reverse=True)
    assert counts[0] == 1000


def test_a_damaged_chunk_is_named(bag_3v2: Path, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.mcap"
    data = bytearray(next(bag_3v2.glob("*.mcap")).read_bytes())
    data[len(data) // 3] ^= 0xFF
    damaged.write_bytes(data)
    with pytest.raises(KeepawayError, match=r"chunk at \d+"):
        list(BagReader(damaged).messages())


def test_older_definitions_are_kept_by_repair(tmp_path: Path) -> None:
    old = "uint32 number\n"
    with BagWriter(tmp_path / "old") as bag:
        bag.add_topic("/episode", EPISODE, Qos(3, reliable=False), old, "RIHS01_old")
        bag.write("/episode", EPISODE, b"\x00\x01\x00\x00\x05\x00\x00\x00", 0)
    topic = repair(tmp_path / "old", tmp_path / "new").topics["/episode"]
    assert topic == Topic("/episode", EPISODE, old, "RIHS01_old", Qos(3, reliable=False))


def test_the_match_comes_first(bag_3v2: Path) -> None:
    assert next(BagReader(bag_3v2).messages()).message_type == MATCH


def test_a_full_disk_is_said_and_what_was_written_before_is_not_lost(
    tmp_path: Path, full_disk: Callable[[int], None]
) -> None:
    clock = codec(CLOCK).encode({})
    writer = BagWriter(tmp_path / "bag", compression="none", chunk_size=1000)
    full_disk(30_000)

    def write_on() -> None:
        for time in range(10_000):
            writer.write("/clock", CLOCK, clock, time)

    with pytest.raises(KeepawayError, match=r"cannot be written any more: .*repair_bag"):
        write_on()
    writer.close()
    full_disk(resource.RLIM_INFINITY)
    whole = repair(tmp_path / "bag", tmp_path / "whole")
    assert whole.complete
    times = [message.log_time for message in whole.messages()]
    assert times == list(range(len(times)))
    assert writer.message_count - 100 < len(times) <= writer.message_count
