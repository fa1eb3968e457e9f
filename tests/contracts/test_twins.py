"""What the world's and the agents' packages both have, because neither imports the other."""

import inspect
from enum import EnumType
from pathlib import Path
from types import ModuleType

import house
import pytest

from keepaway_agent import actions
from keepaway_agent import errors as agent_errors
from keepaway_agent.checks import conformance
from keepaway_agent.learning import weights
from keepaway_agent.nodes import conversions, player, scripted_simulator
from keepaway_sim import errors, task
from keepaway_sim.match import conductor
from keepaway_sim.wire import cdr
from keepaway_sim.world import config

SRC = Path(__file__).resolve().parents[2] / "src"
TWINS = {
    "world/compiled.py": "compiled.py",
    "settings.py": "settings.py",
    "ros/parameters.py": "nodes/parameters.py",
    "ros/running.py": "nodes/running.py",
    "world/machine_code.py": "machine_code.py",
    "world/passing.py": "passing.py",
    "world/trigonometry.py": "trigonometry.py",
    "version.py": "version.py",
}


@pytest.mark.parametrize(("ours", "theirs"), TWINS.items())
def test_twins_differ_in_the_name_of_their_package_alone(ours: str, theirs: str) -> None:
    sim = (SRC / "keepaway_sim/keepaway_sim" / ours).read_text()
    agent = (SRC / "keepaway_agent/keepaway_agent" / theirs).read_text()
    places = {"keepaway_sim": "PACKAGE", "keepaway_agent": "PACKAGE"}
    for name, place in places.items():
        sim, agent = sim.replace(name, place), agent.replace(name, place)
    assert sim == agent


AGAIN = {
    "Action": (task, actions),
    "Role": (task, actions),
    "Outcome": (task, actions),
    "NEVER": (config, actions),
    "HEADER": (cdr, conversions),
    "CYCLE_TIME": (config, conformance),
    "LOG_PERIOD": (errors, player),
    "RESEND_PERIOD": (conductor, scripted_simulator),
    "MAX_FIELD_SIDE": (task, weights),
    "MAX_TEAM_SIZE": (task, weights),
    "SettingError": (errors, agent_errors),
    "Spin": (conductor, scripted_simulator),
}
"""What agents define again, and where."""


def value_of(module: ModuleType, name: str) -> object:
    """A constant; the members of an enumeration; the sentence of an error."""
    value = getattr(module, name)
    if isinstance(value, EnumType):
        return dict(value.__members__)
    return inspect.getdoc(value) if isinstance(value, type) else value


@pytest.mark.parametrize("name", AGAIN)
def test_what_agents_define_again_has_the_same_value(name: str) -> None:
    ours, theirs = AGAIN[name]
    assert value_of(ours, name) == value_of(theirs, name)


def test_every_name_that_may_be_defined_again_is_compared() -> None:
    assert set(AGAIN) == house.TWIN_NAMES
