"""The launch file of a match: with ROS's own `launch` where it can be had, else with a stand-in."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from keepaway_sim.errors import SettingError
from keepaway_sim.settings import settings_of
from keepaway_transfer.bringup import BringUp, from_arguments, node_specs

ROOT = Path(__file__).resolve().parents[2]
LAUNCH_FILE = ROOT / "src/keepaway_transfer/launch/match.launch.py"


class Said:
    """A stand-in for anything of `launch`: remembers what it was made with."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self.args, self.kwargs = args, kwargs

    def perform(self, context: dict[str, str]) -> str:
        return context[self.args[0]]


NAMES = {
    "launch": ("LaunchContext", "LaunchDescription"),
    "launch.actions": (
        *("DeclareLaunchArgument", "OpaqueFunction", "SetEnvironmentVariable", "Shutdown"),
    ),
    "launch.substitutions": ("EnvironmentVariable", "LaunchConfiguration"),
    "launch_ros": (),
    "launch_ros.actions": ("Node",),
}


@pytest.fixture
def launch_file(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The launch file as a module, with the stand-in."""
    for name, members in NAMES.items():
        module = ModuleType(name)
        for member in members:
            setattr(module, member, type(member, (Said,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location("match_launch", LAUNCH_FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def chosen(**arguments: str) -> dict[str, str]:
    defaults = {name: str(each.default).lower() for name, each in settings_of(BringUp).items()}
    return {**defaults, **arguments}


def test_every_argument_is_described(launch_file: ModuleType) -> None:
    declared = [
        entity
        for entity in launch_file.generate_launch_description().args[0]
        if type(entity).__name__ == "DeclareLaunchArgument"
    ]
    assert [entity.args[0] for entity in declared] == list(settings_of(BringUp))
    for entity in declared:
        assert entity.kwargs["description"]
        assert isinstance(entity.kwargs["default_value"], str)
    by_name = {entity.args[0]: entity.kwargs for entity in declared}
    assert "greedy" in by_name["keeper_policy"]["choices"]


def test_a_match_is_its_simulator_and_its_players(launch_file: ModuleType) -> None:
    nodes = [
        SimpleNamespace(**node.kwargs)
        for node in launch_file.match_nodes(chosen(task="4v3", namespace="/one", speed="0"))
    ]
    simulator, *players = nodes
    assert type(simulator.on_exit).__name__ == "Shutdown"
    assert simulator.parameters[0]["speed"] == 0.0
    assert [node.name for node in players] == [
        *(f"keeper_{n}" for n in range(1, 5)),
        *(f"taker_{n}" for n in range(1, 4)),
    ]
    assert {node.package for node in players} == {"keepaway_agent"}
    assert not any(node.on_exit for node in players)
    for node in nodes:
        assert node.remappings == [("/clock", "clock")]
        assert node.namespace == "/one"
    assert len({node.parameters[0]["match_id"] for node in nodes}) == 1


def test_two_launches_are_two_matches(launch_file: ModuleType) -> None:
    ids = {launch_file.match_nodes(chosen())[0].kwargs["parameters"][0]["match_id"] for _ in "ab"}
    assert len(ids) == 2


def test_players_that_are_started_elsewhere_are_left_out() -> None:
    specs = node_specs(from_arguments(chosen(elsewhere="keeper_1, taker_2")), 1)
    assert [spec.name for spec in specs] == ["simulator", "keeper_2", "keeper_3", "taker_1"]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("task", "three"),
        ("elsewhere", "keeper_4"),
        ("speed", "-1"),
        ("speed", "fast"),
        ("episodes", "1.5"),
        ("keeper_policy", "cheat"),
        ("taker_policy", "hold"),
        ("profile", "1999"),
        ("params_file", "/none.yaml"),
        ("load_weights", "/none"),
    ],
)
def test_a_wrong_value_is_refused_by_the_arguments_name(name: str, value: str) -> None:
    with pytest.raises(SettingError, match=name):
        from_arguments(chosen(**{name: value}))


def test_learners_have_a_file_each(tmp_path: Path) -> None:
    given = from_arguments(chosen(keeper_policy="learn", save_weights=str(tmp_path)))
    files = [spec.parameters.get("save_weights") for spec in node_specs(given, 1)]
    keepers = [str(tmp_path / f"keeper_{n}.npz") for n in (1, 2, 3)]
    assert files == [None, *keepers, None, None]
