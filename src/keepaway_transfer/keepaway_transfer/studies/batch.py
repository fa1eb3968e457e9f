"""Playing a batch of a study's trials in one process, many fields in lock-step.

A trial trains keepers on its row's source stages one after the other. After each, one keeper is
taken at random, and rho carries its weights into all keepers of the next task; the target task is
the last. What a trial gives depends on the study's settings, its row and its number alone.
"""

import zlib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from keepaway_agent.actions import Role
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import StopRule, TrainerConfig, TrialResult
from keepaway_agent.training.trial import Trial as Run
from keepaway_sim.version import code_version
from keepaway_sim.world.config import CYCLE_TIME
from keepaway_transfer.reports.metrics import SECONDS_PER_HOUR
from keepaway_transfer.rho import VARIANTS, Transfer, rho
from keepaway_transfer.studies.experiment import Key
from keepaway_transfer.studies.results import SourceRun, Trial
from keepaway_transfer.studies.study import Row, Study

CYCLES_PER_HOUR = SECONDS_PER_HOUR / CYCLE_TIME
GREEDY, CHOICE, SHUFFLE = 100, 101, 102  # seeds of what is no stage: after any number of stages


@dataclass
class _Life:
    """A trial while it is played."""

    row: Row
    number: int
    weights: np.ndarray | None = None  # (num_actions, ..) that the next task starts with
    learned: np.ndarray | None = None  # (num_keepers, num_actions, ..) after the target task
    sources: list[SourceRun] = field(default_factory=list)
    cycles: tuple[int, ...] = ()
    greedy_cycles: tuple[int, ...] = ()


def play(study: Study, keys: Sequence[Key]) -> list[Trial]:
    """Play these trials to their end; the results are in the order of the keys."""
    rows = {row.name: row for row in study.rows}
    lives = [_Life(rows[name], number) for name, number in keys]
    for stage in range(max((len(life.row.stages) for life in lives), default=0)):
        _train_sources(study, [x for x in lives if len(x.row.stages) > stage], stage)
    _train_target(study, lives)
    if study.greedy_episodes:
        _play_greedily(study, lives)
    return [
        Trial(
            row=life.row.name,
            number=life.number,
            sources=tuple(life.sources),
            cycles=life.cycles,
            greedy_cycles=life.greedy_cycles,
            code_version=code_version(),
        )
        for life in lives
    ]


def _train_sources(study: Study, lives: Sequence[_Life], stage: int) -> None:
    """Train a source stage of all lives, and carry what was learned to their next task."""
    by_run: dict[tuple[str, str, int], list[_Life]] = defaultdict(list)
    for life in lives:
        name = _source_name(study, life.row, stage)
        by_run[life.row.stages[stage].task, name, life.number].append(life)
    runs: dict[str, list[Run]] = defaultdict(list)
    for label, sharing in by_run.items():
        runs[label[0]].append(_source_run(study, label, sharing, stage))
    for task, of_task in runs.items():
        for result in _results(study, task, of_task):
            for life in by_run[result.trial.label]:
                _carry(study, life, stage, result)


def _source_run(
    study: Study, label: tuple[str, str, int], lives: Sequence[_Life], stage: int
) -> Run:
    """The training that these lives share (or that one has for itself)."""
    _, name, number = label
    amounts = {life.row.stages[stage].episodes for life in lives}
    return Run(
        seed=_seed(study, name, number, stage),
        stop=StopRule(max_episodes=max(amounts)),
        keeper_weights=lives[0].weights,
        snapshots=tuple(sorted(amounts)),
        label=label,
    )


def _carry(study: Study, life: _Life, stage: int, result: TrialResult) -> None:
    """Let a random keeper's weights, through rho, be what the next task starts with."""
    task, name, number = result.trial.label
    episodes = life.row.stages[stage].episodes
    keepers = result.snapshots[episodes]
    choice = np.random.default_rng(_seed(study, name, number, stage, CHOICE))
    keeper = int(choice.integers(len(keepers)))
    cycles = int(result.durations[:episodes].sum())
    life.sources.append(SourceRun(task, episodes, cycles, keeper))
    following = [*(later.task for later in life.row.stages[stage + 1 :]), study.target][0]
    life.weights = _through_rho(study, life, task, following, keepers[keeper])


def _through_rho(
    study: Study, life: _Life, source: str, target: str, weights: np.ndarray
) -> np.ndarray:
    shuffle = _seed(study, life.row.name, life.number, SHUFFLE).generate_state(1)
    transfer = Transfer(target, life.row.variant, seed=int(shuffle[0]))
    variant = VARIANTS[life.row.variant]
    return rho(
        weights,
        _config(study, source).tiling(Role.KEEPER),
        _config(study, target).tiling(Role.KEEPER),
        transfer.mapping_from(source),
        averaged=variant.averaged,
        rescaled=variant.rescaled,
    )


def _train_target(study: Study, lives: Sequence[_Life]) -> None:
    stop = StopRule(
        max_cycles=round(study.max_hours * CYCLES_PER_HOUR),
        threshold=study.threshold,
        window=study.window,
        min_cycles=round(study.min_hours * CYCLES_PER_HOUR),
    )
    runs = [
        Run(
            seed=_seed(study, life.row.name, life.number, len(life.row.stages)),
            stop=stop,
            keeper_weights=life.weights,
            label=life,
        )
        for life in lives
    ]
    for result in _results(study, study.target, runs):
        life = result.trial.label
        life.cycles, life.learned = tuple(result.durations.tolist()), result.keeper_weights


def _play_greedily(study: Study, lives: Sequence[_Life]) -> None:
    """Play on without learning or exploring, up to the target task's limit of hours."""
    stop = StopRule(
        max_episodes=study.greedy_episodes, max_cycles=round(study.max_hours * CYCLES_PER_HOUR)
    )
    runs = [
        Run(
            seed=_seed(study, life.row.name, life.number, GREEDY),
            stop=stop,
            keeper_policy="greedy",
            keeper_weights=life.learned,
            label=life,
        )
        for life in lives
    ]
    for result in _results(study, study.target, runs):
        result.trial.label.greedy_cycles = tuple(result.durations.tolist())


def _results(study: Study, task: str, runs: Sequence[Run]) -> Iterator[TrialResult]:
    """Play runs of one task, all at once."""
    return Trainer(_config(study, task), len(runs)).run(runs)


def _config(study: Study, task: str) -> TrainerConfig:
    return TrainerConfig(
        task=study.task(task),
        world=study.world_settings,
        sarsa=study.sarsa,
        ordering=study.ordering,
        tile_widths=study.widths,
        shared=study.shared_keepers,
    )


def _source_name(study: Study, row: Row, stage: int) -> str:
    """What a source run is known by: its row, or what it learned before where rows share runs."""
    if not study.shared_sources:
        return row.name
    before = "".join(f"{done.task} {done.episodes} {row.variant} " for done in row.stages[:stage])
    return before + row.stages[stage].task


def _seed(study: Study, name: str, number: int, *what: int) -> np.random.SeedSequence:
    """The seeds of one run: no other row, trial or stage of the study has the same."""
    return np.random.SeedSequence(study.seed, spawn_key=(zlib.crc32(name.encode()), number, *what))
