"""From trials to the table: hand-worked times, censored trials kept, and what is refused."""

import csv

import numpy as np
import pytest
from matplotlib.image import imread

from keepaway_transfer.errors import StudyError
from keepaway_transfer.reports.report import write_report
from keepaway_transfer.reports.summary import measure_trials, summarise
from keepaway_transfer.studies.results import Results, SourceRun, Trial
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
    return Trial(row, number, sources, cycles, (80, 100), "v1")


def results(*trials, study=STUDY):
    return Results(study, "scripts/study.py worked", "v1", trials)


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
    assert first.asymptotic_performance == 1800.0


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
    assert after.jumpstart.estimate == pytest.approx(0.0, abs=150)


def test_a_row_is_compared_with_the_reference_by_hours_saved(worked):
    scratch, after = summarise(STUDY, measure_trials(worked))
    assert scratch.against == {}
    saved = after.against["0"]
    assert saved.target.difference == pytest.approx(23 / 3 - 3.5)
    assert saved.total.difference == pytest.approx(23 / 3 - 4.0)
    assert saved.target_holm == saved.target.p_value  # one row, nothing to adjust


def test_rows_that_share_their_sources_have_intervals_of_pairs():
    rows = (Row("0"), Row("a", (Stage("3v2", 10),)), Row("b", (Stage("3v2", 10),)))
    study = Study(
        name="shared", target="4v3", rows=rows, references=("0", "a"), threshold=1000.0, seed=3,
        window=2, max_hours=10.0, shared_sources=True,
    )  # fmt: skip
    trials = [trial("0", number, 8 + 0.5 * number) for number in range(3)]
    for number in range(3):  # b is an hour faster than a, whatever the source is worth
        trials.append(trial("a", number, 4 + 2 * number, source_hours=0.5))
        trials.append(trial("b", number, 3 + 2 * number, source_hours=0.5))
    against = summarise(study, measure_trials(results(*trials, study=study)))[2].against["a"]
    assert (against.target.low, against.target.high) == (1.0, 1.0)
    assert against.target.p_value > 0.05  # Welch knows nothing of the pairs


def test_the_report_has_a_line_a_trial_a_table_and_figures(worked, tmp_path):
    text = write_report(worked, tmp_path)
    with open(tmp_path / "trials.csv", newline="") as file:
        lines = list(csv.DictReader(file))
    assert [(line["row"], line["trial"], line["reached"]) for line in lines[:3]] == [
        ("0", "0", "True"),
        ("0", "1", "True"),
        ("0", "2", "False"),
    ]
    assert lines[0]["target_hours"] == "5.5000"
    assert (tmp_path / "table.md").read_text() == text
    assert "| 10 | 3 | 3 | 0.50 | 3.50 [" in text
    assert "Made by `scripts/study.py worked`: study worked, seed 3, code v1, 6 trials." in text
    for name in ("learning_curves", "time_to_threshold", "share_reached", "durations"):
        assert imread(tmp_path / f"{name}.png").ndim == 3


def test_a_lower_threshold_is_measured_on_the_same_trials(worked):
    assert measure_trials(worked, threshold=800.0)[0].target_hours == 0.5  # the first window


def test_a_threshold_that_the_trials_were_not_run_to_is_refused(worked):
    with pytest.raises(StudyError, match="the trials stopped at 1000 s"):
        measure_trials(worked, threshold=1200.0)


def test_results_without_a_scratch_trial_are_refused():
    with pytest.raises(StudyError, match="no trial of row '0' is done yet"):
        measure_trials(results(trial("10", 0, 4)))


def test_a_report_of_few_trials_has_no_comparison_but_a_table(tmp_path):
    text = write_report(results(trial("0", 0, 6), trial("10", 0, 4, source_hours=0.5)), tmp_path)
    assert "| 0 | 1 | 1 |" in text


def test_a_study_of_scratch_alone_has_a_report(tmp_path):
    text = write_report(results(trial("0", 0, 6), trial("0", 1, 7)), tmp_path)
    assert "| 0 | 2 | 2 | 0.00 | 6.00 [" in text
    assert "Against row" not in text


def test_equal_results_give_equal_tables(worked, tmp_path):
    assert write_report(worked, tmp_path / "a") == write_report(worked, tmp_path / "b")


def test_total_rewards_are_compared_up_to_where_every_trial_went(worked):
    rewards = [one.total_reward for one in measure_trials(worked)]
    assert not np.isnan(rewards).any()
