"""What a study's trials gave: every measure of every trial, and of every row with its interval.

Times are simulated hours. A trial that did not reach the threshold within the study's limit counts
with the limit: means of times are means restricted to it, and every row says how many reached it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from keepaway_transfer.errors import StudyError
from keepaway_transfer.reports import metrics, statistics
from keepaway_transfer.reports.kwy import CYCLE_TIME
from keepaway_transfer.reports.statistics import Comparison, Interval
from keepaway_transfer.studies.results import Results, Trial
from keepaway_transfer.studies.study import Study


@dataclass(frozen=True)
class TrialMeasures:
    """A line of `trials.csv`: what one trial gave."""

    row: str
    trial: int
    seed: int  # of the study; with row and trial it gives the trial again
    source_episodes: int
    source_hours: float
    reached: bool  # the threshold, within the study's limit
    target_episodes: int  # to the threshold or to the limit
    target_hours: float
    total_hours: float  # of source and target
    initial_performance: float  # [s]
    jumpstart: float  # [s] above the mean initial performance from scratch
    asymptotic_performance: float  # [s] of the last window of episodes played
    total_reward: float  # [s h] area under the learning curve, to where every trial went
    greedy_performance: float  # [s] without learning and exploring; NaN if not played
    code_version: str


@dataclass(frozen=True)
class Against:
    """How a row compares with a reference row: positive differences are hours saved."""

    target: Comparison  # p by Welch's t-test
    total: Comparison
    target_holm: float  # p-values after Holm's adjustment over the rows
    total_holm: float
    logrank_holm: float


@dataclass(frozen=True)
class RowSummary:
    """A line of the table."""

    name: str
    trials: int
    reached: int
    source_hours: float  # mean
    target: Interval  # hours, restricted mean
    total: Interval
    jumpstart: Interval  # [s]
    asymptotic: Interval  # [s]
    greedy: Interval  # [s]
    transfer_ratio: float  # of the mean total rewards, against the first reference
    against: dict[str, Against]  # by reference row


def measure_trials(results: Results, threshold: float | None = None) -> list[TrialMeasures]:
    """The measures of every trial, in the order of the rows.

    Args:
        results: that were read.
        threshold: another than the study's [s].

    Raises:
        StudyError: no trials of the reference row; a threshold that trials were not run to.
    """
    study = results.study
    threshold = checked_threshold(study, threshold)
    scratch = study.references[0]
    initial = [
        metrics.initial_performance(seconds(trial.cycles))
        for trial in results.trials
        if trial.row == scratch
    ]
    if not initial:
        raise StudyError(f"no trial of row {scratch!r} is done yet: nothing to compare with")
    start, horizon = float(np.mean(initial)), common_hours(results.trials)
    order = [row.name for row in study.rows]
    trials = sorted(results.trials, key=lambda trial: (order.index(trial.row), trial.number))
    return [_measures(trial, study, threshold, start, horizon) for trial in trials]


def common_hours(trials: Sequence[Trial]) -> float:
    """Simulated hours of the target task that every trial was run for."""
    return min(metrics.hours(seconds(trial.cycles)) for trial in trials)


def summarise(study: Study, measures: Sequence[TrialMeasures]) -> list[RowSummary]:
    """A line of the table for every row that has trials; intervals are of 95 %."""
    by_row = {
        row.name: trials
        for row in study.rows
        if (trials := [one for one in measures if one.row == row.name])
    }
    against: dict[str, dict[str, Against]] = {name: {} for name in by_row}
    for reference in study.references:
        for name, comparison in _compare(study, by_row, reference).items():
            against[name][reference] = comparison
    generator = np.random.default_rng(study.seed)
    scratch = float(np.mean([one.total_reward for one in by_row[study.references[0]]]))
    return [
        _summary(name, trials, study.max_hours, scratch, against[name], generator)
        for name, trials in by_row.items()
    ]


def seconds(cycles: Sequence[int]) -> metrics.Floats:
    """Durations [s] of episodes given in cycles."""
    return np.asarray(cycles, dtype=np.float64) * CYCLE_TIME


def checked_threshold(study: Study, threshold: float | None) -> float:
    """The threshold to use [s]: the study's, or another one that its trials were run to."""
    if threshold is None:
        return study.threshold
    if threshold > study.threshold and study.min_hours < study.max_hours:
        raise StudyError(
            f"threshold={threshold:g}: the trials stopped at {study.threshold:g} s, give less"
        )
    return threshold


def _measures(
    trial: Trial, study: Study, threshold: float, scratch_start: float, horizon: float
) -> TrialMeasures:
    durations = seconds(trial.cycles)
    crossing = metrics.time_to_threshold(durations, threshold, study.window)
    target_hours = min(crossing.hours, study.max_hours)
    source_hours = sum(run.cycles for run in trial.sources) * CYCLE_TIME / metrics.SECONDS_PER_HOUR
    initial = metrics.initial_performance(durations)
    greedy = seconds(trial.greedy_cycles)
    return TrialMeasures(
        row=trial.row,
        trial=trial.number,
        seed=study.seed,
        source_episodes=sum(run.episodes for run in trial.sources),
        source_hours=source_hours,
        reached=crossing.reached and crossing.hours <= study.max_hours,
        target_episodes=crossing.episodes,
        target_hours=target_hours,
        total_hours=source_hours + target_hours,
        initial_performance=initial,
        jumpstart=initial - scratch_start,
        asymptotic_performance=metrics.asymptotic_performance(durations, study.window),
        total_reward=metrics.total_reward(durations, horizon, study.window),
        greedy_performance=float(greedy.mean()) if greedy.size else float("nan"),
        code_version=trial.code_version,
    )


def _compare(
    study: Study, by_row: dict[str, list[TrialMeasures]], reference: str
) -> dict[str, Against]:
    """Every other row against the reference; Holm adjusts over these rows."""
    base = by_row.get(reference, [])
    names = [name for name, trials in by_row.items() if name != reference and len(trials) > 1]
    if len(base) < 2 or not names:
        return {}
    target = [_difference(study, base, by_row[name], "target_hours") for name in names]
    total = [_difference(study, base, by_row[name], "total_hours") for name in names]
    logrank = [_logrank(base, by_row[name]) for name in names]
    adjusted = zip(
        statistics.holm([comparison.p_value for comparison in target]),
        statistics.holm([comparison.p_value for comparison in total]),
        statistics.holm(logrank),
        strict=True,
    )
    return {
        name: Against(of_target, of_total, *(float(p) for p in p_values))
        for name, of_target, of_total, p_values in zip(names, target, total, adjusted, strict=True)
    }


def _difference(
    study: Study, base: list[TrialMeasures], other: list[TrialMeasures], measure: str
) -> Comparison:
    """Hours saved; where both rows share their source runs the interval is of the pairs."""
    welch = statistics.welch(values(base, measure), values(other, measure))
    pairs = _pairs(base, other) if study.shared_sources else []
    if len(pairs) < 2:
        return welch
    first, second = np.array([[getattr(one, measure) for one in pair] for pair in pairs]).T
    generator = np.random.default_rng(study.seed)
    _, low, high = statistics.paired_bootstrap(first, second, generator)
    return welch._replace(low=low, high=high)


def _pairs(
    base: list[TrialMeasures], other: list[TrialMeasures]
) -> list[tuple[TrialMeasures, TrialMeasures]]:
    """Trials of two rows that began with the same source run."""
    by_number = {one.trial: one for one in base if one.source_episodes}
    return [(by_number[one.trial], one) for one in other if one.trial in by_number]


def _logrank(base: list[TrialMeasures], other: list[TrialMeasures]) -> float:
    return statistics.logrank(
        values(base, "target_hours"),
        [one.reached for one in base],
        values(other, "target_hours"),
        [one.reached for one in other],
    )


def _summary(
    name: str,
    trials: list[TrialMeasures],
    limit: float,
    scratch_reward: float,
    against: dict[str, Against],
    generator: np.random.Generator,
) -> RowSummary:
    def mean(measure: str) -> Interval:
        return statistics.bootstrap_mean(values(trials, measure), generator)

    reached = [one.reached for one in trials]
    rewards = float(np.mean(values(trials, "total_reward")))
    return RowSummary(
        name=name,
        trials=len(trials),
        reached=sum(reached),
        source_hours=float(np.mean(values(trials, "source_hours"))),
        target=statistics.restricted_mean(values(trials, "target_hours"), reached, limit),
        total=mean("total_hours"),
        jumpstart=mean("jumpstart"),
        asymptotic=mean("asymptotic_performance"),
        greedy=mean("greedy_performance"),
        transfer_ratio=metrics.transfer_ratio(rewards, scratch_reward),
        against=against,
    )


def values(trials: Sequence[TrialMeasures], measure: str) -> list[float]:
    """One measure of many trials."""
    return [getattr(one, measure) for one in trials]
