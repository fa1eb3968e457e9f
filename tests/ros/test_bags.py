"""Recorder and replayer as processes over DDS: what is said is recorded, and said again."""

import itertools
import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import layouts
import pytest
from graph import PATIENCE, Graph
from recorded import record_match
from rosbags.highlevel import AnyReader

from keepaway_agent.actions import Role
from keepaway_agent.nodes.player import PlayerNode
from keepaway_msgs.msg import ActionRequest, FieldState, Match
from keepaway_sim.bags.gaps import count_gaps
from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.cli.options import ros_arguments
from keepaway_sim.nodes.recorder import Recorder
from keepaway_sim.nodes.replayer import Replayer
from keepaway_sim.nodes.spectator import Spectator
from keepaway_sim.ros.publishing import LATCHED
from keepaway_sim.task import Task
from keepaway_sim.view.server import Server

ROOT = Path(__file__).resolve().parents[2]
START_TIMEOUT = 60.0  # [s]


@pytest.fixture(scope="session")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_match(tmp_path_factory.mktemp("bags") / "match", "3v2", seed=3, episodes=3)


@contextmanager
def recording(path: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """scripts/record.py at work; told to end (SIGINT) when the block is left."""
    command = [sys.executable, str(ROOT / "scripts/record.py"), str(path), *arguments]
    process = subprocess.Popen(command)
    until = time.monotonic() + START_TIMEOUT
    while not list(path.glob("*.mcap")) and time.monotonic() < until:
        assert process.poll() is None
        time.sleep(0.05)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(30)


def replay(bag: Path, *arguments: str) -> str:
    """scripts/replay.py, to its end."""
    return subprocess.run(
        [sys.executable, str(ROOT / "scripts/replay.py"), str(bag), *arguments],
        capture_output=True,
        text=True,
        check=True,
        timeout=900,
    ).stdout


def by_topic(bag: Path, prefix: str = "") -> dict[str, list[bytes]]:
    said: dict[str, list[bytes]] = {}
    for message in BagReader(bag).messages():
        name = message.topic.removeprefix(prefix)
        said.setdefault(name, []).append(message.data)
    return said


@pytest.mark.usefixtures("ros_domain")
@pytest.mark.parametrize("rate", ["0", "20"])
def test_a_replay_says_byte_for_byte_what_was_recorded(
    bag: Path, tmp_path: Path, rate: str
) -> None:
    with recording(tmp_path / "again") as recorder:
        said = replay(bag, "--rate", rate, "--wait-for-subscribers", "14", "--start-delay", "1")
    assert recorder.returncode == 0
    assert said == f"published {BagReader(bag).message_count} messages\n"
    assert by_topic(tmp_path / "again") == by_topic(bag)
    info = BagReader(tmp_path / "again").info
    assert info["gaps"].startswith("nothing is missing")
    assert not any(json.loads(info["missing"]).values())


@pytest.mark.usefixtures("ros_domain")
def test_a_topic_that_ros_cannot_have_is_left_out(bag: Path, tmp_path: Path) -> None:
    messages = layouts.read(bag)
    episode = next(said for said in messages if said.topic == "/episode")
    odd = [episode._replace(topic=name) for name in ("/a b", "/\x1b[31mred", "episode//", "/7")]
    path = layouts.write(tmp_path / "odd.mcap", [*messages, *odd])
    said = replay(path, "--rate", "0", "--start-delay", "0")
    assert said == f"published {len(messages)} messages\n"


def test_players_with_odd_names_are_not_listened_to(graph: Graph, tmp_path: Path) -> None:
    recorder = start_recorder(graph, tmp_path / "heard")
    publisher = graph.node.create_publisher(Match, "match", LATCHED)
    publisher.publish(Match(task="1v1", num_keepers=1, player_names=["a b", "\x1b[31m"]))
    graph.spin_until(lambda: recorder.poll() > 0)
    assert recorder.gaps.topics == {}
    assert recorder.finish() == "no perception and no state was recorded"
    recorder.destroy_node()


def test_bytes_that_are_no_message_are_not_recorded_and_end_no_recorder(
    graph: Graph, tmp_path: Path
) -> None:
    recorder = start_recorder(graph, tmp_path / "heard")
    odd = graph.node.create_publisher(FieldState, "field_state", 10)
    latched = graph.node.create_publisher(Match, "match", LATCHED)
    graph.spin_until(lambda: odd.get_subscription_count() > 0)
    odd.publish(bytes([0, 1, 0, 0, 7]))
    latched.publish(bytes([0, 1, 0, 0, 7]))
    taken = itertools.accumulate(iter(recorder.poll, None))
    graph.spin_until(lambda: next(taken) == 2)
    assert recorder.finish() == "no perception and no state was recorded"
    assert BagReader(tmp_path / "heard").message_count == 0
    recorder.destroy_node()


def start_recorder(graph: Graph, path: Path, **parameters: object) -> Recorder:
    arguments = ros_arguments({"path": str(path), **parameters}, "recorder")
    return Recorder(context=graph.context, cli_args=arguments, use_global_arguments=False)


def clean_request(data: bytes) -> bytes:
    """An ActionRequest's bytes with its padding zeroed.

    ROS's serialiser leaves there what was in memory: equal matches differ in these bytes.
    """
    clean = bytearray(data)
    clean[5:8] = bytes(3)  # after player_index
    clean[18:20] = bytes(2)  # after target
    if len(clean) > 24:
        clean[24:28] = bytes(4)  # before the action values and the match's number
    return bytes(clean)


def said_by_the_match(bag: Path) -> dict[str, list[bytes]]:
    """All but what players say of themselves, which they say more often than the bag needs."""
    return {
        topic: [clean_request(data) for data in said] if topic.endswith("request") else said
        for topic, said in by_topic(bag).items()
        if not topic.endswith("/status")
    }


def test_a_recorder_has_what_the_simulator_wrote_itself(graph: Graph, tmp_path: Path) -> None:
    recorder = start_recorder(graph, tmp_path / "heard")

    def listen() -> None:
        recorder.poll()

    graph.hook = listen
    graph.start_simulator(episodes=2, seed=3, record=str(tmp_path / "said"), wait_for_recorder=True)
    graph.start_players(policy="random")
    graph.play()
    graph.simulator.close()
    assert recorder.finish().startswith("nothing is missing of ")
    recorder.destroy_node()
    assert said_by_the_match(tmp_path / "heard") == said_by_the_match(tmp_path / "said")
    with AnyReader([tmp_path / "heard"]) as theirs:
        assert theirs.message_count == BagReader(tmp_path / "heard").message_count


def test_in_lock_step_the_simulator_waits_for_its_recorder(graph: Graph, tmp_path: Path) -> None:
    recorder = start_recorder(graph, tmp_path / "bag")
    furthest: list[int] = []

    def poll_rarely() -> None:
        """Only when the simulator has waited a while."""
        lag = graph.simulator.conductor.recorder_lag
        furthest.append(lag)
        if (
            lag > 50
            or not graph.simulator.conductor.recorders.num_reporting
            or furthest[-100:] == [lag] * 100
        ):
            recorder.poll()

    graph.hook = poll_rarely
    graph.start_simulator(episodes=3, seed=3, wait_for_recorder=True, answer_timeout=PATIENCE)
    graph.start_players(policy="hold")
    graph.play()
    assert recorder.finish().startswith("nothing is missing of ")
    recorder.destroy_node()
    assert max(furthest) == 51  # one more than it may be behind: then it waits
    assert len(list(MatchBag(tmp_path / "bag").episodes())) == 3


def test_a_recorder_is_ready_only_when_every_players_requests_come(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("keepaway_sim.nodes.recorder.LONGEST_FIRST_WAIT", PATIENCE)
    recorder = start_recorder(graph, tmp_path / "bag")

    def listen() -> None:
        recorder.poll()

    graph.hook = listen
    graph.start_simulator(episodes=1, seed=3, wait_for_recorder=True)
    names = Task.parse("3v2").player_names

    def num_reporting() -> int:
        return graph.simulator.conductor.recorders.num_reporting

    for name in names[:-1]:
        graph.start_player(name)
    graph.play(lambda: len(recorder.gaps.topics) > 1)  # it knows the match
    until = time.monotonic() + 1.0
    graph.play(lambda: time.monotonic() > until)
    assert num_reporting() == 0
    graph.start_player(names[-1])
    graph.play()
    assert num_reporting() == 1
    assert recorder.finish().startswith("nothing is missing of ")
    recorder.destroy_node()


def test_of_several_recorders_it_waits_for_the_slowest(graph: Graph, tmp_path: Path) -> None:
    recorders = [start_recorder(graph, tmp_path / f"bag_{n}", history=60) for n in range(2)]
    turns = iter(range(10**9))

    def poll_the_second_rarely() -> None:
        recorders[0].poll()
        if graph.simulator.conductor.recorders.num_reporting < 2 or next(turns) % 500 == 0:
            recorders[1].poll()

    graph.hook = poll_the_second_rarely
    graph.start_simulator(episodes=2, seed=3, wait_for_recorder=True, answer_timeout=PATIENCE)
    graph.start_players(policy="hold")
    graph.play()
    for recorder in recorders:
        assert recorder.finish().startswith("nothing is missing of ")
        recorder.destroy_node()
    assert by_topic(tmp_path / "bag_0") == by_topic(tmp_path / "bag_1")


def test_what_a_recorder_loses_it_names(graph: Graph, tmp_path: Path) -> None:
    recorder = start_recorder(graph, tmp_path / "bag", history=5)
    polls = iter(range(10**9))

    def poll_too_rarely() -> None:
        if graph.simulator.conductor.num_cycles == 0 or next(polls) % 300 == 0:
            recorder.poll()

    graph.hook = poll_too_rarely
    graph.start_simulator(episodes=2, seed=3)
    graph.start_players()
    graph.play()
    report = recorder.finish()
    missing = {topic: count for topic, count in recorder.gaps.missing().items() if count}
    recorder.destroy_node()
    assert missing
    for topic, count in missing.items():
        assert f"{topic} misses {count} cycles" in report
    info = BagReader(tmp_path / "bag").info
    assert json.loads(info["missing"]) == recorder.gaps.missing()
    assert count_gaps(MatchBag(tmp_path / "bag")).missing() == recorder.gaps.missing()


def test_a_keeper_fed_from_a_bag_answers_what_it_answered(graph: Graph, tmp_path: Path) -> None:
    graph.start_simulator(episodes=2, seed=8, record=str(tmp_path / "bag"))
    graph.start_players(policy="learn")
    graph.play()
    graph.simulator.close()
    recorded = said_by_the_match(tmp_path / "bag")["/keeper_2/action_request"]

    settings = {"path": str(tmp_path / "bag"), "rate": 50.0, "start_delay": 1.0,
                "topics": "match,keeper_2/perception", "wait_for_subscribers": 2}  # fmt: skip
    own: dict[str, Any] = {"context": graph.context, "use_global_arguments": False}
    replayer = graph.add(Replayer(cli_args=ros_arguments(settings, "replayer", "/again"), **own))
    answers: list[bytes] = []
    graph.node.create_subscription(
        ActionRequest, "/again/keeper_2/action_request",
        lambda data: answers.append(clean_request(data)), 100, raw=True,
    )  # fmt: skip
    learner = ros_arguments({"policy": "learn"}, "keeper_2", "/again")
    graph.add(PlayerNode(Role.KEEPER, cli_args=learner, **own))
    count = replayer.play(graph.executor.spin_once)
    assert count == 1 + BagReader(tmp_path / "bag").counts["/keeper_2/perception"]
    graph.spin_until(lambda: len(answers) >= len(recorded))
    assert answers == recorded


def test_a_live_page_is_told_what_nodes_say(graph: Graph, tmp_path: Path) -> None:
    server = Server()
    spectator = Spectator(
        server.match, context=graph.context, cli_args=[], use_global_arguments=False
    )

    def was_told() -> bool:
        spectator.poll()
        return len(server.match.history) == 3  # the match and two episodes

    graph.start_simulator(episodes=2, seed=3, record=str(tmp_path / "bag"))
    graph.start_players()
    with server.browser() as events:
        graph.play(until=was_told)
        graph.spin_until(was_told)
        kinds = [kind for kind, _ in events.queue]
    graph.simulator.close()
    spectator.destroy_node()
    server.close()
    assert kinds[0] == "match"
    assert kinds.count("episode") == 2
    assert kinds.count("frame") >= 4
    told = [json.loads(data) for kind, data in server.match.history if kind == "episode"]
    expected = list(MatchBag(tmp_path / "bag").episodes())
    assert [entry["outcome"] for entry in told] == [episode.outcome for episode in expected]
