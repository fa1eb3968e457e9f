"""What a study's trials gave: every measure of every trial, and of every row with its interval.

Times are simulated hours. A trial that did not reach the threshold within the study's limit counts
with the limit. All such trials went on to it, so the mean of these times is the restricted mean;
every row says how many reached the threshold.

Rows are compared trial by trial where the study says that their trials are pairs
(`Study.are_paired`), by the paired t-test; elsewhere by Welch's. A difference is called none only
where its interval holds zero and lies within EQUIVALENT_HOURS on both sides.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from keepaway_sim.world.config import CYCLE_TIME
from keepaway_transfer import metrics
from keepaway_transfer.errors import StudyError
from keepaway_transfer.reports import statistics
from keepaway_transfer.reports.statistics import Comparison, Interval
from keepaway_transfer.studies.records import Record
from keepaway_transfer.studies.results import StudyResults
from keepaway_transfer.studies.study import Study

EQUIVALENT_HOURS = 1.0
"""Differences that lie within this on both sides count as none: a seventh of the least hours that a
constant start takes, and less than rows of 100 trials can see from scratch."""

SIGNIFICANT = 0.05


@dataclass(frozen=True)
class TrialMeasures:
    """What one trial gave."""

    row: str
    trial: int
    source_episodes: int
    source_hours: float
    start_level: float  # [s] of the values that the target task began with; NaN if not known
    reached: bool  # the threshold, within the study's limit
    target_episodes: int  # to the threshold or to the limit
    target_hours: float
    total_hours: float  # of source and target
    initial_performance: float  # [s]
    asymptotic_performance: float  # [s] of the last window; NaN where trials stop at a threshold
    total_reward: float  # [s h] area under the learning curve, to where every trial went
    greedy_performance: float  # [s] without learning and exploring; NaN if not played
    code_version: str


@dataclass(frozen=True)
class Against:
    """How a row compares with a reference row: positive differences are hours saved."""

    pairs: int  # that the comparisons are of; 0: the rows are independent
    target: Comparison
    total: Comparison
    jumpstart: Comparison  # [s] longer than the reference over the first episodes
    target_holm: float  # p-values after Holm's adjustment over the rows
    total_holm: float
    jumpstart_holm: float
    logrank_holm: float


@dataclass(frozen=True)
class RowSummary:
    """A line of the table."""

    name: str
    trials: int
    reached: int
    source_hours: float  # mean
    start_level: float  # [s] mean over the trials; NaN if not known
    target: Interval  # hours
    total: Interval  # hours
    initial: Interval  # [s]
    asymptotic: Interval  # [s]
    greedy: Interval  # [s]
    transfer_ratio: float  # of the mean total rewards, against the first reference
    against: dict[str, Against]  # by reference row


def measure_trials(results: StudyResults, threshold: float | None = None) -> list[TrialMeasures]:
    """The measures of every trial, in the order of the rows.

    Args:
        results: that were read.
        threshold: another than the study's [s].

    Raises:
        StudyError: no trials of the reference row; a threshold that trials were not run to, or
            that records without episodes know nothing of.
    """
    study, records = results.study, results.records
    threshold = checked_threshold(results, threshold)
    if not any(record.row == study.references[0] for record in records):
        raise StudyError(
            f"no trial of row {study.references[0]!r} is done yet: nothing to compare with"
        )
    horizon = min(metrics.hours(seconds(record.blocks)) for record in records)
    order = [row.name for row in study.rows]
    records = tuple(sorted(records, key=lambda one: (order.index(one.row), one.number)))
    goes_on = goes_on_after_threshold(results)
    return [_measures(record, study, threshold, horizon, goes_on) for record in records]


def goes_on_after_threshold(results: StudyResults) -> bool:
    """Did all trials run for the same time, whenever they reached the threshold?

    If not, what they hold at their end is the threshold, by construction.
    """
    study = results.study
    return study.min_hours >= study.max_hours or not any(one.crossed for one in results.records)


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
    scratch = float(np.mean(values(by_row[study.references[0]], "total_reward")))
    return [_summary(name, trials, scratch, against[name]) for name, trials in by_row.items()]


def compare(
    first: Sequence[TrialMeasures], second: Sequence[TrialMeasures], measure: str, paired: bool
) -> Comparison:
    """Mean of a measure in the first trials less that in the second.

    Args:
        first: trials of one row.
        second: of another.
        measure: a name of TrialMeasures.
        paired: are trials of one number pairs? Those without a partner are left out.
    """
    if not paired:
        return statistics.welch(values(first, measure), values(second, measure))
    one, other = (
        {trial.trial: getattr(trial, measure) for trial in row} for row in (first, second)
    )
    numbers = sorted(one.keys() & other.keys())
    return statistics.paired([one[k] for k in numbers], [other[k] for k in numbers])


def verdict(comparison: Comparison, p_value: float, margin: float = EQUIVALENT_HOURS) -> str:
    """What a comparison of hours shows, in a word.

    >>> verdict(Comparison(3.0, 1.0, 5.0, 0.01), 0.02)
    'saves'
    >>> verdict(Comparison(-0.1, -0.8, 0.6, 0.8), 0.9)
    'none: within 0.8 h'
    >>> verdict(Comparison(0.5, 0.1, 0.9, 0.02), 0.08)
    'open'
    """
    if p_value < SIGNIFICANT:
        return "saves" if comparison.difference > 0 else "costs"
    furthest = max(abs(comparison.low), abs(comparison.high))
    if comparison.low <= 0 <= comparison.high and furthest <= margin:
        return f"none: within {furthest:.1f} h"
    return "open"


def seconds(cycles: Sequence[int]) -> metrics.Floats:
    """Durations [s] of episodes given in cycles."""
    return np.asarray(cycles, dtype=np.float64) * CYCLE_TIME


def checked_threshold(results: StudyResults, threshold: float | None) -> float:
    """The threshold to use [s]: the study's, or another one that its trials were run to."""
    study = results.study
    if threshold is None or threshold == study.threshold:
        return study.threshold
    if threshold > study.threshold and study.min_hours < study.max_hours:
        raise StudyError(
            f"threshold={threshold:g}: the trials stopped at {study.threshold:g} s, give less"
        )
    if not all(record.has_episodes for record in results.records):
        raise StudyError(
            f"threshold={threshold:g}: of these trials only the times to {study.threshold:g} s are"
            " known"
        )
    return threshold


def crossing_of(record: Record, study: Study, threshold: float) -> metrics.TimeToThreshold:
    """When a trial passed a threshold [s]: exactly for the study's, else to the end of a block."""
    if threshold == study.threshold:
        return metrics.TimeToThreshold(
            record.crossed, record.crossing_episodes, record.crossing_hours
        )
    means = seconds(record.blocks) / record.block
    found = metrics.time_to_threshold(means, threshold, study.window // record.block)
    if not found.reached:
        return metrics.TimeToThreshold(False, record.episodes, record.hours)
    return found._replace(episodes=found.episodes * record.block, hours=found.hours * record.block)


def values(trials: Sequence[TrialMeasures], measure: str) -> list[float]:
    """One measure of many trials."""
    return [getattr(one, measure) for one in trials]


def _measures(
    record: Record, study: Study, threshold: float, horizon: float, goes_on: bool
) -> TrialMeasures:
    crossing = crossing_of(record, study, threshold)
    reached = crossing.reached and crossing.hours <= study.max_hours
    target_hours = crossing.hours if reached else study.max_hours
    return TrialMeasures(
        row=record.row,
        trial=record.number,
        source_episodes=record.source_episodes,
        source_hours=record.source_hours,
        start_level=_known(record.start_level),
        reached=reached,
        target_episodes=crossing.episodes,
        target_hours=target_hours,
        total_hours=record.source_hours + target_hours,
        initial_performance=record.initial,
        asymptotic_performance=record.final if goes_on else float("nan"),
        total_reward=_total_reward(record, horizon, study.window),
        greedy_performance=_known(record.greedy),
        code_version=record.code_version,
    )


def _known(value: float | None) -> float:
    return float("nan") if value is None else value


def _total_reward(record: Record, horizon: float, window: int) -> float:
    if not record.has_episodes:
        return float("nan")
    return metrics.total_reward(seconds(record.blocks), horizon, window, block=record.block)


def _compare(
    study: Study, by_row: dict[str, list[TrialMeasures]], reference: str
) -> dict[str, Against]:
    """Every other row against the reference; Holm adjusts over these rows."""
    base = by_row.get(reference, [])
    names = [name for name, trials in by_row.items() if name != reference and len(trials) > 1]
    if len(base) < 2 or not names:
        return {}
    pairs = {name: _pairs(study, reference, base, name, by_row[name]) for name in names}

    def of_all(compared: Callable[[str], Comparison]) -> tuple[list[Comparison], list[float]]:
        found = [compared(name) for name in names]
        return found, statistics.holm([one.p_value for one in found]).tolist()

    def saved(measure: str) -> tuple[list[Comparison], list[float]]:
        return of_all(lambda name: compare(base, by_row[name], measure, pairs[name] > 0))

    target, target_holm = saved("target_hours")
    total, total_holm = saved("total_hours")
    jumpstart, jumpstart_holm = of_all(
        lambda name: compare(by_row[name], base, "initial_performance", pairs[name] > 0)
    )
    logrank = statistics.holm([_logrank(base, by_row[name]) for name in names]).tolist()
    rest = target, total, jumpstart, target_holm, total_holm, jumpstart_holm, logrank
    return {
        name: Against(pairs[name], *entries) for name, *entries in zip(names, *rest, strict=True)
    }


def _pairs(
    study: Study,
    reference: str,
    base: Sequence[TrialMeasures],
    name: str,
    trials: Sequence[TrialMeasures],
) -> int:
    """How many pairs two rows have; 0 if their trials are none, or if there is but one."""
    rows = {row.name: row for row in study.rows}
    if not study.are_paired(rows[reference], rows[name]):
        return 0
    both = {one.trial for one in base} & {one.trial for one in trials}
    return len(both) if len(both) > 1 else 0


def _logrank(base: list[TrialMeasures], other: list[TrialMeasures]) -> float:
    return statistics.logrank(
        values(base, "target_hours"),
        [one.reached for one in base],
        values(other, "target_hours"),
        [one.reached for one in other],
    )


def _summary(
    name: str, trials: list[TrialMeasures], scratch_reward: float, against: dict[str, Against]
) -> RowSummary:
    def mean(measure: str) -> Interval:
        return statistics.mean_interval(values(trials, measure))

    rewards = float(np.mean(values(trials, "total_reward")))
    return RowSummary(
        name=name,
        trials=len(trials),
        reached=sum(one.reached for one in trials),
        source_hours=float(np.mean(values(trials, "source_hours"))),
        start_level=float(np.mean(values(trials, "start_level"))),
        target=mean("target_hours"),
        total=mean("total_hours"),
        initial=mean("initial_performance"),
        asymptotic=mean("asymptotic_performance"),
        greedy=mean("greedy_performance"),
        transfer_ratio=metrics.transfer_ratio(rewards, scratch_reward),
        against=against,
    )
