"""The players of a recorded match decide the same again, learners and all they learned included."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded import record_agents

from keepaway_agent.checks.decisions import check_decisions, recorded_agents
from keepaway_agent.learning.weights import write_weights
from keepaway_agent.playing.agent import Agent
from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.verify import check_world
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.errors import KeepawayError
from keepaway_sim.wire.messages import ACTION_REQUEST, action_request, read_request

LEARNERS: dict[str, dict[str, Any]] = {
    "keeper_1": {"policy": "learn"},
    "keeper_2": {"policy": "learn", "epsilon": 0.3, "lambda_": 0.5},
    "keeper_3": {"policy": "random"},
    "taker_1": {"policy": "learn"},
    "taker_2": {"policy": "hand"},
}


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_agents(tmp_path_factory.mktemp("bags") / "agents", LEARNERS, 5, episodes=6)


def copied(bag: Path, path: Path, agents: dict[str, dict[str, Any]]) -> Path:
    """The same recording, of a match that is said to have been played by others."""
    reader = BagReader(bag)
    with BagWriter(path, {**reader.info, "agents": json.dumps(agents)}) as copy:
        for m in reader.messages():
            copy.write(m.topic, m.message_type, m.data, m.log_time)
    return path


def test_world_and_players_do_it_again(bag: Path) -> None:
    recorded = sum(
        count for topic, count in BagReader(bag).counts.items() if topic.endswith("action_request")
    )
    assert check_decisions(MatchBag(bag)) == (6, recorded, None)
    assert check_world(MatchBag(bag)).difference is None


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("keeper_1", {"policy": "hand"}),
        ("keeper_1", {"policy": "learn", "alpha": 0.25}),
        ("keeper_2", {"policy": "learn", "epsilon": 0.3, "lambda_": 0.0}),
        ("taker_1", {"policy": "random"}),
    ],
)
def test_another_player_is_found_out(
    bag: Path, tmp_path: Path, name: str, settings: dict[str, object]
) -> None:
    other = copied(bag, tmp_path / "other", {**LEARNERS, name: settings})
    difference = check_decisions(MatchBag(other)).difference
    assert difference is not None
    assert difference.what.endswith(f"of {name}")


def test_a_changed_request_is_found(bag: Path, tmp_path: Path) -> None:
    reader = BagReader(bag)
    with BagWriter(tmp_path / "changed", reader.info) as changed:
        for m in reader.messages():
            data = m.data
            if m.topic == "/taker_2/action_request" and m.log_time == 1_000_000_000:
                asked = read_request(data)
                data = action_request(asked._replace(action=4, target=(asked.target + 1) % 3))
            changed.write(m.topic, m.message_type, data, m.log_time)
    difference = check_decisions(MatchBag(tmp_path / "changed")).difference
    assert difference == ("the action of taker_2", 0, 10)


def test_players_begin_with_the_weights_in_the_bag(bag: Path, tmp_path: Path) -> None:
    agent: Agent = recorded_agents(MatchBag(bag))[0]
    agent.learners.weights[:] = 0.25
    file = io.BytesIO()
    write_weights(file, agent.learned("keeper_1"))
    with BagWriter(tmp_path / "bag", BagReader(bag).info) as copy:
        copy.attach("keeper_1.npz", file.getvalue())
        first = next(BagReader(bag).messages())
        copy.write(first.topic, first.message_type, first.data, first.log_time)
    begun = recorded_agents(MatchBag(tmp_path / "bag"))
    assert (begun[0].learned("keeper_1").values == 0.25).all()
    assert np.count_nonzero(begun[1].learned("keeper_2").values) == 0


def test_a_bag_that_does_not_say_who_played_is_refused(bag: Path, tmp_path: Path) -> None:
    reader = BagReader(bag)
    with BagWriter(tmp_path / "bag") as silent:
        for m in reader.messages(end=1):
            silent.write(m.topic, m.message_type, m.data, m.log_time)
    with pytest.raises(KeepawayError, match="does not say who played"):
        check_decisions(MatchBag(tmp_path / "bag"))


def test_requests_that_were_not_recorded_are_not_compared(bag: Path, tmp_path: Path) -> None:
    reader = BagReader(bag)
    with BagWriter(tmp_path / "bag", reader.info) as silent:
        for m in reader.messages():
            if m.message_type != ACTION_REQUEST:
                silent.write(m.topic, m.message_type, m.data, m.log_time)
    assert check_decisions(MatchBag(tmp_path / "bag")).difference is None
