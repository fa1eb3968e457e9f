"""Playing a batch of a study's trials in one process, many fields in lock-step.

A trial trains keepers on its row's source stages one after the other. After each, one keeper is
taken at random, and rho carries its weights into all keepers of the next task; the target task is
the last. What a trial gives depends on the study's settings, its row and its number alone.

The seed plan: a run's random numbers follow from the study's seed, from what the run is (the task
it plays and all that was learned before, `study.Row.origin`) and from the trial's number, and from
nothing else. So rows that start alike give the same trials in any two studies of one seed and one
world, whatever the rows are called; rows that start otherwise are independent of one another,
unless the study lets them share their sources or their seeds.
"""

import zlib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from keepaway_agent.actions import Role
from keepaway_agent.settings import changed
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import StopRule, TrainerConfig, Trial, TrialResult
from keepaway_sim.version import code_version
from keepaway_sim.world.config import CYCLE_TIME
from keepaway_transfer.metrics import SECONDS_PER_HOUR
from keepaway_transfer.parts import has_sample, level_of, sample_of
from keepaway_transfer.rho import Transfer, rho
from keepaway_transfer.studies.experiment import Key
from keepaway_transfer.studies.results import SourceRun, StudyTrial
from keepaway_transfer.studies.study import Row, Study
from keepaway_transfer.variants import constant, variant_of

CYCLES_PER_HOUR = SECONDS_PER_HOUR / CYCLE_TIME
GREEDY_PLAY, CHOICE, SHUFFLE, TARGET = 100, 101, 102, 103  # seeds of what is no source stage


@dataclass
class _TrialState:
    """A trial while it is played."""

    row: Row
    number: int
    weights: np.ndarray | None = None  # (num_actions, ..) that the next task starts with
    learned: np.ndarray | None = None  # (num_keepers, num_actions, ..) after the target task
    sources: list[SourceRun] = field(default_factory=list)
    cycles: tuple[int, ...] = ()
    greedy_cycles: tuple[int, ...] = ()


def play_batch(study: Study, keys: Sequence[Key]) -> list[StudyTrial]:
    """Play these trials to their end; the results are in the order of the keys."""
    rows = {row.name: row for row in study.rows}
    states = [
        _TrialState(rows[name], number, _constant(study, rows[name])) for name, number in keys
    ]
    for stage in range(max((len(state.row.stages) for state in states), default=0)):
        _train_sources(study, [x for x in states if len(x.row.stages) > stage], stage)
    _train_target(study, states)
    if study.greedy_episodes:
        _play_greedily(study, states)
    return [
        StudyTrial(
            row=state.row.name,
            number=state.number,
            sources=tuple(state.sources),
            cycles=state.cycles,
            greedy_cycles=state.greedy_cycles,
            code_version=code_version(),
            start_level=_start_level(study, state),
        )
        for state in states
    ]


def _constant(study: Study, row: Row) -> np.ndarray | None:
    """What a row that learns from no source starts with; None from scratch."""
    if row.stages or row.is_scratch:
        return None
    config, level = _config(study, study.target, row.widths), variant_of(row.variant).level
    shape = config.tiling(Role.KEEPER).weights_shape(config.task.num_keepers)
    return None if level is None else constant(level, shape)


def _start_level(study: Study, state: _TrialState) -> float | None:
    """What the target task's actions were worth on average [s], where it is known what that is."""
    if state.weights is None or not has_sample(study.target):
        return None
    tiling = _config(study, study.target, state.row.widths).tiling(Role.KEEPER)
    return level_of(state.weights, sample_of(study.target, tiling))


def _train_sources(study: Study, states: Sequence[_TrialState], stage: int) -> None:
    """Train a source stage of all states, and carry what was learned to their next task."""
    by_run: dict[tuple[str, str, str, int], list[_TrialState]] = defaultdict(list)
    for state in states:
        task, name = state.row.stages[stage].task, study.source_name(state.row, stage)
        by_run[task, state.row.widths, name, state.number].append(state)
    runs: dict[tuple[str, str], list[Trial]] = defaultdict(list)
    for label, sharing in by_run.items():
        runs[label[:2]].append(_source_run(study, label, sharing, stage))
    for (task, widths), alike in runs.items():
        for result in Trainer(_config(study, task, widths), len(alike)).run(alike):
            for state in by_run[result.trial.label]:
                _carry(study, state, stage, result)


def _source_run(
    study: Study, label: tuple[str, str, str, int], states: Sequence[_TrialState], stage: int
) -> Trial:
    """The training that these states share (or that one has for itself)."""
    *_, name, number = label
    amounts = {state.row.stages[stage].episodes for state in states}
    return Trial(
        seed=_seed(study, name, number, stage),
        stop=StopRule(max_episodes=max(amounts)),
        keeper_weights=states[0].weights,
        snapshots=tuple(sorted(amounts)),
        label=label,
    )


def _carry(study: Study, state: _TrialState, stage: int, result: TrialResult) -> None:
    """Let a random keeper's weights, through rho, be what the next task starts with."""
    task, _, name, number = result.trial.label
    episodes = state.row.stages[stage].episodes
    keepers = result.snapshots[episodes]
    choice = np.random.default_rng(_seed(study, name, number, stage, CHOICE))
    keeper = int(choice.integers(len(keepers)))
    cycles = int(result.durations[:episodes].sum())
    state.sources.append(SourceRun(task, episodes, cycles, keeper))
    following = [*(later.task for later in state.row.stages[stage + 1 :]), study.target][0]
    state.weights = _through_rho(study, state, task, following, keepers[keeper])


def _through_rho(
    study: Study, state: _TrialState, source: str, target: str, weights: np.ndarray
) -> np.ndarray:
    row = state.row
    shuffle = _seed(study, study.target_name(row), state.number, SHUFFLE).generate_state(1)
    transfer = Transfer(target, row.variant, seed=int(shuffle[0]))
    return rho(
        weights,
        _config(study, source, row.widths).tiling(Role.KEEPER),
        _config(study, target, row.widths).tiling(Role.KEEPER),
        transfer.mapping_from(source),
        variant_of(row.variant),
    )


def _train_target(study: Study, states: Sequence[_TrialState]) -> None:
    stop = StopRule(
        max_cycles=round(study.max_hours * CYCLES_PER_HOUR),
        threshold=study.threshold,
        window=study.window,
        min_cycles=round(study.min_hours * CYCLES_PER_HOUR),
    )
    runs = [
        Trial(
            seed=_seed(study, study.target_name(state.row), state.number, TARGET),
            stop=stop,
            keeper_weights=state.weights,
            label=state,
        )
        for state in states
    ]
    for state, result in _results(study, runs):
        state.cycles, state.learned = _tuple(result.durations), result.keeper_weights


def _play_greedily(study: Study, states: Sequence[_TrialState]) -> None:
    """Play on without learning or exploring, up to the target task's limit of hours."""
    stop = StopRule(
        max_episodes=study.greedy_episodes, max_cycles=round(study.max_hours * CYCLES_PER_HOUR)
    )
    runs = [
        Trial(
            seed=_seed(study, study.target_name(state.row), state.number, GREEDY_PLAY),
            stop=stop,
            keeper_policy="greedy",
            keeper_weights=state.learned,
            label=state,
        )
        for state in states
    ]
    for state, result in _results(study, runs):
        state.greedy_cycles = _tuple(result.durations)


def _results(study: Study, runs: Sequence[Trial]) -> Iterator[tuple[_TrialState, TrialResult]]:
    """Play runs of the target task, all of one tiling at once; each with the state it is of."""
    by_widths: dict[str, list[Trial]] = defaultdict(list)
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
