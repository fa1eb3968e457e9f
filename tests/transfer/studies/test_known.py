"""Trials of another study are taken over where they are the same runs, and only there."""

import dataclasses

import attrs
import pytest

from keepaway_transfer.errors import StudyError
from keepaway_transfer.studies.batch import play_batch
from keepaway_transfer.studies.known import check_known, known_trials, to_play_again
from keepaway_transfer.studies.results import StudyResults, record_of
from keepaway_transfer.studies.study import Row, Stage, load_study

TINY = load_study("tiny")
ROWS = (
    Row("scratch"),
    Row("four", (Stage("2v1", 4),)),
    Row("other", (Stage("2v1", 4),), "rescaled"),
)
OTHER = attrs.evolve(TINY, name="other", rows=ROWS, references=("scratch",), trials=1)
KEYS = [("0", 0), ("0", 1), ("4", 0), ("8", 0)]
pytestmark = pytest.mark.timeout(1200)  # the first trial on a machine waits for the compiler


@pytest.fixture(scope="module")
def results():
    """What is kept of some trials of TINY."""
    records = tuple(record_of(trial, TINY) for trial in play_batch(TINY, KEYS))
    return StudyResults(TINY, "scripts/study.py tiny", "0.1.0", records)


def test_rows_that_start_alike_are_known_under_their_own_names(results):
    known = known_trials(OTHER, [results])
    assert set(known) == {("scratch", 0), ("four", 0)}
    assert dataclasses.replace(known["four", 0], row="4") == results.records[2]


def test_known_trials_are_what_playing_them_gives(results):
    known = known_trials(OTHER, [results])
    played = play_batch(OTHER, list(known))
    check_known(OTHER, played, known)
    assert [record_of(trial, OTHER).blocks for trial in played] == [
        record.blocks for record in known.values()
    ]


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 99},
        {"threshold": 8.0},
        {"max_hours": 0.02},
        {"greedy_episodes": 1},
        {"world": {"ball_decay": 0.9}},
        {"learner": {"alpha": 0.1}},
        {"widths": "framework"},
        {"shared_keepers": True},
        {"shared_seeds": True},
    ],
    ids=str,
)
def test_nothing_is_known_of_a_study_of_other_settings(results, change):
    assert known_trials(attrs.evolve(OTHER, **change), [results]) == {}


def test_sources_that_are_shared_are_other_runs(results):
    known = known_trials(attrs.evolve(OTHER, shared_sources=True), [results])
    assert set(known) == {("scratch", 0)}


def test_a_trial_that_comes_out_otherwise_is_refused_by_its_row(results):
    known = known_trials(OTHER, [results])
    first = to_play_again(known)
    assert first == [("four", 0), ("scratch", 0)]
    played = play_batch(OTHER, first)
    known["four", 0] = dataclasses.replace(known["four", 0], blocks=(1,))
    with pytest.raises(
        StudyError, match=r"row 'four', trial 0: .* of another world, leave --known"
    ):
        check_known(OTHER, played, known)


def test_a_trial_of_each_row_and_version_is_played_again(results):
    other = attrs.evolve(OTHER, trials=2)
    known = known_trials(other, [results])
    assert to_play_again(known) == [("four", 0), ("scratch", 0)]
    known["scratch", 1] = dataclasses.replace(known["scratch", 1], code_version="0.2.0")
    assert to_play_again(known) == [("four", 0), ("scratch", 0), ("scratch", 1)]
