"""From trials to the table: hand-worked times, censored trials kept, and what is refused."""

import dataclasses

import attrs
import numpy as np
import pytest
from matplotlib.image import imread
from scipy import stats

from keepaway_transfer.errors import StudyError
from keepaway_transfer.reports.report import write_report
from keepaway_transfer.reports.summary import measure_trials, summarise
from keepaway_transfer.studies.results import SourceRun, StudyResults, StudyTrial, record_of
from keepaway_transfer.studies.study import Row, Stage, Study

HOUR = 36_000  # [cycles]
STUDY = Study(
    name="worked",
    target="4v3",
    rows=(Row("0"), Row("10", (Stage("3v2", 10),))),
    references=("0",),
    threshold=1000.0,
    seed=3,
    window=2,
    max_hours=10.0,
)


def trial(row, number, hours, *, reaches=True, source_hours=0.0):
    """A trial of half-hour episodes whose last window of two is the first above 1,000 s."""
    sources = (SourceRun("3v2", 10, int(source_hours * HOUR), keeper=0),) if source_hours else ()
    halves = int(hours * 2) - 2
    rising = (HOUR // 2, HOUR // 2) if reaches else (9000, 9000, 9000, 9000)
    cycles = (9000, 9000) * halves + rising  # quarters of an hour are 900 s, halves 1800 s
    return StudyTrial(row, number, sources, cycles, (80, 100), "v1")


def results(*trials, study=STUDY):
    records = tuple(record_of(one, study) for one in trials)
    return StudyResults(study, "scripts/study.py worked", "v1", records)


def differences(study, first, second):
    """What the third row of a study has against the second."""
    trials = [trial("0", number, 8 + 0.5 * number) for number in range(len(first))]
    trials += [trial("a", k, hours, source_hours=0.5) for k, hours in enumerate(first)]
    trials += [trial("b", k, hours, source_hours=0.5) for k, hours in enumerate(second)]
    return summarise(study, measure_trials(results(*trials, study=study)))[2].against["a"]


@pytest.fixture
def worked():
    scratch = [trial("0", 0, 6), trial("0", 1, 8), trial("0", 2, 10, reaches=False)]
    after = [trial("10", number, 3 + number, source_hours=0.5) for number in range(3)]
    return results(*scratch, *after)


def test_each_trial_is_measured_from_its_own_episodes(worked):
    first, *_, last = measure_trials(worked)
    # 6 h less the second half hour of the last window: the first half hour lifts the mean.
    assert (first.reached, first.target_hours, first.total_hours) == (True, 5.5, 5.5)
    assert (last.row, last.source_episodes, last.source_hours) == ("10", 10, 0.5)
    assert last.total_hours == last.target_hours + 0.5 == 5.0
    assert last.greedy_performance == 9.0


def test_what_trials_hold_at_their_end_is_told_only_where_they_do_not_stop_at_the_threshold():
    stopping, going_on = STUDY, attrs.evolve(STUDY, min_hours=10.0)
    for study, expected in ((stopping, [np.nan] * 2), (going_on, [1800.0] * 2)):
        trials = [trial("0", 0, 6), trial("0", 1, 8)]
        found = measure_trials(results(*trials, study=study))
        np.testing.assert_equal([one.asymptotic_performance for one in found], expected)


def test_trials_of_which_none_reached_the_threshold_did_not_stop_there():
    found = measure_trials(results(trial("0", 0, 6, reaches=False)))
    assert found[0].asymptotic_performance == 900.0


def test_a_trial_that_never_reached_the_threshold_counts_with_the_limit(worked):
    third = measure_trials(worked)[2]
    assert (third.reached, third.target_hours) == (False, 10.0)


def test_a_crossing_after_the_limit_is_none():
    late = results(trial("0", 0, 6), trial("0", 1, 12))
    assert [(one.reached, one.target_hours) for one in measure_trials(late)] == [
        (True, 5.5),
        (False, 10.0),
    ]


def test_the_rows_have_restricted_means_and_shares_reached(worked):
    scratch, after = summarise(STUDY, measure_trials(worked))
    assert (scratch.trials, scratch.reached, after.reached) == (3, 2, 3)
    assert scratch.target.estimate == pytest.approx((5.5 + 7.5 + 10) / 3)
    assert after.target.estimate == pytest.approx((2.5 + 3.5 + 4.5) / 3)
    assert after.total.estimate == pytest.approx(after.target.estimate + 0.5)
    assert after.initial.estimate == pytest.approx(after.initial.low, abs=150)


def test_a_row_is_compared_with_the_reference_by_hours_saved(worked):
    scratch, after = summarise(STUDY, measure_trials(worked))
    assert scratch.against == {}
    saved = after.against["0"]
    assert saved.target.difference == pytest.approx(23 / 3 - 3.5)
    assert saved.total.difference == pytest.approx(23 / 3 - 4.0)
    assert saved.target_holm == saved.target.p_value  # one row, nothing to adjust


ROWS = (Row("0"), Row("a", (Stage("3v2", 10),)), Row("b", (Stage("3v2", 20),)))
INDEPENDENT = attrs.evolve(STUDY, rows=ROWS, references=("0", "a"))
SHARED = attrs.evolve(INDEPENDENT, shared_sources=True)


def test_rows_that_share_their_sources_are_tested_as_pairs():
    # b is an hour faster than a, whatever the source is worth.
    against = differences(SHARED, first=[4, 6, 8], second=[3, 5, 7])
    assert against.pairs == 3
    assert against.target == against.total == (1.0, 1.0, 1.0, 0.0)


def test_pairs_are_tested_by_the_paired_t_test():
    first, second = np.array([4, 6, 8, 5.5]), np.array([3, 5.5, 6, 5])
    against = differences(SHARED, first, second)
    by_hand = stats.ttest_rel(first, second)
    assert against.target.p_value == pytest.approx(by_hand.pvalue)
    assert against.target[1:3] == pytest.approx(tuple(by_hand.confidence_interval()))


def test_rows_of_other_sources_are_tested_by_welch():
    first, second = np.array([4, 6, 8, 5.5]), np.array([3, 5.5, 6, 5])
    against = differences(INDEPENDENT, first, second)
    assert against.pairs == 0
    by_hand = stats.ttest_ind(first, second, equal_var=False)
    assert against.target.p_value == pytest.approx(by_hand.pvalue)


def test_trials_without_a_partner_are_no_pairs():
    against = differences(SHARED, first=[4, 6, 8, 12], second=[3, 5, 7])
    assert against.pairs == 3
    assert against.target.difference == 1.0


def test_the_jumpstart_takes_neither_rows_mean_as_known():
    def starting(row, number, cycles):
        return StudyTrial(row, number, (), (cycles, *(HOUR // 2,) * 4), (), "v1")

    scratch, after = [9000, 9400, 9600], [12000, 12800, 12600]
    trials = [starting("0", k, cycles) for k, cycles in enumerate(scratch)]
    trials += [starting("10", k, cycles) for k, cycles in enumerate(after)]
    found = summarise(STUDY, measure_trials(results(*trials)))[1].against["0"].jumpstart
    means = [np.array([(one + 4 * HOUR / 2) / 50 for one in row]) for row in (after, scratch)]
    by_hand = stats.ttest_ind(*means, equal_var=False)
    assert found.difference == pytest.approx(means[0].mean() - means[1].mean())
    assert found[1:3] == pytest.approx(tuple(by_hand.confidence_interval()))


def test_the_report_has_a_table_and_figures(worked, tmp_path):
    text = write_report(worked, tmp_path)
    assert (tmp_path / "table.md").read_text() == text
    assert "| 10 | 3 | 3 | 0.50 | - | 3.50 [" in text
    assert "Made by `scripts/study.py worked`: study worked, seed 3, code v1, 6 trials." in text
    for name in ("learning_curves", "time_to_threshold", "share_reached", "durations"):
        assert imread(tmp_path / f"{name}.png").ndim == 3


def test_a_lower_threshold_is_measured_on_the_same_trials(worked):
    assert measure_trials(worked, threshold=800.0)[0].target_hours == 0.5  # the first window


def test_a_threshold_that_the_trials_were_not_run_to_is_refused(worked):
    with pytest.raises(StudyError, match="the trials stopped at 1000 s"):
        measure_trials(worked, threshold=1200.0)


def test_a_report_of_records_without_episodes_has_no_curves(worked, tmp_path):
    bare = [dataclasses.replace(one, blocks=(), first=(), last=()) for one in worked.records]
    text = write_report(dataclasses.replace(worked, records=tuple(bare), note="Old."), tmp_path)
    assert "| 10 | 3 | 3 | 0.50 | - | 3.50 [" in text
    assert text.endswith("6 trials. Old.\n")
    assert {path.stem for path in tmp_path.glob("*.png")} == {"time_to_threshold", "share_reached"}
    with pytest.raises(StudyError, match="only the times to 1000 s are known"):
        measure_trials(dataclasses.replace(worked, records=tuple(bare)), threshold=800.0)


def test_hours_are_not_drawn_where_hardly_any_trial_reached_the_threshold(worked, tmp_path):
    late = [dataclasses.replace(one, crossed=one.number == 0) for one in worked.records]
    write_report(dataclasses.replace(worked, records=tuple(late)), tmp_path)
    assert {path.stem for path in tmp_path.glob("*.png")} == {"learning_curves", "durations"}


def test_what_the_trials_could_have_shown_is_told_in_hours(worked, tmp_path):
    hours = [5.5, 7.5, 10.0]
    text = write_report(worked, tmp_path)
    assert (
        f"3 times from scratch have a standard deviation of {np.std(hours, ddof=1):.2f} h" in text
    )


def test_results_without_a_scratch_trial_are_refused():
    with pytest.raises(StudyError, match="no trial of row '0' is done yet"):
        measure_trials(results(trial("10", 0, 4)))


def test_a_report_of_few_trials_has_no_comparison_but_a_table(tmp_path):
    text = write_report(results(trial("0", 0, 6), trial("10", 0, 4, source_hours=0.5)), tmp_path)
    assert "| 0 | 1 | 1 |" in text


def test_a_study_of_scratch_alone_has_a_report(tmp_path):
    text = write_report(results(trial("0", 0, 6), trial("0", 1, 7)), tmp_path)
    assert "| 0 | 2 | 2 | 0.00 | - | 6.00 [" in text
    assert "Against row" not in text


def test_equal_results_give_equal_tables(worked, tmp_path):
    assert write_report(worked, tmp_path / "a") == write_report(worked, tmp_path / "b")


def test_total_rewards_are_compared_up_to_where_every_trial_went(worked):
    rewards = [one.total_reward for one in measure_trials(worked)]
    assert not np.isnan(rewards).any()
