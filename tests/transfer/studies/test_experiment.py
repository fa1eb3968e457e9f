"""A study is run to its end on any executor, whatever interrupts it."""

import gc
import weakref
from concurrent.futures import ThreadPoolExecutor, wait

import attrs
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keepaway_transfer.studies.experiment import StudyProgress, plan, run
from keepaway_transfer.studies.results import StudyTrial, open_results, read_trials
from keepaway_transfer.studies.study import Row, load_study

TINY = load_study("tiny")
KEYS = [(row.name, number) for row in TINY.rows for number in range(TINY.trials)]


def play(study, keys):
    """Trials as if they were played: their episodes tell which they are."""
    return [StudyTrial(row, number, (), (len(row), number), (), "v1") for row, number in keys]


class Power:
    """Plays until the power fails."""

    def __init__(self, batches):
        self.batches = batches

    def play(self, study, keys):
        self.batches -= 1
        if self.batches < 0:
            raise InterruptedError("the power failed")
        return play(study, keys)


def run_all(folder, play, resume=False, study=TINY, batch=3):
    with (
        ThreadPoolExecutor(1) as executor,
        open_results(folder, study, command="x", code_version="v1", resume=resume) as results,
    ):
        return [trial for trials in run(study, results, executor, play, batch) for trial in trials]


@pytest.mark.parametrize("shared", [False, True])
@given(done=st.sets(st.sampled_from(KEYS)), batch=st.integers(1, 20))
def test_every_trial_that_is_left_is_planned_once(shared, done, batch):
    study = attrs.evolve(TINY, shared_sources=shared)
    planned = [key for keys in plan(study, done, batch) for key in keys]
    assert len(planned) == len(set(planned))
    assert set(planned) == set(KEYS) - done


def test_rows_that_share_their_sources_are_played_together():
    study = attrs.evolve(TINY, shared_sources=True)
    assert plan(study, set(), batch=3)[0] == (("0", 0), ("4", 0), ("8", 0))
    many = attrs.evolve(load_study("variants_1000"), trials=20)
    sources = [{number for _, number in keys} for keys in plan(many, set(), batch=50)]
    assert sources == [set(range(10)), set(range(10, 20))]  # 20 rows each


def test_rows_far_apart_take_turns():
    wide = attrs.evolve(
        TINY, trials=2, references=("0",), rows=tuple(Row(name) for name in "0123456789")
    )
    order = [keys[0][0] for keys in plan(wide, set(), batch=1)]
    assert order == 2 * list("0741852963")


def test_a_run_yields_and_writes_every_trial(tmp_path):
    trials = run_all(tmp_path, play)
    assert sorted(trial.key for trial in trials) == sorted(KEYS)
    assert sorted(read_trials(tmp_path), key=lambda t: t.key) == sorted(trials, key=lambda t: t.key)


def test_a_run_that_was_interrupted_goes_on_and_repeats_nothing(tmp_path):
    with pytest.raises(InterruptedError):
        run_all(tmp_path / "cut", Power(2).play)
    before = [trial.key for trial in read_trials(tmp_path / "cut")]
    after = [trial.key for trial in run_all(tmp_path / "cut", play, resume=True)]
    assert len(before) == 6  # a batch of 3 of each of two rows
    assert sorted(before + after) == sorted(KEYS)
    run_all(tmp_path / "whole", play)
    assert set(read_trials(tmp_path / "cut")) == set(read_trials(tmp_path / "whole"))


def test_a_run_keeps_no_trial_that_is_on_the_disk(tmp_path):
    kept: list[weakref.ref[StudyTrial]] = []

    def remembered(study, keys):
        trials = play(study, keys)
        kept.extend(weakref.ref(trial) for trial in trials)
        return trials

    many = attrs.evolve(TINY, trials=100)
    with (
        ThreadPoolExecutor(1) as executor,
        open_results(tmp_path, many, command="x", code_version="v1") as results,
    ):
        for count, _ in enumerate(run(many, results, executor, remembered, batch=1)):
            if count == 250:
                wait([executor.submit(int)])  # everything has been played
                gc.collect()
                unread = sum(trial() is not None for trial in kept)
                assert unread <= 300 - count
    assert len(kept) == 300


def test_more_trials_are_added_to_a_study_that_is_done(tmp_path):
    run_all(tmp_path, play)
    more = attrs.evolve(TINY, trials=TINY.trials + 1)
    added = run_all(tmp_path, play, resume=True, study=more)
    assert sorted(trial.key for trial in added) == [(row.name, TINY.trials) for row in TINY.rows]


def test_progress_knows_the_time_left_by_the_work_that_was_done():
    now = 100.0
    progress = StudyProgress(TINY, done=KEYS[:4], clock=lambda: now)
    assert (progress.done, str(progress)) == (4, "time left unknown")
    progress.add(play(TINY, KEYS[4:8]))  # half of what is left, bar four episodes of 12,000
    now = 160.0
    assert progress.seconds_left == pytest.approx(60, rel=0.01)
    assert (progress.done, str(progress)) == (8, "time left 1 min")
