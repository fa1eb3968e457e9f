"""Figures are written, say what made them, and show the numbers they were given."""

import numpy as np
import pytest
from matplotlib.image import imread

from keepaway_transfer.reports import plotting, statistics


def lines(figure):
    """(x, y) of every line drawn in the figure's only axes."""
    (axes,) = figure.axes
    return [(np.asarray(line.get_xdata()), np.asarray(line.get_ydata())) for line in axes.lines]


@pytest.fixture
def curve_figure():
    hours = np.array([1.0, 2.0, 3.0])
    trials = np.array([[5.0, 6.0, 7.0], [5.0, 8.0, 9.0]])
    groups = {
        "from scratch": plotting.CurveGroup(trials, statistics.mean_curve(trials)),
        "after transfer": plotting.CurveGroup(trials + 1, statistics.mean_curve(trials + 1)),
    }
    return plotting.learning_curves(hours, groups, threshold=9.0, title="4v3")


def test_learning_curves_draw_each_trial_and_the_mean(curve_figure):
    drawn = [y.tolist() for _, y in lines(curve_figure)]
    assert drawn[:3] == [[5.0, 6.0, 7.0], [5.0, 8.0, 9.0], [5.0, 7.0, 8.0]]
    assert len(drawn) == 2 * 3 + 1  # and the threshold


def test_a_figure_is_written_with_what_made_it(curve_figure, tmp_path):
    path = tmp_path / "figure.png"
    plotting.save_figure(curve_figure, path, "study tiny, seed 7")
    assert imread(path).shape == (690, 1080, 4)
    assert b"study tiny, seed 7" in path.read_bytes()


def test_time_to_threshold_draws_an_estimate_a_row():
    target = [statistics.Interval(8, 7, 9), statistics.Interval(5, 4, 6)]
    total = [statistics.Interval(8, 7, 9), statistics.Interval(7, 6, 8)]
    figure = plotting.times_by_amount(
        ["0", "1,000"], target, total, target[0], title="4v3", amount="Episodes of 3v2"
    )
    estimates = [y.tolist() for x, y in lines(figure) if len(x) == 2]
    assert [8, 5] in estimates
    assert [8, 7] in estimates


def test_the_share_at_the_threshold_rises_to_those_that_reached_it():
    curve = statistics.kaplan_meier([1.0, 2.0, 4.0, 4.0], [True, True, False, False])
    ((times, reached),) = lines(plotting.share_reached({"0": curve}, limit=4.0, title="4v3"))
    assert times.tolist() == [0, 1, 2, 4]
    assert reached == pytest.approx([0, 0.25, 0.5, 0.5])


def test_trials_that_never_reach_the_threshold_are_a_flat_line():
    curve = statistics.kaplan_meier([4.0, 4.0], [False, False])
    ((_, reached),) = lines(plotting.share_reached({"0": curve}, limit=4.0, title="4v3"))
    assert not reached.any()


def test_where_all_trials_have_reached_it_the_axis_ends_soon_after():
    early = statistics.kaplan_meier([1.0, 2.0], [True, True])
    late = statistics.kaplan_meier([1.0, 4.0], [True, False])
    for curves, end in (({"0": early}, 2.1), ({"0": early, "10": late}, 60.0)):
        (axes,) = plotting.share_reached(curves, limit=60.0, title="4v3").axes
        assert axes.get_xlim() == pytest.approx((0, end))


def test_ways_are_listed_from_the_top_and_not_connected():
    target = [statistics.Interval(8, 7, 9), statistics.Interval(5, 4, 6)]
    total = [statistics.Interval(8, 7, 9), statistics.Interval(7, 6, 8)]
    (axes,) = plotting.times_by_way(["a", "b"], target, total, target[0], title="4v3").axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["a", "b"]
    assert axes.get_yticks().tolist() == [1, 0]
    points = [line for line in axes.lines if line.get_marker() == "o"]
    assert [np.asarray(line.get_xdata()).tolist() for line in points] == [[8, 5], [8, 7]]
    assert {line.get_linestyle() for line in points} == {"None"}


def test_the_distribution_of_durations_falls_by_one_episode_a_step():
    first, last = lines(plotting.durations({"scratch": ([4.0, 2.0], [6.0])}, title="4v3"))
    assert [axis.tolist() for axis in first] == [[0, 2, 4], [1, 0.5, 0]]
    assert [axis.tolist() for axis in last] == [[0, 6], [1, 0]]


def test_more_lines_than_the_palette_has_still_differ_in_colour():
    groups = {str(row): ([float(row + 1)], [2.0]) for row in range(10)}
    (axes,) = plotting.durations(groups, title="4v3").axes
    assert len({line.get_color() for line in axes.lines}) == 10
