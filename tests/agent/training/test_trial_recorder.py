"""A training recorded: the bag is what a match of nodes would have been, whole or in parts."""

from pathlib import Path

import numpy as np
import pytest

from keepaway_agent.checks.decisions import check_decisions
from keepaway_agent.learning.config import LearnerConfig
from keepaway_agent.training.folder import TrainingFolder
from keepaway_agent.training.training import Training
from keepaway_agent.training.trial import TrialResult
from keepaway_agent.training.workers import play_trials
from keepaway_sim.bags.gaps import count_gaps
from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.verify import check_world
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Outcome

EPISODES = 30
LEARNER = LearnerConfig(lambda_=0.5, epsilon=0.1)
TRAINING = Training(episodes=EPISODES, seed=5, taker_policy="learn", learner=LEARNER)


def record(
    path: Path,
    training: Training = TRAINING,
    wanted: set[int] | None = None,
    trials: int = 1,
    processes: int = 1,
) -> dict[int, TrialResult]:
    """The results of a training whose first trial is recorded to `path`."""
    recorder = training.recorder(path, wanted)
    results = list(play_trials(training, range(trials), processes, recorder=recorder))
    return {result.trial.label: result for result in results}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[MatchBag, np.ndarray]:
    """A bag of all episodes, and how many cycles each had."""
    path = tmp_path_factory.mktemp("recorded") / "bag"
    durations = record(path)[0].durations
    return MatchBag(path), durations


def test_a_bag_has_every_episode_of_the_trial(whole):
    bag, durations = whole
    assert [episode.cycles for episode in bag.episodes()] == durations.tolist()
    assert bag.reader.complete
    assert count_gaps(bag).report().startswith("nothing is missing")


def test_world_and_players_do_again_what_was_recorded(whole):
    """With the values that the learners saw, of keepers and of takers."""
    bag, durations = whole
    world, players = check_world(bag), check_decisions(bag)
    assert (world.episodes, world.difference) == (EPISODES, None)
    assert (players.episodes, players.difference) == (EPISODES, None)
    assert world.compared == durations.sum() + EPISODES
    values = bag.track(next(bag.episodes())).values
    assert np.isfinite(values[:, :3]).any()
    assert np.isfinite(values[:, 3:]).any()


def test_chosen_episodes_are_those_of_the_whole_recording(whole, tmp_path):
    record(tmp_path / "bag", wanted={2, 17})
    some = MatchBag(tmp_path / "bag")
    of_whole = {episode.number: episode for episode in whole[0].episodes()}
    assert [episode.number for episode in some.episodes()] == [2, 17]
    assert not any(count_gaps(some).missing().values())
    for episode in some.episodes():
        assert episode == of_whole[episode.number]
        for ours, theirs in zip(some.track(episode), whole[0].track(episode), strict=True):
            np.testing.assert_array_equal(ours, theirs)


def test_recording_changes_nothing_in_any_number_of_processes(whole, tmp_path):
    alone = {r.trial.label: r.durations.tolist() for r in play_trials(TRAINING, range(3))}
    recorded = record(tmp_path / "bag", trials=3, processes=2)
    assert {k: r.durations.tolist() for k, r in recorded.items()} == alone
    assert MatchBag(tmp_path / "bag").reader.message_count == whole[0].reader.message_count


def test_keepers_that_began_with_weights_are_checked_with_them(tmp_path):
    folder = TrainingFolder(tmp_path / "weights", TRAINING)
    for result in play_trials(TRAINING, [0]):
        folder.save(result)
    going_on = Training(episodes=5, policy="greedy", load_weights=str(folder.path), learner=LEARNER)
    record(tmp_path / "bag", going_on)
    checked = check_decisions(MatchBag(tmp_path / "bag"))
    assert (checked.episodes, checked.difference) == (5, None)


def test_an_episode_that_the_end_of_the_trial_cuts_off_is_in_it(tmp_path):
    record(tmp_path / "bag", Training(episodes=100, hours=0.01, seed=5))
    unfinished = MatchBag(tmp_path / "bag").unfinished()
    assert unfinished is not None
    assert unfinished.outcome == Outcome.IN_PLAY


def test_a_bag_is_not_written_over(tmp_path):
    (tmp_path / "bag").mkdir()
    with pytest.raises(KeepawayError, match="exists already"):
        record(tmp_path / "bag")
