"""What the packages' READMEs say of each node's parameters, topics and services is what it has."""

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest
from graph import Graph
from rclpy.node import Node
from recorded import record_match

from keepaway_agent.actions import Role
from keepaway_agent.nodes.player import PlayerNode
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.cli.options import ros_arguments
from keepaway_sim.nodes.recorder import Recorder
from keepaway_sim.nodes.replayer import Replayer
from keepaway_sim.nodes.scoreboard import Scoreboard
from keepaway_sim.nodes.simulator import Simulator
from keepaway_sim.nodes.spectator import Spectator
from keepaway_sim.task import Task
from keepaway_sim.view.live import LiveMatch
from keepaway_sim.world.config import Config
from keepaway_transfer.nodes.transfer import TransferNode

SRC = Path(__file__).resolve().parents[2] / "src"
EVERY_NODE_HAS = ("use_sim_time", "start_type_description_service")
OF_EVERY_NODE = ("rcl_interfaces/", "type_description_interfaces/")


class Documented(NamedTuple):
    """A node and what is written about it."""

    make: Callable[..., Node]
    readme: str
    headings: tuple[str, ...]
    path: str = ""  # of a bag, where it takes one
    player: str = ""  # whose node it is, where topics begin with NAME; else all players'
    hears_match: bool = False  # before it listens to players


NODES = {
    "simulator": Documented(Simulator, "keepaway_sim", ("The simulator's node",)),
    "recorder": Documented(
        Recorder, "keepaway_sim", ("The recorder's node",), "bag", hears_match=True
    ),
    "replayer": Documented(Replayer, "keepaway_sim", ("The replayer's node",), "recorded"),
    "scoreboard": Documented(Scoreboard, "keepaway_sim", ("The scoreboard's node",)),
    "spectator": Documented(
        partial(Spectator, LiveMatch(lambda *said: None)),
        "keepaway_sim",
        ("The spectator's node",),
        hears_match=True,
    ),
    **{
        f"{role.name.lower()}_1": Documented(
            partial(PlayerNode, role),
            "keepaway_agent",
            ("What a player learns with", "The players' nodes: keeper and taker"),
            player=f"{role.name.lower()}_1",
        )
        for role in Role
    },
    "transfer": Documented(TransferNode, "keepaway_transfer", ("The transfer node",)),
}


TABLE = r"^\| {} \|.*\n\|[-|]+\n((?:\|.*\n?)+)"


def rows(documented: Documented, kind: str) -> dict[str, list[str]]:
    """The rows of the tables whose first column is headed `kind`: first cell -> the others."""
    text = (SRC / documented.readme / "README.md").read_text()
    sections = dict(part.split("\n", 1) for part in text.split("\n## ")[1:])
    found: dict[str, list[str]] = {}
    for heading in documented.headings:
        for table in re.findall(
            rf"^\| {kind} \|.*\n\|[-|]+\n((?:\|.*\n?)+)", sections[heading], re.M
        ):
            for line in table.splitlines():
                first, *others = (cell.strip() for cell in line.strip("|").split("|"))
                found[first.replace("`", "")] = others
    return found


@pytest.fixture
def start(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[[str], Node]]:
    """A node by its name, where a match is described if it needs one."""
    monkeypatch.chdir(tmp_path)
    started: list[Node] = []

    def start(name: str) -> Node:
        documented = NODES[name]
        if name == "replayer":
            record_match(tmp_path / "recorded", "3v2", seed=1, episodes=1)
        if documented.hears_match:
            graph.start_simulator()
        arguments = ros_arguments({"path": documented.path} if documented.path else {})
        node = documented.make(
            context=graph.context, cli_args=arguments, use_global_arguments=False
        )
        started.append(node)
        if not isinstance(node, Recorder | Spectator):  # who take their messages themselves
            graph.add(node)
        if documented.hears_match:
            graph.spin_until(lambda: _knows_players(node))
        return node

    yield start
    for node in started:
        if isinstance(node, Recorder):
            node.finish()


def _knows_players(node: Node) -> bool:
    """Whether a node that hears a match has heard who plays; some take what has come themselves."""
    if isinstance(node, Recorder | Spectator):
        node.poll()
    return any("keeper_1" in subscription.topic_name for subscription in node.subscriptions)


def _topics(node: Node, direction: str) -> dict[str, str]:
    """Topics that a node publishes or subscribes to, and their types as package/Name."""
    ask = {
        "publishes": node.get_publisher_names_and_types_by_node,
        "subscribes to": node.get_subscriber_names_and_types_by_node,
    }[direction]
    return _own(ask(node.get_name(), node.get_namespace()))


def _own(found: Sequence[tuple[str, Sequence[str]]]) -> dict[str, str]:
    """Names and types without those that every node has."""
    return {
        name: re.sub("/(msg|srv)/", "/", types[0])
        for name, types in found
        if not types[0].startswith(OF_EVERY_NODE)
    }


@pytest.mark.parametrize("name", NODES)
def test_parameters_and_their_defaults(start: Callable[[str], Node], name: str) -> None:
    node, documented = start(name), rows(NODES[name], "parameter")
    of_world = documented.pop("every field of config.py", None)
    constants = Config().to_dict() if of_world else {}
    world = {name for group in constants.values() if isinstance(group, dict) for name in group}
    declared = {
        name: node.get_parameter(name).value
        for name in node.get_parameters_by_prefix("")
        if name not in (*EVERY_NODE_HAS, *world)
    }
    assert declared.keys() == documented.keys()
    for parameter, (default, unit, _, meaning) in documented.items():
        if parameter != "path":
            value = declared[parameter]
            assert default == (str(value).lower() if isinstance(value, bool) else str(value))
        assert meaning
        assert unit or not isinstance(declared[parameter], float)


@pytest.mark.parametrize("name", [name for name in NODES if name != "replayer"])
def test_topics_and_their_types(start: Callable[[str], Node], name: str) -> None:
    node, documented = start(name), rows(NODES[name], "topic")
    names = [NODES[name].player] if NODES[name].player else Task().player_names
    for direction in ("publishes", "subscribes to"):
        assert _topics(node, direction) == {
            "/" + topic.replace("NAME", player).lstrip("/"): message_type
            if "/" in message_type
            else f"keepaway_msgs/{message_type}"
            for topic, (message_type, told, _) in documented.items()
            for player in names
            if direction in told.split(",")[0].split(" and ")
        }


def test_the_replayers_topics_are_those_of_the_bag(start: Callable[[str], Node]) -> None:
    node = start("replayer")
    assert _topics(node, "publishes").keys() == BagReader("recorded").topics.keys()


@pytest.mark.parametrize("name", NODES)
def test_services_and_their_types(start: Callable[[str], Node], name: str) -> None:
    node, documented = start(name), rows(NODES[name], "service")
    found = node.get_service_names_and_types_by_node(node.get_name(), node.get_namespace())
    player = NODES[name].player
    assert _own(found) == {
        "/" + service.replace("NAME", player): cells[0] for service, cells in documented.items()
    }
