"""What players read and write as bytes is what ROS itself reads and writes."""

import math
from array import array

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from keepaway_agent.errors import AgentError
from keepaway_agent.nodes.conversions import match_facts, read_perception, write_request
from keepaway_agent.playing.agent import Decision
from keepaway_msgs.msg import ActionRequest, Match, Perception

SIZES = [2, 3, 4, 5, 7, 9, 10, 22]


def perception(num_players: int, **changes: object) -> Perception:
    """One with a different number in every place."""
    numbers = np.random.default_rng(num_players).normal(size=4 * (num_players + 1))
    made = Perception(
        player_index=1,
        episode=70_000,
        cycle=123,
        outcome=Perception.TAKEN_AWAY,
        decision_due=True,
        ball_kickable=True,
        body_yaw=1.5,
        neck_yaw=-0.5,
        positions=array("d", numbers[: 2 * (num_players + 1)]),
        velocities=array("d", numbers[2 * (num_players + 1) :]),
        ages=array("H", range(100, 101 + num_players)),
        cycles_to_ball=array("H", [65535 - player for player in range(num_players)]),
    )
    for name, value in changes.items():
        setattr(made, name, value)
    return made


@pytest.mark.parametrize("num_players", SIZES)
def test_a_perception_is_read_as_ros_wrote_it(num_players: int) -> None:
    message = perception(num_players)
    read = read_perception(serialize_message(message), num_players, index=1)
    assert (read.episode, read.outcome, read.decision_due) == (70_000, 1, True)
    assert (read.view.cycle, read.view.ball_kickable) == (123, True)
    assert read.view.position.ravel().tolist() == message.positions.tolist()
    assert read.view.age.tolist() == message.ages.tolist()
    assert read.view.cycles_to_ball.tolist() == message.cycles_to_ball.tolist()


@pytest.mark.parametrize("values", [[], [1.5], [0.1, -2.0, 3e300]])
def test_a_request_is_written_as_ros_reads_it(values: list[float]) -> None:
    perceived = read_perception(serialize_message(perception(5)), 5, index=1)
    data = write_request(1, perceived, Decision(1, 2, np.array(values)))
    expected = ActionRequest(
        player_index=1, episode=70_000, cycle=123, action=1, target=2, action_values=values
    )
    assert deserialize_message(data, ActionRequest) == expected


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"player_index": 2}, "of player 2"),
        ({"outcome": 9}, "outcome 9"),
        ({"positions": array("d", [math.nan] * 12)}, "not finite"),
        ({"positions": array("d", [math.inf] * 12)}, "not finite"),
        ({"positions": array("d", [0.0] * 14)}, "bytes"),
        ({"ages": array("H", [0] * 60_000)}, "bytes"),
        ({"positions": array("d", [0.0] * 10), "velocities": array("d", [0.0] * 14)}, "not the"),
    ],
)
def test_a_perception_that_no_such_player_can_have_is_refused(
    change: dict[str, object], why: str
) -> None:
    with pytest.raises(AgentError, match=why):
        read_perception(serialize_message(perception(5, **change)), 5, index=1)


def test_any_bytes_are_a_perception_or_refused() -> None:
    whole = serialize_message(perception(5))
    random = np.random.default_rng(0)
    for size in range(len(whole) + 8):
        garbled = bytearray(random.bytes(size))
        garbled[:4] = b"\0\1\0\0"
        for data in (whole[:size], bytes(garbled)):
            if data != whole:
                with pytest.raises(AgentError):
                    read_perception(data, 5, index=1)


def test_a_match_in_which_nobody_can_play_is_refused() -> None:
    with pytest.raises(AgentError, match="1 keepers v 2 takers"):
        match_facts(Match(num_keepers=1, num_takers=2))
