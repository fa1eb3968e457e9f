"""Intervals and tests for the times of many trials, on scipy and statsmodels.

Values are one number a trial. A trial that never reached its threshold is right-censored:
`reached` is False and its time is how long it ran.
"""

import math
import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats
from statsmodels.duration.survfunc import SurvfuncRight
from statsmodels.stats.power import TTestIndPower

from keepaway_transfer.metrics import Floats

CONFIDENCE = 0.95


class Interval(NamedTuple):
    """An estimate and the ends of its confidence interval."""

    estimate: float
    low: float
    high: float


class Curve(NamedTuple):
    """An estimate and the ends of its confidence interval at each of many points."""

    estimate: Floats  # (num_points,)
    low: Floats  # (num_points,)
    high: Floats  # (num_points,)


class Comparison(NamedTuple):
    """Difference of two means with its confidence interval and the p-value of no difference."""

    difference: float
    low: float
    high: float
    p_value: float


class SurvivalCurve(NamedTuple):
    """Kaplan-Meier estimate: the share of trials still short of the threshold from each time on."""

    times: Floats  # (num_times,) when some trial reached the threshold
    share: Floats  # (num_times,)
    variance: Floats  # (num_times,) Greenwood's sum of d / (n (n - d)) up to each; d reached of n


def welch(first: ArrayLike, second: ArrayLike, confidence: float = CONFIDENCE) -> Comparison:
    """Welch's t-test of mean(first) - mean(second), two-sided, variances not assumed equal.

    Values without any spread leave no doubt: p is 1 for equal means, else 0.
    """
    one, other = _floats(first), _floats(second)
    if np.ptp(one) == np.ptp(other) == 0:
        difference = float(one[0] - other[0])
        return Comparison(difference, difference, difference, float(difference == 0))
    with warnings.catch_warnings():  # scipy's, where one of both has no spread: nothing is lost
        warnings.simplefilter("ignore", RuntimeWarning)
        test = stats.ttest_ind(one, other, equal_var=False)
    low, high = test.confidence_interval(confidence)
    return Comparison(float(one.mean() - other.mean()), float(low), float(high), float(test.pvalue))


def paired(first: ArrayLike, second: ArrayLike, confidence: float = CONFIDENCE) -> Comparison:
    """The paired t-test of mean(first) - mean(second), two-sided: entry i of both is a pair.

    Differences without any spread leave no doubt: p is 1 for equal means, else 0.
    """
    one, other = _floats(first), _floats(second)
    difference = float((one - other).mean())
    if np.ptp(one - other) == 0:
        return Comparison(difference, difference, difference, float(difference == 0))
    test = stats.ttest_rel(one, other)
    low, high = test.confidence_interval(confidence)
    return Comparison(difference, float(low), float(high), float(test.pvalue))


def mean_and_error(values: ArrayLike) -> tuple[float, float | None]:
    """The mean of independent values and its standard error; None if there is but one.

    >>> mean_and_error([4.0, 6.0])
    (5.0, 1.0)
    """
    values = _floats(values)
    error = float(stats.sem(values)) if len(values) > 1 else None
    return float(values.mean()), error


def mean_interval(values: ArrayLike, confidence: float = CONFIDENCE) -> Interval:
    """The mean of independent values with Student's interval.

    The interval is a point if there is but one value; nothing is known if one is unknown (NaN).

    >>> [round(end, 3) for end in mean_interval([1.0, 3.0])]
    [2.0, -10.706, 14.706]
    """
    mean, error = mean_and_error(values)
    if not error:
        return Interval(mean, mean, mean)
    half = float(stats.t.ppf((1 + confidence) / 2, len(_floats(values)) - 1)) * error
    return Interval(mean, mean - half, mean + half)


def mean_curve(curves: ArrayLike, confidence: float = CONFIDENCE) -> Curve:
    """Mean of curves, (num_trials, num_points), with Student's interval at each point.

    NaN where a trial has no value: a mean over the others would be one over the slower trials,
    because trials stop when they reach the threshold.
    """
    curves = _floats(curves)
    trials = len(curves)
    mean = curves.mean(axis=0)
    error = curves.std(axis=0, ddof=1) / math.sqrt(trials) if trials > 1 else np.zeros_like(mean)
    half = float(stats.t.ppf((1 + confidence) / 2, max(trials - 1, 1))) * error
    return Curve(mean, mean - half, mean + half)


def kaplan_meier(times: ArrayLike, reached: ArrayLike) -> SurvivalCurve:
    """Share of trials that have not reached the threshold, as a function of time.

    >>> kaplan_meier([1.0, 2.0, 3.0], [True, False, True]).share.round(3)
    array([0.667, 0.   ])
    """
    curve = SurvfuncRight(_floats(times), np.asarray(reached, int))
    at_risk, events = np.asarray(curve.n_risk, float), np.asarray(curve.n_events, float)
    left = at_risk - events
    terms = np.divide(events, at_risk * left, out=np.zeros_like(left), where=left > 0)
    return SurvivalCurve(
        np.asarray(curve.surv_times), np.asarray(curve.surv_prob), np.cumsum(terms)
    )


def logrank(
    first: ArrayLike, first_reached: ArrayLike, second: ArrayLike, second_reached: ArrayLike
) -> float:
    """The p-value of the two-sided log-rank test that both arms reach the threshold alike.

    It is 1 if no trial of either did, or if all took the same time.
    """
    times = np.concatenate([_floats(first), _floats(second)])
    if np.ptp(times) == 0 or not (np.any(first_reached) or np.any(second_reached)):
        return 1.0
    return float(
        stats.logrank(_censored(first, first_reached), _censored(second, second_reached)).pvalue
    )


def holm(p_values: ArrayLike) -> Floats:
    """Holm's step-down adjustment of the p-values of one table.

    That of statsmodels does the same, and collects garbage in each call: seconds of a report.

    >>> holm([0.01, 0.04, 0.03])
    array([0.03, 0.06, 0.06])
    """
    values = _floats(p_values)
    order, adjusted = np.argsort(values), np.empty_like(values)
    larger = values[order] * np.arange(len(values), 0, -1)
    adjusted[order] = np.minimum(np.maximum.accumulate(larger), 1.0)
    return adjusted


def trials_needed(effect: float, variation: float, power: float = 0.8, alpha: float = 0.05) -> int:
    """Trials an arm to see a relative difference `effect` of the means.

    `variation` is the coefficient of variation of the times within an arm.

    >>> trials_needed(effect=0.20, variation=0.25), trials_needed(effect=0.10, variation=0.25)
    (26, 100)
    """
    size, test = effect / variation, TTestIndPower()
    if test.power(size, nobs1=2, alpha=alpha) >= power:
        return 2  # a t-test takes no fewer
    trials: float = test.solve_power(effect_size=size, power=power, alpha=alpha)
    return math.ceil(trials)


def detectable_effect(
    trials: int, variation: float, power: float = 0.8, alpha: float = 0.05
) -> float:
    """The smallest difference of means that `trials` an arm see with this power.

    It is in the unit of `variation`: relative if that is a coefficient of variation, in hours if it
    is the standard deviation of hours.

    >>> round(detectable_effect(trials=100, variation=0.25), 3)
    0.1
    """
    size = TTestIndPower().solve_power(nobs1=trials, power=power, alpha=alpha)
    return float(size) * variation


def _censored(times: ArrayLike, reached: ArrayLike) -> stats.CensoredData:
    return stats.CensoredData.right_censored(_floats(times), ~np.asarray(reached, bool))


def _floats(values: ArrayLike) -> Floats:
    return np.asarray(values, dtype=np.float64)
