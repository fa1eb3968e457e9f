"""Trials as they are played: their stages, what goes from one to the next, and who shares what."""

import attrs
import numpy as np
import pytest

from keepaway_agent.actions import Role
from keepaway_agent.learning.cmac import make_tiling
from keepaway_agent.training.trainer import Trainer
from keepaway_transfer.mapping import rho_mapping
from keepaway_transfer.rho import rho
from keepaway_transfer.studies import batch
from keepaway_transfer.studies.batch import CYCLES_PER_HOUR, play_batch
from keepaway_transfer.studies.study import Row, Stage, load_study

TINY = load_study("tiny")
pytestmark = pytest.mark.timeout(1200)  # the first trial on a machine waits for the compiler
KEYS = [("0", 0), ("4", 1), ("8", 0), ("4", 0)]


@pytest.fixture(scope="module")
def trials():
    return dict(zip(KEYS, play_batch(TINY, KEYS), strict=True))


@pytest.fixture
def runs(monkeypatch):
    """Every run that the trainer is given, with its result."""
    seen = []

    class Watched(Trainer):
        def run(self, trials, watch=None, watch_cycle=None):
            for result in super().run(trials, watch, watch_cycle):
                seen.append((self.config.task.name, result))
                yield result

    monkeypatch.setattr(batch, "Trainer", Watched)
    return seen


def test_trials_are_those_that_were_asked_for(trials):
    assert [trial.key for trial in trials.values()] == KEYS


@pytest.mark.parametrize("key", KEYS)
def test_a_trial_is_the_same_alone_and_among_others(trials, key):
    assert play_batch(TINY, [key]) == [trials[key]]


def test_trials_differ_between_rows_and_numbers(trials):
    assert len({trial.cycles for trial in trials.values()}) == len(KEYS)


def test_a_trial_says_what_it_trained_on_before(trials):
    assert trials["0", 0].sources == ()
    assert trials["0", 0].start_level is None
    assert trials["8", 0].start_level > 0
    (source,) = trials["8", 0].sources
    assert (source.task, source.episodes) == ("2v1", 8)
    assert source.cycles >= 8 * 10  # nobody loses the ball within a second
    assert 0 <= source.keeper < 2


def test_the_target_task_is_played_between_the_least_and_the_most_hours(trials):
    for trial in trials.values():
        hours = sum(trial.cycles) / CYCLES_PER_HOUR
        assert hours <= TINY.max_hours
        assert hours >= TINY.min_hours


def test_the_greedy_episodes_come_after(trials):
    assert {len(trial.greedy_cycles) for trial in trials.values()} == {TINY.greedy_episodes}


def test_a_studys_seed_decides_its_trials(trials):
    other = attrs.evolve(TINY, seed=TINY.seed + 1)
    assert play_batch(other, KEYS[:1])[0].cycles != trials["0", 0].cycles


def test_all_target_keepers_start_with_one_source_keepers_weights_through_rho(runs):
    (trial,) = play_batch(TINY, [("8", 0)])
    (_, source), (_, target), (_, greedy) = runs
    keeper = source.snapshots[8][trial.sources[0].keeper]
    tilings = make_tiling(Role.KEEPER, 2, 1), make_tiling(Role.KEEPER, 3, 2)
    expected = rho(keeper, *tilings, rho_mapping("2v1", "3v2"))
    np.testing.assert_array_equal(target.trial.keeper_weights, expected)
    np.testing.assert_array_equal(greedy.trial.keeper_weights, target.keeper_weights)


def test_a_chain_goes_through_every_task(runs):
    chain = Row("chain", (Stage("2v1", 3), Stage("3v1", 2)))
    study = attrs.evolve(TINY, rows=(*TINY.rows, chain))
    (trial,) = play_batch(study, [("chain", 0)])
    assert [(source.task, source.episodes) for source in trial.sources] == [("2v1", 3), ("3v1", 2)]
    assert [task for task, _ in runs] == ["2v1", "3v1", "3v2", "3v2"]


def test_rows_that_share_their_sources_take_them_from_one_run_as_it_goes(runs):
    study = attrs.evolve(TINY, shared_sources=True)
    keys = [(row.name, 0) for row in study.rows]
    _, four, eight = play_batch(study, keys)
    (source,) = [result for task, result in runs if task == "2v1"]
    assert four.sources[0].cycles == source.durations[:4].sum()
    assert eight.sources[0].cycles == source.durations[:8].sum()
    assert four.sources[0].keeper == eight.sources[0].keeper
    alone = play_batch(study, keys[1:2])
    assert alone == [four]


def test_keepers_that_share_a_value_function_end_with_equal_weights(runs):
    play_batch(attrs.evolve(TINY, shared_keepers=True), [("0", 0)])
    first, second, third = runs[0][1].keeper_weights
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(first, third)
    assert first.any()


def test_shuffled_trials_have_shuffles_of_their_own(runs):
    rows = (Row("0"), Row("shuffled", (Stage("2v1", 4),), "shuffled"))
    study = attrs.evolve(TINY, rows=rows, shared_sources=True)
    play_batch(study, [("shuffled", 0), ("shuffled", 1)])
    first, second = [result.trial for task, result in runs if task == "3v2"][:2]
    assert np.any(first.keeper_weights != second.keeper_weights)


def test_an_optimistic_row_starts_at_a_constant_of_its_level(runs):
    rows = (Row("0"), Row("high", variant="optimistic@5"))
    (trial,) = play_batch(attrs.evolve(TINY, rows=rows), [("high", 0)])
    assert trial.start_level == pytest.approx(5.0)
    (weight,) = np.unique(runs[0][1].trial.keeper_weights)
    assert weight * 13 * 32 / 10 == pytest.approx(5.0)  # all active tiles, in seconds


def test_a_row_plays_with_its_own_tile_widths(runs):
    rows = (Row("0"), Row("wide", (Stage("2v1", 4),), widths="framework"))
    play_batch(attrs.evolve(TINY, target="4v3", rows=rows), [("0", 0), ("wide", 0)])
    shapes = [result.keeper_weights.shape[1:] for task, result in runs if task == "4v3"]
    expected = [
        make_tiling(Role.KEEPER, 4, 3, profile=profile).weights_shape(4)
        for profile in ("default", "framework")
    ]
    assert shapes == expected * 2  # learning, then greedy


def test_rows_that_start_alike_give_equal_trials_in_any_study_whatever_they_are_called():
    rows = (Row("scratch"), Row("four", (Stage("2v1", 4),)))
    other = attrs.evolve(TINY, name="other", rows=rows, references=("scratch",))
    for mine, theirs in (("0", "scratch"), ("4", "four")):
        (first,), (second,) = play_batch(TINY, [(mine, 1)]), play_batch(other, [(theirs, 1)])
        assert (first.cycles, first.greedy_cycles) == (second.cycles, second.greedy_cycles)


def test_rows_of_one_start_take_their_source_from_one_run_and_go_on_with_seeds_of_their_own(runs):
    rows = (Row("0"), Row("a", (Stage("2v1", 4),)), Row("b", (Stage("2v1", 4),), "rescaled"))
    play_batch(attrs.evolve(TINY, rows=rows), [("a", 0), ("b", 0)])
    assert [task for task, _ in runs].count("2v1") == 1
    first, second = [result.trial.seed.spawn_key for task, result in runs if task == "3v2"][:2]
    assert first != second


def test_trials_of_one_number_have_one_seed_where_the_study_says_so(runs):
    play_batch(attrs.evolve(TINY, shared_seeds=True), [("0", 0), ("4", 0), ("0", 1)])
    seeds = {
        result.trial.label.row.name + str(result.trial.label.number): result.trial.seed.spawn_key
        for task, result in runs
        if task == "3v2" and result.trial.keeper_policy == "learn"
    }
    assert seeds["00"] == seeds["40"] != seeds["01"]
