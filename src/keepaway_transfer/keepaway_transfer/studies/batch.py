"""Playing a batch of a study's trials in one process, many fields in lock-step.

A trial trains keepers on its row's source stages one after the other. After each, one keeper is
taken at random, and rho carries its weights into all keepers of the next task; the target task is
the last. What a trial gives depends on the study's settings, its row and its number alone.

The seed plan: a run's random numbers follow from the study's seed, from what the run is (the task
it plays and all that was learned before, `study.Row.origin`) and from the trial's number, and from
nothing else. So rows that start alike give the same trials in any two studies of one seed and one
world, whatever the rows are called; rows that start otherwise are independent of one another,
unless the study says that they share their sources or their seeds.
"""

import zlib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from keepaway_agent.actions import Role
from keepaway_agent.settings import changed
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import StopRule, TrainerConfig, TrialResult
from keepaway_agent.training.trial import Trial as Run
from keepaway_sim.version import code_version
from keepaway_sim.world.config import CYCLE_TIME
from keepaway_transfer.metrics import SECONDS_PER_HOUR
from keepaway_transfer.rho import Transfer, rho
from keepaway_transfer.studies.experiment import Key
from keepaway_transfer.studies.results import SourceRun, Trial
from keepaway_transfer.studies.study import Row, Study
from keepaway_transfer.variants import constant, variant_of

CYCLES_PER_HOUR = SECONDS_PER_HOUR / CYCLE_TIME
GREEDY, CHOICE, SHUFFLE, TARGET = 100, 101, 102, 103  # seeds of what is no source stage


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
    lives = [_Life(rows[name], number, _constant(study, rows[name])) for name, number in keys]
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


def _constant(study: Study, row: Row) -> np.ndarray | None:
    """What a row that learns from no source starts with; None from scratch."""
    if row.stages or row.is_scratch:
        return None
    config, level = _config(study, study.target, row.widths), variant_of(row.variant).level
    shape = config.tiling(Role.KEEPER).weights_shape(config.task.num_keepers)
    return None if level is None else constant(level, shape)


def _train_sources(study: Study, lives: Sequence[_Life], stage: int) -> None:
    """Train a source stage of all lives, and carry what was learned to their next task."""
    by_run: dict[tuple[str, str, str, int], list[_Life]] = defaultdict(list)
    for life in lives:
        task, name = life.row.stages[stage].task, study.source_name(life.row, stage)
        by_run[task, life.row.widths, name, life.number].append(life)
    runs: dict[tuple[str, str], list[Run]] = defaultdict(list)
    for label, sharing in by_run.items():
        runs[label[:2]].append(_source_run(study, label, sharing, stage))
    for (task, widths), alike in runs.items():
        for result in Trainer(_config(study, task, widths), len(alike)).run(alike):
            for life in by_run[result.trial.label]:
                _carry(study, life, stage, result)


def _source_run(
    study: Study, label: tuple[str, str, str, int], lives: Sequence[_Life], stage: int
) -> Run:
    """The training that these lives share (or that one has for itself)."""
    *_, name, number = label
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
    task, _, name, number = result.trial.label
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
    row = life.row
    shuffle = _seed(study, study.target_name(row), life.number, SHUFFLE).generate_state(1)
    transfer = Transfer(target, row.variant, seed=int(shuffle[0]))
    return rho(
        weights,
        _config(study, source, row.widths).tiling(Role.KEEPER),
        _config(study, target, row.widths).tiling(Role.KEEPER),
        transfer.mapping_from(source),
        variant_of(row.variant),
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
            seed=_seed(study, study.target_name(life.row), life.number, TARGET),
            stop=stop,
            keeper_weights=life.weights,
            label=life,
        )
        for life in lives
    ]
    for life, result in _results(study, runs):
        life.cycles, life.learned = _tuple(result.durations), result.keeper_weights


def _play_greedily(study: Study, lives: Sequence[_Life]) -> None:
    """Play on without learning or exploring, up to the target task's limit of hours."""
    stop = StopRule(
        max_episodes=study.greedy_episodes, max_cycles=round(study.max_hours * CYCLES_PER_HOUR)
    )
    runs = [
        Run(
            seed=_seed(study, study.target_name(life.row), life.number, GREEDY),
            stop=stop,
            keeper_policy="greedy",
            keeper_weights=life.learned,
            label=life,
        )
        for life in lives
    ]
    for life, result in _results(study, runs):
        life.greedy_cycles = _tuple(result.durations)


def _results(study: Study, runs: Sequence[Run]) -> Iterator[tuple[_Life, TrialResult]]:
    """Play runs of the target task, all of one tiling at once; each with the life it is of."""
    by_widths: dict[str, list[Run]] = defaultdict(list)
    for run in runs:
        by_widths[run.label.row.widths].append(run)
    for widths, alike in by_widths.items():
        config = _config(study, study.target, widths)
        for result in Trainer(config, len(alike)).run(alike):
            yield result.trial.label, result


def _config(study: Study, task: str, widths: str) -> TrainerConfig:
    return TrainerConfig(
        task=study.task(task),
        world=study.world_settings,
        learner=changed(study.learner_config, {"tile_widths": widths} if widths else {}),
        shared=study.shared_keepers,
    )


def _tuple(durations: np.ndarray) -> tuple[int, ...]:
    return tuple(durations.tolist())


def _seed(study: Study, name: str, number: int, *what: int) -> np.random.SeedSequence:
    """The seeds of one run (see the seed plan above)."""
    return np.random.SeedSequence(study.seed, spawn_key=(zlib.crc32(name.encode()), number, *what))
