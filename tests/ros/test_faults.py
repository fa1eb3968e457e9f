"""Nodes that die or freeze, disks that are full: the match continues, and nothing saved is lost."""

import json
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from graph import Graph, played, trained

from keepaway_agent.learning.weights import load_weights
from keepaway_sim.bags.repair import repair
from keepaway_sim.errors import KeepawayError

ROOT = Path(__file__).resolve().parents[2]
PATIENT = {"answer_timeout": 20.0}


def test_faults_at_random_moments_lose_nothing(ros_domain: int) -> None:
    options = [
        "--faults",
        "8",
        "--simulator-share",
        "0.5",
        "--kill-share",
        "0.5",
        "--domain",
        str(ros_domain),
        "--json",
    ]
    command = [sys.executable, str(ROOT / "scripts" / "checks" / "faults.py"), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout.splitlines()[-1])
    assert sum(report["faults"].values()) == 8
    assert any(fault.startswith("simulator killed") for fault in report["faults"])
    assert report["bags"] > 1


def test_a_simulator_goes_on_with_the_episode_it_is_told(graph: Graph, ros_domain: int) -> None:
    graph.start_players(policy="learn")
    first = Graph(ros_domain)
    first.start_simulator(episodes=2, match_id=7, **PATIENT)
    first.hook = lambda: graph.spin(0.0)
    first.play()
    first.close()
    graph.start_simulator(episodes=4, match_id=7, first_episode=2, **PATIENT)
    graph.spin_until(lambda: not graph.simulator.conductor.roster.absent)
    graph.play()
    assert [episode.number for episode in graph.episodes] == [0, 1, 2, 3]
    lengths = [episode.cycles for episode in graph.episodes]
    assert lengths[2:] != lengths[:2]
    for name in ("keeper_1", "keeper_2", "keeper_3"):
        agent = graph.players[name].agent
        assert agent is not None
        assert (agent.episodes, agent.facts.first_episode) == (4, 2)


def test_a_full_disk_ends_the_recording_but_not_the_match(
    graph: Graph, tmp_path: Path, full_disk: Callable[[int], None]
) -> None:
    bag, expected = tmp_path / "bag", trained(3, policy="random")
    simulator = graph.start_simulator(episodes=3, record=str(bag), **PATIENT)
    graph.start_players(policy="random")
    graph.play(until=lambda: simulator.conductor.num_finished >= 1)
    simulator._publisher.write_recorded()
    simulator._bag.flush()  # type: ignore[union-attr]
    full_disk(bag.joinpath("bag_0.mcap").stat().st_size + 100)
    assert graph.play() == played(expected)
    with pytest.raises(KeepawayError, match=r"bag cannot be written any more: .*repair_bag"):
        simulator.close()
    full_disk(resource.RLIM_INFINITY)
    rescued = repair(bag, tmp_path / "rescued")
    assert len(list(rescued.messages(["/episode"]))) == 1


def test_a_full_disk_leaves_the_weights_that_were_saved_and_later_ones_are_saved_again(
    graph: Graph, tmp_path: Path, full_disk: Callable[[int], None]
) -> None:
    path = tmp_path / "keeper_1.npz"
    keeper = graph.start_player("keeper_1", policy="learn", save_weights=str(path), save_every=1)
    for name in ("keeper_2", "keeper_3", "taker_1", "taker_2"):
        graph.start_player(name)
    simulator = graph.start_simulator(episodes=3, **PATIENT)
    graph.play(until=lambda: path.exists())
    full_disk(1000)
    graph.play(
        until=lambda: (
            simulator.conductor.num_finished >= 2 and simulator.conductor.num_cycles % 7 == 0
        )
    )
    assert load_weights(path).episodes == 1
    full_disk(resource.RLIM_INFINITY)
    graph.play()
    assert load_weights(path).episodes == 3
    assert keeper.agent is not None
    assert list(tmp_path.iterdir()) == [path]


def test_weights_that_are_removed_are_written_again(graph: Graph, tmp_path: Path) -> None:
    path = tmp_path / "weights" / "keeper_1.npz"
    graph.start_player("keeper_1", policy="learn", save_weights=str(path), save_every=1)
    for name in ("keeper_2", "keeper_3", "taker_1", "taker_2"):
        graph.start_player(name)
    graph.start_simulator(episodes=2, **PATIENT)
    graph.play(until=lambda: path.exists())
    path.unlink()
    path.parent.rmdir()
    graph.play()
    assert load_weights(path).episodes == 2
