"""Intervals and tests on numbers worked out by hand or known from elsewhere."""

import math

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.multitest import multipletests

from keepaway_transfer.reports import statistics

# Eight trials: two reached the threshold at 2 and 3 h, one stopped at 3 h without, ...
TIMES = [2, 3, 3, 5, 8, 10, 10, 10]
REACHED = [True, True, False, True, True, False, False, False]


@pytest.fixture
def generator():
    return np.random.default_rng(7)


def test_welch_on_student_sized_numbers():
    # Means 2 and 5, variances 1 and 4, three values each: t = -3 / sqrt(5/3).
    comparison = statistics.welch([1, 2, 3], [3, 5, 7])
    freedom = (1 / 3 + 4 / 3) ** 2 / ((1 / 3) ** 2 / 2 + (4 / 3) ** 2 / 2)
    assert freedom == pytest.approx(2.941, abs=1e-3)
    assert comparison.difference == -3.0
    assert (comparison.low + comparison.high) / 2 == pytest.approx(-3.0)
    assert comparison.p_value == pytest.approx(0.1041, abs=1e-3)


def test_values_without_spread_leave_no_doubt():
    assert statistics.welch([9.0, 9.0], [9.0, 9.0, 9.0]) == (0.0, 0.0, 0.0, 1.0)
    assert statistics.welch([8.0, 8.0], [9.0, 9.0]) == (-1.0, -1.0, -1.0, 0.0)


def test_arms_that_never_reach_the_threshold_do_not_differ():
    assert statistics.logrank([9.0, 9.0], [False, False], [9.0], [False]) == 1.0


def test_arms_that_all_take_the_same_time_do_not_differ():
    assert statistics.logrank([2.0, 2.0], [True, True], [2.0], [True]) == 1.0


def test_kaplan_meier_counts_a_censored_trial_as_at_risk_until_it_stopped():
    curve = statistics.kaplan_meier(TIMES, REACHED)
    assert curve.times.tolist() == [2, 3, 5, 8]
    assert curve.share == pytest.approx([7 / 8, 6 / 8, 6 / 8 * 4 / 5, 6 / 8 * 4 / 5 * 3 / 4])


def test_logrank_agrees_with_lifelines():
    slower = [4, 6, 9, 10, 10, 10, 10, 10], [True] * 3 + [False] * 5
    # lifelines 0.30: logrank_test(TIMES, slower[0], REACHED, slower[1]).p_value
    assert statistics.logrank(TIMES, REACHED, *slower) == pytest.approx(0.38007436)


def test_a_mean_has_students_interval():
    values = np.array([4.0, 7.0, 5.0, 9.0])
    by_hand = stats.ttest_1samp(values, 0).confidence_interval()
    assert statistics.mean_interval(values) == pytest.approx((6.25, by_hand.low, by_hand.high))


def test_values_without_spread_have_a_point_for_an_interval():
    assert statistics.mean_interval([3.0, 3.0]) == (3.0, 3.0, 3.0)
    assert statistics.mean_interval([3.0]) == (3.0, 3.0, 3.0)


def test_the_mean_curve_has_students_interval_at_each_point():
    # Values 1 and 3: mean 2, standard error 1, one degree of freedom: t = 12.706.
    curve = statistics.mean_curve([[1.0, 5.0], [3.0, 5.0]])
    assert curve.estimate.tolist() == [2.0, 5.0]
    assert curve.high - curve.estimate == pytest.approx([12.706, 0.0], abs=1e-3)


def test_the_mean_curve_ends_where_the_first_trial_stopped():
    assert np.isnan(statistics.mean_curve([[1.0, np.nan], [3.0, 4.0]]).estimate).tolist() == [
        False,
        True,
    ]


def test_pairs_by_hand():
    # Differences 1, 2, 3: mean 2, standard error 1 / sqrt(3), t = 2 sqrt(3) of 2 degrees.
    comparison = statistics.paired([2, 5, 9], [1, 3, 6])
    assert comparison.difference == 2.0
    assert comparison.high - 2.0 == pytest.approx(4.302653 / math.sqrt(3))
    assert comparison.p_value == pytest.approx(0.0741799)


def test_pairing_removes_what_a_source_gives_to_both_rows(generator):
    source, noise = generator.normal(0, 5, size=50), generator.normal(0, 0.1, size=50)
    comparison = statistics.paired(source + 1.0 + noise, source)
    assert comparison.low == pytest.approx(1.0, abs=0.1)
    assert comparison.high == pytest.approx(1.0, abs=0.1)


def test_one_value_has_no_error():
    assert statistics.mean_and_error([3.0]) == (3.0, None)


def test_what_is_not_known_has_no_interval():
    assert np.isnan(statistics.mean_interval([1.0, np.nan])).all()


def test_holm_multiplies_the_smallest_by_the_number_of_rows():
    # Sorted .01, .03, .04 by 3, 2, 1: .03, .06, .04, and never below the one before.
    assert statistics.holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])


def test_holm_gives_the_bits_of_statsmodels():
    generator = np.random.default_rng(1)
    for number in range(1, 30, 4):
        p_values = generator.random(number).round(2) ** 2  # some are equal, some are 0
        expected = multipletests(p_values, method="holm")[1]
        np.testing.assert_array_equal(statistics.holm(p_values), expected)


def test_trials_needed_for_the_effects_of_the_facts_page():
    assert statistics.trials_needed(effect=0.20, variation=0.25) == 26
    assert statistics.trials_needed(effect=0.10, variation=0.25) == 100


def test_no_test_takes_fewer_than_two_trials():
    assert statistics.trials_needed(effect=0.10, variation=0.001) == 2


def test_detectable_effect_inverts_trials_needed():
    assert statistics.detectable_effect(100, variation=0.25) == pytest.approx(0.10, abs=0.001)
