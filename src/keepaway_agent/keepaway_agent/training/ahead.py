"""Everything that matches and training call is compiled ahead."""

from __future__ import annotations

from typing import Any

import numpy as np

from keepaway_agent import compiled as agent
from keepaway_agent.playing.agent import Agent, MatchFacts
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import TrainerConfig
from keepaway_sim.bags.chunk_records import index_records
from keepaway_sim.world import compiled as sim


def compile_ahead() -> None:
    """Compile what is not compiled yet; machine code is the same for all tasks and settings.

    It says on standard error what it does, and ends at once when it is interrupted.
    """
    task = TrainerConfig().task
    with sim.postponed() as world, agent.postponed() as players:
        Trainer(TrainerConfig(), num_fields=1)
        facts = MatchFacts(task.num_keepers, task.num_takers, 25.0, 25.0, cycle_time=0.1, seed=0)
        for index in (0, task.num_keepers):  # a keeper and a taker
            Agent(facts, index)
    jobs: list[Any] = [*world, *players]  # both packages have the same class
    agent.make(jobs)
    index_records(np.zeros(0, np.uint8))
    index_records(np.zeros(0, np.uint8), True)


if __name__ == "__main__":
    compile_ahead()
