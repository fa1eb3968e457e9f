"""Everything that matches and training call is compiled, and loaded, ahead."""

from __future__ import annotations

from typing import Any

import numpy as np

from keepaway_agent import compiled as agent
from keepaway_agent.playing.agent import Agent, MatchFacts
from keepaway_sim.task import Task
from keepaway_sim.world import compiled as sim
from keepaway_sim.world.config import profile
from keepaway_sim.world.world import World

_TASK = Task.parse("3v2")


def compile_ahead() -> None:
    """Compile what is not compiled yet; machine code is the same for all tasks and settings.

    It says on standard error what it does, and ends at once when it is interrupted.
    """
    from keepaway_agent.training.trainer import Trainer
    from keepaway_agent.training.trial import TrainerConfig
    from keepaway_sim.bags.chunk_records import index_records

    with sim.postponed() as world, agent.postponed() as players:
        Trainer(TrainerConfig(), num_fields=1)
        _make_players()
    jobs: list[Any] = [*world, *players]  # both packages have the same class
    agent.make(jobs)
    index_records(np.frombuffer(b"", np.uint8))


def load_for_match() -> None:
    """Load what a match's nodes call, so that processes split off this one have it at once.

    What is not compiled yet is compiled first, as `compile_ahead` does.
    """
    with sim.postponed() as world, agent.postponed() as players:
        World(_TASK, profile())
        _make_players()
    jobs: list[Any] = [*world, *players]
    agent.make(jobs)
    World(_TASK, profile())
    _make_players()


def _make_players() -> None:
    """One of each team."""
    facts = MatchFacts(_TASK.num_keepers, _TASK.num_takers, 25.0, 25.0, cycle_time=0.1, seed=0)
    for index in (0, _TASK.num_keepers):
        Agent(facts, index)


if __name__ == "__main__":
    compile_ahead()
