"""CDR without ROS: the same bytes and values as ROS's own serialiser and as rosbags."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from visualization_msgs.msg import MarkerArray

import keepaway_msgs.msg
from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.definitions import definition, type_hash

TYPES = ["ActionRequest", "AgentStatus", "Episode", "FieldState", "Match", "Perception"]
REQUEST = codec("keepaway_msgs/msg/ActionRequest")
PERCEPTION = codec("keepaway_msgs/msg/Perception")


def values(bits: int, signed: bool = False) -> st.SearchStrategy[int]:
    low = -(2 ** (bits - 1)) if signed else 0
    return st.integers(low, 2 ** (bits - int(signed)) - 1)


FLOATS = st.floats(allow_nan=False)
MATCHES = st.fixed_dictionaries(
    {
        "task": st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9),
        "num_keepers": values(8),
        "speed": FLOATS,
        "seed": values(64),
        "player_names": st.lists(st.text("abc_1", max_size=5), max_size=5),
        "config_json": st.text("{}", max_size=3),
    }
)
PERCEPTIONS = st.fixed_dictionaries(
    {
        "stamp": st.fixed_dictionaries({"sec": values(32, signed=True), "nanosec": values(32)}),
        "player_index": values(8),
        "cycle": values(32),
        "decision_due": st.booleans(),
        "neck_yaw": FLOATS,
        "positions": st.lists(FLOATS, max_size=5),
        "ages": st.lists(values(16), max_size=5),
        "cycles_to_ball": st.lists(values(16), max_size=5),
    }
)


def test_a_request_is_laid_out_as_worked_out_by_hand() -> None:
    data = REQUEST.encode(
        {"player_index": 2, "episode": 3, "cycle": 4, "action": 1, "target": 1,
         "action_values": [0.5]}
    )  # fmt: skip
    by_hand = (
        b"\x00\x01\x00\x00"  # CDR, little-endian
        b"\x02" b"\0\0\0"  # player_index, padding to 4
        b"\x03\0\0\0" b"\x04\0\0\0"  # episode, cycle
        b"\x01\x01" b"\0\0"  # action, target, padding to 4
        b"\x01\0\0\0" b"\0\0\0\0"  # one value, padding to 8 (counted from after the header)
        b"\x00\x00\x00\x00\x00\x00\xe0\x3f"  # 0.5
        b"\0\0\0\0\0\0\0\0"  # no match_id
    )  # fmt: skip
    assert data == by_hand


@settings(deadline=None)
@given(PERCEPTIONS)
def test_perceptions_are_read_by_ros_as_they_were_written(fields: dict[str, Any]) -> None:
    message = deserialize_message(PERCEPTION.encode(fields), keepaway_msgs.msg.Perception)
    stamp = {"sec": message.stamp.sec, "nanosec": message.stamp.nanosec}
    assert stamp == fields["stamp"]
    for name in ("player_index", "cycle", "decision_due", "neck_yaw"):
        assert getattr(message, name) == fields[name]
    for name in ("positions", "ages", "cycles_to_ball"):
        assert list(getattr(message, name)) == fields[name]


@settings(deadline=None)
@given(MATCHES)
def test_what_ros_writes_is_read_back(fields: dict[str, Any]) -> None:
    data = serialize_message(keepaway_msgs.msg.Match(**fields))
    assert codec("keepaway_msgs/msg/Match").decode(data).items() >= fields.items()


@settings(deadline=None)
@given(MATCHES)
def test_strings_are_written_as_ros_reads_them(fields: dict[str, Any]) -> None:
    match = deserialize_message(
        codec("keepaway_msgs/msg/Match").encode(fields), keepaway_msgs.msg.Match
    )
    assert {name: getattr(match, name) for name in fields} == fields


def test_messages_inside_messages_inside_sequences_are_read_by_ros() -> None:
    marker = {
        "ns": "ball", "id": 3, "pose": {"orientation": {"w": 1.0}}, "points": [{"x": 1.0}] * 2,
        "text": "three",
    }  # fmt: skip
    data = codec("visualization_msgs/msg/MarkerArray").encode({"markers": [marker, {}]})
    first, second = deserialize_message(data, MarkerArray).markers
    assert (first.ns, first.id, first.pose.orientation.w, first.text) == ("ball", 3, 1.0, "three")
    assert [point.x for point in first.points] == [1.0, 1.0]
    assert (second.ns, second.id) == ("", 0)


@pytest.mark.parametrize("name", TYPES)
def test_definitions_are_understood_by_rosbags_and_have_its_hash(name: str) -> None:
    full = f"keepaway_msgs/msg/{name}"
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(definition(full).split("=" * 80)[0], full))
    assert store.hash_rihs01(full) == type_hash(full)


def test_many_messages_are_written_and_read_at_once() -> None:
    lengths = {"positions": 4, "velocities": 4, "ages": 2, "cycles_to_ball": 1}
    lengths["header.frame_id"] = len(b"field\0")
    messages = PERCEPTION.empty(2, lengths)
    messages["player_index"] = [0, 1]
    messages["header.frame_id"] = b"field"
    messages["positions"] = [[1, 2, 3, 4], [5, 6, 7, 8]]
    one_by_one = [PERCEPTION.decode(row.tobytes()) for row in messages]
    assert [entry["player_index"] for entry in one_by_one] == [0, 1]
    assert one_by_one[1]["positions"] == [5, 6, 7, 8]
    assert one_by_one[1]["header"]["frame_id"] == "field"
    assert PERCEPTION.encode(one_by_one[1]) == messages[1].tobytes()
    assert PERCEPTION.lengths(one_by_one[0]) == lengths


def test_messages_are_whole_words_as_they_arrive_over_dds() -> None:
    lengths = {"positions": 12, "velocities": 12, "ages": 6, "cycles_to_ball": 5}
    lengths["header.frame_id"] = len(b"field\0")
    assert len(PERCEPTION.empty(1, lengths)[0].tobytes()) == 312
    assert len(PERCEPTION.encode({"cycles_to_ball": [1]})) % 4 == 0


def test_a_definition_of_another_age_is_read_by_its_own_text() -> None:
    old = codec("keepaway_msgs/msg/Episode", "uint32 number  # counts from 0\nfloat32 hold_time\n")
    assert old.decode(old.encode({"number": 5, "hold_time": 0.5})) == {
        "number": 5,
        "hold_time": 0.5,
    }


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"actoin": 1}, "has no field actoin"),
        ({"action": 256}, "cannot encode keepaway_msgs/msg/ActionRequest"),
        ({"action_values": ["much"]}, "cannot encode"),
    ],
)
def test_values_that_do_not_fit_are_refused(fields: dict[str, Any], complaint: str) -> None:
    with pytest.raises(KeepawayError, match=complaint):
        REQUEST.encode(fields)


@pytest.mark.parametrize(
    "data", [b"", b"\x00\x01\x00\x00\x01", b"\x00\x00\x00\x00" + bytes(40)], ids=len
)
def test_bytes_that_are_no_message_are_refused(data: bytes) -> None:
    with pytest.raises(KeepawayError, match="ActionRequest"):
        REQUEST.decode(data)


def test_a_string_is_where_its_length_says() -> None:
    status = codec("keepaway_msgs/msg/AgentStatus")
    said = {"name": "keeper_1", "policy": "hand", "episodes": 7, "match_id": 9}
    values = status.decode(status.encode(said))
    row = np.frombuffer(status.encode(said), status.dtype(status.lengths(values)))[0]
    assert (row["name"], row["name.length"], row["policy"]) == (b"keeper_1", 9, b"hand")
    assert (row["episodes"], row["match_id"]) == (7, 9)


def test_sequences_of_strings_have_no_fixed_place() -> None:
    with pytest.raises(KeepawayError, match=r"Match\.player_names has no fixed place"):
        codec("keepaway_msgs/msg/Match").dtype({})


def test_a_message_that_is_not_installed_is_named() -> None:
    with pytest.raises(KeepawayError, match=r"share/nowhere_msgs/msg/Nothing\.msg"):
        definition("nowhere_msgs/msg/Nothing")


def test_lengths_are_where_the_type_says() -> None:
    dtype = REQUEST.dtype({"action_values": 3})
    data = REQUEST.encode({"action_values": [1.0, 2.0, 3.0]})
    assert dtype.itemsize == len(data)
    row = np.frombuffer(data, dtype)[0]
    assert row["action_values.length"] == 3
    assert row["action_values"].tolist() == [1.0, 2.0, 3.0]
