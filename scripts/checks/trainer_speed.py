"""CPU time of the trainer's cycles alone: no start of trials, but cycles of unfinished episodes."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import StopRule, Trial, trial_seed


def play(
    trainer: Trainer, policy: str, num_fields: int, cycles: int, begin: Callable[[], object] = int
) -> tuple[float, int]:
    """Play a trial of so many cycles on every field.

    Args:
        trainer: with `num_fields` fields.
        policy: of the keepers.
        num_fields: trials.
        cycles: of each.
        begin: called when all trials have kicked off, and time begins to count.

    Returns:
        CPU seconds and field-cycles from there on.
    """
    started: list[float] = []

    def at_kick_off(_world: Any) -> None:
        if not started:
            begin()
            started.append(time.process_time())

    rule = StopRule(max_cycles=cycles)
    trials = (Trial(trial_seed(1, k), rule, policy) for k in range(num_fields))
    for _ in trainer.run(trials, watch_cycle=at_kick_off):
        pass
    return time.process_time() - started[0], cycles * num_fields
