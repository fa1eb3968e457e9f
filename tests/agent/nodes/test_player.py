"""A player's node: its weights are saved, loaded and resumed, and what does not fit is refused."""

from pathlib import Path

import numpy as np
import pytest
from graph import Graph, weights_of

from keepaway_agent.errors import AgentError
from keepaway_agent.learning.weights import load_weights, save_weights
from keepaway_agent.nodes.running import StoppedCompiling
from keepaway_msgs.msg import AgentStatus
from keepaway_msgs.srv import LoadWeights, SaveWeights
from keepaway_sim.ros.publishing import LATCHED

PATIENT = {"answer_timeout": 20.0}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "known.npz"
    save_weights(path, weights_of())
    return path


def play_some(graph: Graph, episodes: int = 1) -> None:
    """A short match, with keeper_1 as it is."""
    for name in ("keeper_2", "keeper_3", "taker_1", "taker_2"):
        graph.start_player(name)
    graph.start_simulator(episodes=episodes, **PATIENT)
    graph.play()


def test_it_goes_on_from_a_file_and_saves_where_it_is_told(
    graph: Graph, file: Path, tmp_path: Path
) -> None:
    new = tmp_path / "sub" / "new.npz"
    keeper = graph.start_player(
        "keeper_1", policy="learn", load_weights=str(file), save_weights=str(new)
    )
    play_some(graph, episodes=4)
    keeper.save()
    known, saved = load_weights(file), load_weights(new)
    assert saved.episodes == 104
    assert saved.hours > known.hours
    assert (saved.player, saved.task) == ("keeper_1", "3v2")
    changed = saved.values != known.values
    assert 0 < changed.mean() < 0.5


def test_greedy_players_use_what_they_know_and_do_not_change_it(graph: Graph, file: Path) -> None:
    keeper = graph.start_player("keeper_1", policy="greedy", load_weights=str(file))
    play_some(graph)
    assert keeper.agent is not None
    np.testing.assert_array_equal(keeper.agent.learned("").values, load_weights(file).values)


def test_services_save_and_load(graph: Graph, file: Path, tmp_path: Path) -> None:
    keeper = graph.start_player("keeper_1", policy="learn", weights_dir=str(tmp_path))
    play_some(graph)
    new = tmp_path / "new.npz"
    saved = graph.call(SaveWeights, "keeper_1/save_weights", path=str(new))
    assert (saved.success, saved.path) == (True, str(new))
    loaded = graph.call(LoadWeights, "keeper_1/load_weights", path=str(file))
    assert loaded.success
    assert keeper.agent is not None
    np.testing.assert_array_equal(keeper.agent.learned("").values, load_weights(file).values)
    assert load_weights(new).episodes == 1


def test_services_refuse_in_words(graph: Graph, file: Path, tmp_path: Path) -> None:
    graph.start_player("keeper_1", policy="learn", weights_dir=str(tmp_path))

    def save(path: object) -> str:
        return str(graph.call(SaveWeights, "keeper_1/save_weights", path=str(path)).message)

    def load(path: object) -> str:
        return str(graph.call(LoadWeights, "keeper_1/load_weights", path=str(path)).message)

    assert "no match yet" in save(tmp_path / "new.npz")
    assert "no match yet" in load(file)
    play_some(graph)
    larger, broken = tmp_path / "larger.npz", tmp_path / "broken.npz"
    save_weights(larger, weights_of(4, 3))
    broken.write_bytes(file.read_bytes()[:500])
    assert "no path was given" in save("")
    assert "is there already" in save(file)
    assert "cannot be written" in save(file / "new.npz")
    (tmp_path / "way_out").symlink_to("/")
    for outside in ("/proc/new.npz", "../new.npz", "way_out/tmp/new.npz"):
        assert f"{outside} is not in {tmp_path}: set weights_dir" in save(outside)
        assert f"{outside} is not in {tmp_path}: set weights_dir" in load(outside)
    assert "cannot be read" in load(tmp_path / "none.npz")
    assert "not a whole weights file" in load(broken)
    assert "in 4v3, not of a keeper in 3v2" in load(larger)


def test_it_saves_as_it_learns(graph: Graph, tmp_path: Path) -> None:
    path = tmp_path / "own.npz"
    graph.start_player("keeper_1", policy="learn", save_weights=str(path), save_every=1)
    play_some(graph)
    assert load_weights(path).episodes == 1


def test_nothing_is_overwritten_unless_it_resumes(graph: Graph, file: Path) -> None:
    before = load_weights(file)
    with pytest.raises(AgentError, match="resume:=true"):
        graph.start_player("keeper_1", policy="learn", save_weights=str(file))
    keeper = graph.start_player("keeper_1", policy="learn", save_weights=str(file), resume=True)
    play_some(graph)
    keeper.save()
    assert load_weights(file).episodes == before.episodes + 1


@pytest.mark.parametrize(
    ("name", "parameters", "why"),
    [
        ("keeper_1", {"policy": "cheat"}, "'cheat': choose one of random, hold, hand"),
        ("taker_1", {"policy": "hold"}, "'hold': choose one of random, hand"),
        ("keeper_1", {"epsilon": 1.5}, "epsilon=1.5"),
        ("keeper_1", {"load_weights": "/none.npz"}, "/none.npz cannot be read"),
    ],
)
def test_parameters_that_make_no_player_are_refused(
    graph: Graph, name: str, parameters: dict[str, object], why: str
) -> None:
    with pytest.raises(AgentError, match=why):
        graph.start_player(name, **parameters)


def test_a_parameter_of_another_type_is_refused(graph: Graph) -> None:
    with pytest.raises(AgentError, match="alpha='much': give a number from 0 to 1"):
        graph.start_player("keeper_1", alpha="much")


def test_a_name_without_a_place_in_the_match_is_never_ready(graph: Graph) -> None:
    said: list[AgentStatus] = []
    graph.node.create_subscription(AgentStatus, "keeper_9/status", said.append, LATCHED)
    graph.start_player("keeper_9")
    graph.start_simulator()
    graph.spin_until(lambda: len(said) >= 3)
    assert not any(status.ready for status in said)


def test_what_it_learned_goes_along_into_the_next_match(graph: Graph, ros_domain: int) -> None:
    graph.start_players(policy="learn")
    keeper, first_match = graph.players["keeper_1"], Graph(ros_domain)
    first_match.start_simulator(episodes=1, **PATIENT)
    first_match.hook = lambda: graph.spin(0.0)
    first_match.play()
    first_match.close()
    assert keeper.agent is not None
    before = keeper.agent.learned("").values
    first, graph.episodes[:] = keeper.agent, []
    graph.start_simulator(episodes=1, seed=7, **PATIENT)
    graph.spin_until(lambda: keeper.agent is not first)
    np.testing.assert_array_equal(keeper.agent.learned("").values, before)
    graph.play()
    assert keeper.agent.episodes == 2


def test_a_player_that_is_asked_to_end_while_it_compiles_joins_no_match(
    graph: Graph, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A signal raises in the callback; what spins must not take that for a fault of the node."""

    def stopped(*_: object) -> None:
        raise StoppedCompiling

    monkeypatch.setattr("keepaway_agent.nodes.player.Agent", stopped)
    keeper = graph.start_player("keeper_1")
    asked: list[bool] = []
    monkeypatch.setattr(
        "keepaway_agent.nodes.player.conversions.match_facts", lambda match: asked.append(True)
    )
    graph.start_simulator()
    graph.simulator.play(graph.spin, lambda: bool(asked))
    assert keeper.agent is None
