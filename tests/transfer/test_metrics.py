"""The measures of transfer on durations worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keepaway_transfer import metrics

HALF_HOUR = 1800.0  # [s]


def test_the_windowed_mean_of_four_values():
    assert metrics.windowed_mean([1, 2, 3, 7], window=2).tolist() == [1.5, 2.5, 5.0]


def test_a_trial_shorter_than_the_window_has_no_windowed_mean():
    assert metrics.windowed_mean([1.0, 2.0], window=3).size == 0


def test_the_threshold_is_reached_by_the_episode_that_lifts_the_mean_above_it():
    # Windows of two: 1800, 2700, 3600. The second is the first above 2000: 1 + 1 + 2 half hours.
    crossing = metrics.time_to_threshold([1800, 1800, 3600, 3600], threshold=2000, window=2)
    assert crossing == (True, 3, 2.0)


def test_a_mean_equal_to_the_threshold_has_not_reached_it():
    assert not metrics.time_to_threshold([9.0] * 10, threshold=9.0, window=5).reached


def test_a_trial_that_never_reaches_the_threshold_keeps_the_time_it_ran():
    assert metrics.time_to_threshold([HALF_HOUR] * 6, threshold=1e6, window=2) == (False, 6, 3.0)


def test_later_episodes_do_not_move_the_crossing():
    durations = [1800, 1800, 3600, 3600]
    longer = [*durations, 1, 1, 1]
    assert metrics.time_to_threshold(longer, 2000, 2) == metrics.time_to_threshold(
        durations, 2000, 2
    )


@given(st.lists(st.floats(0.1, 100), min_size=1, max_size=60), st.integers(1, 10), st.floats(0, 60))
def test_the_crossing_is_the_first_window_above_by_plain_search(durations, window, threshold):
    expected = (False, len(durations))
    for end in range(window, len(durations) + 1):
        if metrics.windowed_mean(durations, window)[end - window] > threshold:
            expected = (True, end)
            break
    crossing = metrics.time_to_threshold(durations, threshold, window)
    assert (crossing.reached, crossing.episodes) == expected
    assert crossing.hours == pytest.approx(sum(durations[: crossing.episodes]) / 3600)


def test_initial_and_asymptotic_performance_are_the_two_ends():
    durations = [2.0, 4.0, 100.0, 6.0, 8.0]
    assert metrics.initial_performance(durations, episodes=2) == 3.0
    assert metrics.asymptotic_performance(durations, window=2) == 7.0


def test_the_learning_curve_is_the_mean_of_the_last_episodes_that_ended():
    # Episodes end at 0.5, 1.0, 2.0 h.
    curve = metrics.learning_curve([1800, 1800, 3600], [0.4, 0.5, 1.9, 2.0, 2.1], window=2)
    np.testing.assert_allclose(curve, [np.nan, 1800, 1800, 2700, np.nan])


def test_the_learning_curve_can_wait_for_enough_episodes():
    curve = metrics.learning_curve([1800, 1800, 3600], [0.5, 1.0, 2.0], window=3, least=2)
    np.testing.assert_allclose(curve, [np.nan, 1800, 2400])


def test_the_total_reward_of_a_flat_curve_is_height_times_hours():
    assert metrics.total_reward([36.0] * 200, horizon=2.0) == pytest.approx(72.0)


def test_the_total_reward_of_a_curve_that_doubles_halfway():
    durations = [36.0] * 100 + [72.0] * 50  # 1 h of each
    area = metrics.total_reward(durations, horizon=2.0, window=1, points=1000)
    assert area == pytest.approx(36 + 72, rel=2e-2)  # an episode of 72 s counts when it ended


def test_the_total_reward_of_a_trial_that_stopped_before_the_horizon_is_unknown():
    assert np.isnan(metrics.total_reward([36.0] * 100, horizon=2.0))


def test_a_quarter_more_reward_is_a_transfer_ratio_of_a_quarter():
    assert metrics.transfer_ratio(transferred=125.0, scratch=100.0) == 0.25
