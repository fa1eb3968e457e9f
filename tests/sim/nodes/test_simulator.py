"""The match's protocol over real DDS: nodes play what the trainer plays, whatever goes wrong."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from graph import Graph, played, trained
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from keepaway_msgs.msg import ActionRequest, AgentStatus, Episode, FieldState, Match
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.cli.options import ros_arguments
from keepaway_sim.errors import KeepawayError
from keepaway_sim.nodes.scoreboard import Scoreboard
from keepaway_sim.nodes.simulator import Simulator
from keepaway_sim.ros import publishing
from keepaway_sim.ros.publishing import ALL, LATCHED, QUEUE
from keepaway_sim.ros.raw_subscription import RawSubscription
from keepaway_sim.settings import changed
from keepaway_sim.task import Outcome
from keepaway_sim.world.config import CYCLE_TIME

SLOW_ENOUGH = 20.0  # [s] no answer is ever late
OUTCOME = 24  # place of a perception's outcome among its bytes
QUICK = 0.4  # [s] who does not answer is missing soon


@pytest.mark.parametrize("policy", ["random", "hold", "hand", "learn"])
def test_nodes_play_what_the_trainer_plays(graph: Graph, policy: str) -> None:
    graph.start_simulator(episodes=4, seed=11, answer_timeout=SLOW_ENOUGH)
    graph.start_players(policy=policy)
    expected = trained(4, seed=11, policy=policy)
    assert graph.play() == played(expected)
    if expected.keeper_weights is not None:
        for number, weights in enumerate(expected.keeper_weights):
            agent = graph.players[f"keeper_{number + 1}"].agent
            assert agent is not None
            np.testing.assert_array_equal(agent.learned("").values, weights)


def test_a_larger_task_is_played_the_same_too(graph: Graph) -> None:
    graph.start_simulator(task="4v3", episodes=2, answer_timeout=SLOW_ENOUGH)
    graph.start_players("4v3", policy="random")
    assert graph.play() == played(trained(2, policy="random", task="4v3"))


def test_it_waits_for_everybody_and_says_for_whom(graph: Graph) -> None:
    graph.start_simulator(episodes=1, answer_timeout=SLOW_ENOUGH)
    for name in ("keeper_1", "keeper_3", "taker_1", "taker_2"):
        graph.start_player(name)
    graph.play(until=lambda: graph.simulator.conductor.roster.absent == ["keeper_2"])
    assert graph.call(Trigger, "start").message == "waits for keeper_2"
    graph.start_player("keeper_2")
    assert graph.play() == played(trained(1))


def test_perceptions_that_are_lost_are_sent_again(
    graph: Graph, monkeypatch: pytest.MonkeyPatch
) -> None:
    say, count = publishing.MatchPublisher.publish, 0

    def lose_some(self: publishing.MatchPublisher, topic: str, data: bytes, time: int) -> None:
        nonlocal count
        is_in_play = topic.endswith("perception") and data[OUTCOME] == Outcome.IN_PLAY
        count += is_in_play
        if not is_in_play or count % 97:
            say(self, topic, data, time)

    monkeypatch.setattr(publishing.MatchPublisher, "publish", lose_some)
    graph.start_simulator(episodes=2, answer_timeout=SLOW_ENOUGH)
    graph.start_players(policy="random")
    assert graph.play() == played(trained(2, policy="random"))


def test_an_episode_whose_end_is_lost_teaches_nothing(
    graph: Graph, monkeypatch: pytest.MonkeyPatch
) -> None:
    say = publishing.MatchPublisher.publish

    def lose_ends(self: publishing.MatchPublisher, topic: str, data: bytes, time: int) -> None:
        is_an_end = topic == "keeper_1/perception" and data[OUTCOME] != Outcome.IN_PLAY
        if not is_an_end or graph.simulator.conductor.num_finished == 2:
            say(self, topic, data, time)

    monkeypatch.setattr(publishing.MatchPublisher, "publish", lose_ends)
    graph.start_simulator(episodes=3, answer_timeout=SLOW_ENOUGH)
    graph.start_players(policy="random")
    graph.play()
    agent, other = graph.players["keeper_1"].agent, graph.players["keeper_2"].agent
    assert agent is not None
    assert other is not None
    assert (agent.episodes, agent.cut_off, other.episodes) == (1, 2, 3)


def test_a_frozen_player_is_missing_and_joins_at_the_next_kick_off(graph: Graph) -> None:
    match = graph.start_simulator(episodes=3, answer_timeout=SLOW_ENOUGH).conductor
    graph.start_players(policy="random")
    frozen = graph.players["keeper_2"]
    graph.play(until=lambda: match.num_cycles >= 3)
    graph.executor.remove_node(frozen)
    patient, match.settings = match.settings, changed(match.settings, {"answer_timeout": QUICK})
    graph.play(until=lambda: "keeper_2" in match.roster.absent)
    match.settings = patient  # from now on nobody else is late, however busy the machine is
    graph.play(until=lambda: match.num_finished >= 1)
    assert "keeper_2" in match.roster.absent
    assert match.roster.seats[1].missed > 3
    graph.executor.add_node(frozen)
    graph.play()
    assert match.roster.absent == []
    assert [episode.number for episode in graph.episodes] == [0, 1, 2]


def test_strangers_cannot_move_a_player_or_stop_the_match(graph: Graph) -> None:
    simulator = graph.start_simulator(episodes=2, answer_timeout=SLOW_ENOUGH)
    graph.start_players(policy="random")
    stranger = graph.node.create_publisher(ActionRequest, "keeper_1/action_request", 10)
    lies = [
        ActionRequest(player_index=1),
        ActionRequest(episode=9),
        ActionRequest(cycle=10_000),
        ActionRequest(action=77),
        ActionRequest(action=ActionRequest.PASS_BALL, target=0),
        ActionRequest(action_values=[float("nan")]),
        ActionRequest(action_values=[0.0] * 10_000),
    ]

    def lie() -> None:
        if simulator.conductor.num_cycles % 10 == 0:
            stranger.publish(lies[simulator.conductor.num_cycles // 10 % len(lies)])

    health: list[DiagnosticArray] = []
    graph.node.create_subscription(DiagnosticArray, "/diagnostics", health.append, 10)
    graph.hook = lie
    assert graph.play() == played(trained(2, policy="random"))
    assert simulator.conductor.roster.seats[0].rejected > 0
    graph.spin_until(lambda: bool(health))
    assert health[-1].status[1].message == "2 nodes answer for it"


def test_a_stranger_with_perfect_requests_moves_nobody(graph: Graph, ros_domain: int) -> None:
    simulator = graph.start_simulator(episodes=6, answer_timeout=SLOW_ENOUGH)
    graph.start_players(policy="random")
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    stranger = Node("stranger", context=context)
    requests = stranger.create_publisher(ActionRequest, "keeper_1/action_request", 10)
    status = stranger.create_publisher(AgentStatus, "keeper_1/status", LATCHED)

    said: set[tuple[int, int]] = set()

    def meddle() -> None:
        seen = simulator.conductor.world.belief
        moment = int(seen.episode[0]), int(seen.cycle[0])
        if moment in said:
            return
        said.add(moment)
        now = dict(zip(("episode", "cycle"), moment, strict=True))
        requests.publish(ActionRequest(action=ActionRequest.HOLD_BALL, **now))
        if simulator.conductor.num_cycles % 10 == 0:
            status.publish(AgentStatus(name="keeper_1", ready=True, episodes=1000))

    graph.play(until=lambda: simulator.conductor.num_cycles >= 1)
    graph.spin_until(lambda: requests.get_subscription_count() > 0)
    graph.hook = meddle
    assert graph.play() == played(trained(6, policy="random"))
    assert simulator.conductor.roster.seats[0].rejected > 10
    stranger.destroy_node()
    context.shutdown()


def test_senders_are_known_by_the_graphs_own_identities(graph: Graph) -> None:
    heard: list[tuple[bytes, bytes]] = []
    subscription = RawSubscription(
        graph.node, Episode, "told", lambda *one: heard.append(one), QUEUE
    )
    publisher = graph.node.create_publisher(Episode, "told", QUEUE)
    numbers = [1, 3]
    for number in numbers:
        publisher.publish(Episode(number=number))
    graph.spin_until(lambda: len(heard) == 2)
    known = graph.node.get_publishers_info_by_topic("told")[0].endpoint_gid
    assert {gid for _, gid in heard} == {bytes(known)}
    assert [deserialize_message(data, Episode).number for data, _ in heard] == numbers
    graph.node.remove_waitable(subscription)
    subscription.destroy()


def test_a_match_ends_when_ros_is_shut_down(ros_domain: int) -> None:
    context = Context()
    context.init(domain_id=ros_domain)
    spins: list[float] = []

    def spin(timeout: float) -> None:
        spins.append(timeout)
        context.try_shutdown()

    simulator = Simulator(context=context)
    simulator.play(spin)
    simulator.destroy_node()  # the next test's simulator would hear its match
    assert len(spins) == 1


def test_it_pauses_starts_and_resets_on_demand(graph: Graph) -> None:
    simulator = graph.start_simulator(autostart=False, answer_timeout=SLOW_ENOUGH)
    graph.start_players()
    graph.play(until=lambda: not simulator.conductor.roster.absent)
    assert simulator.conductor.num_cycles == 0
    assert graph.call(Trigger, "start").message == "plays"
    graph.play(until=lambda: simulator.conductor.num_cycles >= 3)
    assert graph.call(Trigger, "simulator/pause").success
    cycles = simulator.conductor.num_cycles
    until = time.monotonic() + 0.3
    graph.play(until=lambda: time.monotonic() > until)
    assert simulator.conductor.num_cycles <= cycles + 1
    assert graph.call(Trigger, "start").success
    assert graph.call(Trigger, "simulator/reset").success
    graph.play(until=lambda: simulator.conductor.num_finished >= 1)
    assert graph.episodes[0].outcome == Episode.ABORTED


@pytest.mark.parametrize(
    ("parameters", "why"),
    [
        ({"task": "3x2"}, "3x2"),
        ({"field": "5x5"}, "field_length=5"),
        ({"profile": "1999"}, "1999"),
        ({"speed": -1.0}, "speed=-1"),
        ({"seed": -1}, "seed=-1"),
        ({"answer_timeout": 0.0}, "answer_timeout=0"),
        ({"visible_angle": 400.0}, "visible_angle_deg=400"),
        ({"ball_decay": 1.5}, "ball_decay=1.5"),
    ],
)
def test_parameters_that_make_no_match_are_refused(
    graph: Graph, parameters: dict[str, object], why: str
) -> None:
    with pytest.raises(KeepawayError, match=why):
        graph.start_simulator(**parameters)


def test_only_the_tempo_changes_during_a_match(graph: Graph) -> None:
    simulator = graph.start_simulator()

    def set_to(name: str, value: float) -> bool:
        parameter = Parameter(name, value=value).to_parameter_msg()
        done = graph.call(SetParameters, "simulator/set_parameters", parameters=[parameter])
        return bool(done.results[0].successful)

    assert set_to("speed", 2.0)
    assert simulator.conductor.settings.speed == 2.0
    assert not set_to("speed", -1.0)
    assert not set_to("ball_decay", 0.5)
    assert simulator.conductor.settings.speed == 2.0


def test_real_time_and_its_multiples_are_kept(graph: Graph) -> None:
    simulator = graph.start_simulator(speed=4.0, answer_timeout=SLOW_ENOUGH)
    graph.start_players()
    graph.play(until=lambda: simulator.conductor.num_cycles >= 1)
    began, first = time.monotonic(), simulator.conductor.num_cycles
    graph.play(until=lambda: simulator.conductor.num_cycles >= first + 40)
    assert (
        time.monotonic() - began > 40 * CYCLE_TIME / 4.0 - 2 * CYCLE_TIME
    )  # one is caught up with


def test_spectators_may_come_late_and_see_everything(graph: Graph) -> None:
    match = graph.start_simulator(seed=4, answer_timeout=SLOW_ENOUGH).conductor
    graph.start_players()
    graph.play(until=lambda: match.num_finished >= 1)
    seen: dict[str, list[Any]] = {}
    for topic, message, qos in (
        ("match", Match, LATCHED),
        ("/clock", Clock, 10),
        ("field_state", FieldState, 10),
        ("markers", MarkerArray, 10),
        ("/diagnostics", DiagnosticArray, 10),
    ):
        graph.node.create_subscription(message, topic, seen.setdefault(topic, []).append, qos)
    graph.play(until=lambda: all(seen.values()) and len(seen["/clock"]) > 1)
    told, state = seen["match"][0], seen["field_state"][-1]
    assert (told.task, told.seed, told.player_names[-1]) == ("3v2", 4, "taker_2")
    assert len(state.positions) == 12
    assert {seen["/clock"][k].clock.nanosec % 100_000_000 for k in (0, -1)} == {0}
    assert state.stamp != Time()
    health = seen["/diagnostics"][-1]
    assert [status.name for status in health.status][:2] == ["/simulator", "/keeper_1"]
    assert health.status[1].message == "plays"


def test_it_writes_its_own_bag(graph: Graph, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    simulator = graph.start_simulator(episodes=1, record=str(bag), answer_timeout=SLOW_ENOUGH)
    graph.start_players(policy="random")
    [(cycles, _)] = graph.play()
    simulator.close()
    reader = BagReader(bag)
    counts = dict.fromkeys(reader.topics, 0)
    for message in reader.messages():
        counts[message.topic] += 1
    assert counts["/match"] == counts["/episode"] == 1
    assert (
        counts["/clock"] == counts["/field_state"] == counts["/keeper_1/perception"] == cycles + 1
    )
    assert counts["/taker_2/action_request"] == cycles
    assert counts["/keeper_3/status"] == 2


def test_another_simulator_is_refused_and_with_force_disturbs_nobody(
    graph: Graph, tmp_path: Path
) -> None:
    simulator = graph.start_simulator(episodes=4, seed=3, answer_timeout=SLOW_ENOUGH)
    board = graph.add(Scoreboard(4, simulator.conductor.match_id, context=graph.context))
    graph.start_players(policy="random")
    graph.play(until=lambda: simulator.conductor.num_cycles >= 3)

    def another(**parameters: object) -> Simulator:
        arguments = ros_arguments({"seed": 9, **parameters}, "simulator")
        return Simulator(context=graph.context, cli_args=arguments, use_global_arguments=False)

    bag = tmp_path / "bag"
    refused = graph.add(another(record=str(bag)))
    with pytest.raises(KeepawayError, match="another simulator publishes `match` here"):
        refused.play(graph.spin)
    assert bag.is_dir()
    refused.close()
    assert not bag.exists()  # the same command can be given again, elsewhere
    forced = graph.add(another(force=True))
    stray = graph.node.create_publisher(Episode, "episode", ALL)
    for number in range(10):
        stray.publish(Episode(number=number, duration=99.0))
    expected = played(trained(4, seed=3, policy="random"))
    graph.play()
    graph.spin_until(lambda: board.next_episode >= 4 and board.num_ignored >= 10)
    own = board.summary()
    assert list(zip(own["episode_cycles"], own["episode_outcomes"], strict=True)) == expected
    assert forced.conductor.num_cycles == 0
    assert {player.agent.episodes for player in graph.players.values() if player.agent} == {4}


def test_a_player_joins_the_other_match_once_its_own_simulator_is_gone(
    graph: Graph, ros_domain: int
) -> None:
    first = Graph(ros_domain)
    first.start_simulator(seed=1)
    keeper = graph.start_player("keeper_1")
    graph.spin_until(lambda: keeper.agent is not None)
    second = graph.start_simulator(seed=9, force=True)
    graph.spin_until(lambda: graph.node.count_publishers("match") == 2)
    graph.spin_until(lambda: keeper.count_publishers("match") == 2)
    assert keeper.agent is not None
    assert keeper.agent.facts.seed == 1
    assert "keeper_1" in second.conductor.roster.absent
    first.close()
    graph.spin_until(lambda: keeper.agent is not None and keeper.agent.facts.seed == 9)
    graph.spin_until(lambda: "keeper_1" not in second.conductor.roster.absent)
