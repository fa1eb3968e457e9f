"""A recorded match is played again and gives the same; whatever was changed in it is found."""

import json
from pathlib import Path

import pytest

from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.verify import check_world
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.messages import FIELD_STATE, MATCH, PERCEPTION


def test_a_recorded_match_replays(bag_3v2: Path) -> None:
    bag = MatchBag(bag_3v2)
    cycles = sum(episode.cycles + 1 for episode in bag.episodes())
    assert check_world(bag) == (4, cycles, None)


@pytest.mark.parametrize(
    ("topic", "field", "index", "what"),
    [
        ("/field_state", "positions", 3, "position"),
        ("/field_state", "yaws", 0, "yaw"),
        ("/taker_1/perception", "positions", 0, "belief"),
        ("/keeper_3/perception", "ages", 4, "age"),
    ],
)
def test_a_changed_number_is_found(
    bag_3v2: Path, tmp_path: Path, topic: str, field: str, index: int, what: str
) -> None:
    second = list(MatchBag(bag_3v2).episodes())[1]
    with BagWriter(tmp_path / "bag") as bag:
        for m in BagReader(bag_3v2).messages():
            data = m.data
            if m.topic == topic and m.log_time == second.start + 300_000_000:
                message = codec(m.message_type)
                values = message.decode(data)
                values[field][index] += 1
                data = message.encode(values)
            bag.write(m.topic, m.message_type, data, m.log_time)
    difference = check_world(MatchBag(tmp_path / "bag")).difference
    assert difference == (what, 1, 3)
    assert str(difference) == f"{what} differs in episode 1 at cycle 3"


def test_a_bag_of_a_version_with_a_setting_that_went_replays(bag_3v2: Path, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for m in BagReader(bag_3v2).messages():
            data = m.data
            if m.message_type == MATCH:
                values = codec(MATCH).decode(data)
                config = json.loads(values["config_json"])
                config["vision"]["hear_distance"] = 50.0
                data = codec(MATCH).encode({**values, "config_json": json.dumps(config)})
            bag.write(m.topic, m.message_type, data, m.log_time)
    assert check_world(MatchBag(tmp_path / "bag")) == check_world(MatchBag(bag_3v2))


def test_a_match_whose_beginning_is_missing_is_refused(bag_3v2: Path, tmp_path: Path) -> None:
    second = list(MatchBag(bag_3v2).episodes())[1]
    with BagWriter(tmp_path / "bag") as bag:
        for m in BagReader(bag_3v2).messages():
            if m.topic == "/match" or m.log_time >= second.start:
                bag.write(m.topic, m.message_type, m.data, m.log_time)
    with pytest.raises(KeepawayError, match="episode 0 was not recorded"):
        check_world(MatchBag(tmp_path / "bag"))


@pytest.mark.parametrize(
    ("kind", "complaint"), [(FIELD_STATE, "field states"), (PERCEPTION, "lacks 1 perceptions")]
)
def test_a_gap_is_found(bag_3v2: Path, tmp_path: Path, kind: str, complaint: str) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for m in BagReader(bag_3v2).messages():
            if m.message_type != kind or m.log_time != 500_000_000:
                bag.write(m.topic, m.message_type, m.data, m.log_time)
    with pytest.raises(KeepawayError, match=complaint):
        check_world(MatchBag(tmp_path / "bag"))
