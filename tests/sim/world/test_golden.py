"""Golden episodes: what fixed seeds gave once they still give, to the last bit on any machine.

After a change that moves results on purpose (say so in CHANGELOG.md), write them anew:

    .venv/bin/python tests/sim/world/test_golden.py
"""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from recorded import simple_requests

from keepaway_sim.task import Task
from keepaway_sim.world.config import profile
from keepaway_sim.world.world import World

FILE = Path(__file__).with_name("golden_episodes.json")
CASES = {
    "3v2 2005": (Task(3, 2), profile("2005")),
    "3v2 2005 narrow": (Task(3, 2), profile("2005", visible_angle_deg=90.0)),
    "4v3 v19": (Task(4, 3), profile("v19")),
    "5v4 30x20": (Task(5, 4, 30.0, 20.0), profile("2005")),
}
CYCLES, EVERY = 300, 60


def play(name: str) -> list[list[float]]:
    """Positions of all objects now and then, one row a moment."""
    task, config = CASES[name]
    world = World(task, config)
    world.start(0, np.random.SeedSequence(1))
    rows = []
    for cycle in range(1, CYCLES + 1):
        action, target, _ = simple_requests(world.belief, task)
        world.step(action[None], target[None])
        if cycle % EVERY == 0:
            rows.append(world.truth.position[0].ravel().tolist())
    return rows


@pytest.mark.parametrize("name", CASES)
def test_a_golden_episode_is_played_again(name: str) -> None:
    assert play(name) == json.loads(FILE.read_text())[name]


if __name__ == "__main__":
    FILE.write_text(json.dumps({name: play(name) for name in CASES}, indent=1) + "\n")
