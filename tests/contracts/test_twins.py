"""Files that the world's and the agents' packages both have, because neither imports the other."""

from pathlib import Path

import pytest

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
