"""What the world's and the agents' packages both have, because neither imports the other."""

from pathlib import Path

import pytest

from keepaway_agent import actions
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
}


@pytest.mark.parametrize(("ours", "theirs"), TWINS.items())
def test_twins_differ_in_the_name_of_their_package_alone(ours: str, theirs: str) -> None:
    sim = (SRC / "keepaway_sim/keepaway_sim" / ours).read_text()
    agent = (SRC / "keepaway_agent/keepaway_agent" / theirs).read_text()
    places = {"keepaway_sim": "PACKAGE", "keepaway_agent": "PACKAGE"}
    for name, place in places.items():
        sim, agent = sim.replace(name, place), agent.replace(name, place)
    assert sim == agent


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (config.NEVER, actions.NEVER),
        (config.CYCLE_TIME, conformance.CYCLE_TIME),
        (cdr.HEADER, conversions.HEADER),
        (errors.LOG_PERIOD, player.LOG_PERIOD),
        (conductor.RESEND_PERIOD, scripted_simulator.RESEND_PERIOD),
        (task.MAX_TEAM_SIZE, weights.MAX_TEAM_SIZE),
        (task.MAX_FIELD_SIDE, weights.MAX_FIELD_SIDE),
        *((dict(getattr(task, n).__members__), dict(getattr(actions, n).__members__))
          for n in ("Action", "Role", "Outcome")),
    ],
)  # fmt: skip
def test_what_agents_say_again_has_the_same_values(ours: object, theirs: object) -> None:
    assert ours == theirs
