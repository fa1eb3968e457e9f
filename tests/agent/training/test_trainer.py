"""The trainer: a trial depends on itself alone, and plays as the players of the nodes do."""

import itertools
import math
from typing import Any

import numpy as np
import pytest

from keepaway_agent.actions import Outcome, Role
from keepaway_agent.errors import AgentError
from keepaway_agent.learning.config import LearnerConfig
from keepaway_agent.learning.sarsa import tiles_of
from keepaway_agent.playing.agent import Agent, AgentConfig, MatchFacts, Perceived
from keepaway_agent.playing.policies import View
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.trial import StopRule, TrainerConfig, Trial, TrialResult, trial_seed
from keepaway_sim.task import Task
from keepaway_sim.world.config import Config
from keepaway_sim.world.world import World

LEARNER = LearnerConfig(lambda_=0.3, epsilon=0.05)
CONFIG = TrainerConfig(learner=LEARNER)


def make_trial(number: int = 0, episodes: int = 6, **changes: Any) -> Trial:
    return Trial(trial_seed(7, number), StopRule(max_episodes=episodes), label=number, **changes)


def play(trials: list[Trial], num_fields: int, config: TrainerConfig = CONFIG) -> list[TrialResult]:
    """Results in the order of the trials."""
    finished = {id(result.trial): result for result in Trainer(config, num_fields).run(trials)}
    return [finished[id(trial)] for trial in trials]


def assert_same(one: TrialResult, other: TrialResult) -> None:
    np.testing.assert_array_equal(one.durations, other.durations)
    np.testing.assert_array_equal(one.outcomes, other.outcomes)
    for mine, its in (
        (one.keeper_weights, other.keeper_weights),
        (one.taker_weights, other.taker_weights),
    ):
        assert (mine is None) == (its is None)
        if mine is not None and its is not None:
            np.testing.assert_array_equal(mine, its)


@pytest.mark.parametrize("task", ["3v2", "4v3"])
def test_a_trial_is_bit_identical_alone_and_among_others(task):
    config = TrainerConfig(task=Task.parse(task), learner=LEARNER)
    trials = [
        make_trial(number, episodes=2 + number % 5, taker_policy=("hand", "learn")[number % 2])
        for number in range(9)
    ]
    many = play(trials, 4, config)
    assert all(np.any(result.keeper_weights) for result in many)
    for number in (0, 5, 8):
        (alone,) = play([trials[number]], 1, config)
        assert_same(alone, many[number])


def test_every_trial_has_its_own_luck():
    results = play([make_trial(number) for number in range(3)], 3)
    durations = [tuple(result.durations) for result in results]
    assert len(set(durations)) == 3


def play_one_by_one(seed, policy, num_episodes, learner=LEARNER):
    """The same match with each player asked by itself, as ROS nodes are."""
    task = Task()
    facts = MatchFacts(
        num_keepers=3, num_takers=2, field_length=25.0, field_width=25.0, cycle_time=0.1, seed=seed
    )
    agents = [
        Agent(facts, p, AgentConfig(policy if p < task.num_keepers else "hand", learner))
        for p in range(task.num_players)
    ]
    world = World(task, Config())
    world.start(0, np.random.SeedSequence(seed, spawn_key=(0, 0)))
    action = np.zeros((1, task.num_players), dtype=np.int64)
    target = np.zeros_like(action)
    durations: list[int] = []
    seen = world.belief
    while len(durations) < num_episodes:
        for p, agent in enumerate(agents):
            view = View(
                seen.position[0, p].copy(),
                seen.age[0, p].copy(),
                seen.cycles_to_ball[0, p].copy(),
                bool(seen.ball_kickable[0, p]),
                int(seen.cycle[0]),
            )
            episode, due = int(seen.episode[0]), bool(seen.decision_due[0, p])
            answer = agent.perceive(Perceived(episode, int(seen.outcome[0]), due, view))
            if answer is not None:
                action[0, p], target[0, p] = answer.action, answer.target
        if seen.outcome[0] != Outcome.IN_PLAY:
            durations.append(int(seen.cycle[0]))
        world.step(action, target)
    weights = [tiles_of(agent.learners, 0) for agent in agents[: task.num_keepers]]
    return durations, np.stack(weights)


@pytest.mark.parametrize("policy", ["random", "hold", "hand", "learn"])
def test_players_asked_one_by_one_play_the_same_match(policy):
    (result,) = play([make_trial(0, episodes=8, keeper_policy=policy)], 1)
    durations, weights = play_one_by_one(7, policy, 8)
    assert result.durations.tolist() == durations
    if policy == "learn":
        np.testing.assert_array_equal(result.keeper_weights, weights)
    else:
        assert result.keeper_weights is None


def test_a_trial_stops_after_its_episodes():
    results = play([make_trial(number, episodes=number + 1) for number in range(3)], 2)
    assert [len(result.durations) for result in results] == [1, 2, 3]


def test_a_trial_stops_when_its_cycles_are_used_up_and_drops_the_episode_that_runs():
    whole = play([make_trial(0, 4)], 1)[0].durations
    limit = int(whole[:2].sum()) + 5
    trial = Trial(trial_seed(7, 0), StopRule(max_cycles=limit))
    (result,) = play([trial], 1)
    assert result.durations.tolist() == whole[:2].tolist()
    exact = Trial(trial_seed(7, 0), StopRule(max_cycles=int(whole[:2].sum())))
    assert play([exact], 1)[0].durations.tolist() == whole[:2].tolist()


def test_a_trial_stops_when_the_mean_over_the_window_passes_the_threshold():
    durations = play([make_trial(0, 30)], 1)[0].durations * 0.1
    means = np.convolve(durations, np.full(5, 0.2), "valid")
    threshold = float(means.max()) - 1e-6
    first = int(means.argmax()) + 5  # episodes played when that window is full
    stop = StopRule(max_episodes=30, threshold=threshold, window=5)
    (result,) = play([Trial(trial_seed(7, 0), stop)], 1)
    assert result.reached
    assert len(result.durations) == first


def test_the_threshold_waits_for_the_least_number_of_cycles_and_is_remembered():
    durations = play([make_trial(0, 30)], 1)[0].durations
    low = float(durations[:5].min()) * 0.01
    later = int(durations[:8].sum())
    stop = StopRule(max_episodes=30, threshold=low, window=5, min_cycles=later)
    (result,) = play([Trial(trial_seed(7, 0), stop)], 1)
    assert result.reached
    assert len(result.durations) == 8


def test_a_threshold_out_of_reach_is_not_reached():
    stop = StopRule(max_episodes=5, threshold=1e6, window=2)
    (result,) = play([Trial(trial_seed(7, 0), stop)], 1)
    assert not result.reached


def test_snapshots_are_the_weights_a_shorter_trial_ends_with():
    (long,) = play([make_trial(0, 6, snapshots=(2, 5, 9))], 1)
    assert sorted(long.snapshots) == [2, 5]
    for episodes, weights in long.snapshots.items():
        (short,) = play([make_trial(0, episodes)], 1)
        np.testing.assert_array_equal(weights, short.keeper_weights)


def test_a_slot_keeps_nothing_of_the_trial_before():
    trials = [make_trial(number, 4, taker_policy="learn") for number in range(3)]
    for one, other in zip(play(trials, 1), play(trials, 3), strict=True):
        assert_same(one, other)


def test_a_trial_starts_from_the_weights_it_is_given():
    rng = np.random.default_rng(0)
    tiling = CONFIG.tiling(Role.KEEPER)
    each = rng.normal(size=(3, *tiling.weights_shape(3)))
    (kept,) = play([make_trial(0, keeper_policy="greedy", keeper_weights=each)], 1)
    np.testing.assert_array_equal(kept.keeper_weights, each)
    (same,) = play([make_trial(0, keeper_policy="greedy", keeper_weights=each[1])], 1)
    np.testing.assert_array_equal(same.keeper_weights, np.stack([each[1]] * 3))
    with pytest.raises(AgentError, match=r"weights of shape \(3, 13\)"):
        play([make_trial(0, keeper_weights=each[:, 0, :, 0, 0])], 1)


def test_keepers_that_share_end_with_the_same_weights():
    shared = TrainerConfig(learner=LEARNER, shared=True)
    (result,) = play([make_trial(0)], 1, shared)
    assert result.keeper_weights is not None
    assert result.keeper_weights[0].any()
    for weights in result.keeper_weights[1:]:
        np.testing.assert_array_equal(weights, result.keeper_weights[0])
    (apart,) = play([make_trial(0)], 1)
    assert apart.keeper_weights is not None
    assert (apart.keeper_weights[0] != apart.keeper_weights[1]).any()


def test_trials_are_asked_for_one_at_a_time_and_results_come_as_they_finish():
    asked = []

    def endless():
        for number in itertools.count():
            asked.append(number)
            yield make_trial(number, episodes=1)

    run = Trainer(CONFIG, 2).run(endless())
    results = list(itertools.islice(run, 3))
    run.close()
    assert len(results) == 3
    assert len(asked) == 5


def test_a_trainer_runs_again_after_a_run_was_broken_off():
    trainer = Trainer(CONFIG, 2)
    broken = trainer.run([make_trial(number) for number in range(4)])
    next(broken)
    broken.close()
    (again,) = trainer.run([make_trial(3)])
    (fresh,) = play([make_trial(3)], 1)
    assert_same(again, fresh)


def test_whoever_watches_is_told_of_the_progress():
    told = []
    trainer = Trainer(CONFIG, 2)
    trials = [make_trial(number, episodes=8) for number in range(2)]
    results = list(trainer.run(trials, lambda progress: told.append(progress.episodes)))
    assert told == sorted(told)
    assert told
    assert trainer.progress.trials == 2
    assert trainer.progress.episodes == 16
    assert trainer.progress.cycles == sum(int(result.durations.sum()) for result in results)


def test_no_trials_give_no_results():
    assert play([], 2) == []


@pytest.mark.parametrize(
    ("rule", "refusal"),
    [
        ({"max_episodes": -1}, "max_episodes=-1: give a whole number from 0"),
        ({"max_episodes": 1.5}, "max_episodes=1.5: give a whole number from 0"),
        ({"max_cycles": -1}, "max_cycles=-1: give a whole number from 0"),
        ({"max_cycles": 10**13}, "max_cycles=10000000000000: give a whole number from 0"),
        ({"threshold": -1}, "threshold=-1.0: give a number from 0"),
        ({"threshold": math.nan}, "threshold=nan: give a number from 0"),
        ({"window": 0}, "window=0: give a whole number from 1"),
        ({"min_cycles": -1}, "min_cycles=-1: give a whole number from 0"),
        ({"min_cycles": "1"}, "min_cycles='1': give a whole number from 0"),
    ],
)
def test_a_stop_rule_outside_its_range_is_refused_by_name(rule, refusal):
    with pytest.raises(AgentError, match=refusal):
        StopRule(**{"max_episodes": 1, **rule})


def test_a_trainer_between_whose_choices_are_no_cycles_is_refused():
    with pytest.raises(AgentError, match="decision_interval=0: give a whole number from 1"):
        TrainerConfig(decision_interval=0)


def test_rules_that_never_stop_a_trial_are_refused():
    with pytest.raises(AgentError, match="max_episodes or max_cycles"):
        StopRule(threshold=9.0)
    with pytest.raises(AgentError, match="keeper policy 'best'"):
        play([make_trial(0, keeper_policy="best")], 1)
    with pytest.raises(AgentError, match="ordering='x'"):
        Trainer(TrainerConfig(learner=LearnerConfig(ordering="x")), 1)


def test_takers_that_learn_end_episodes_of_fixed_keepers_sooner_than_hand_coded_ones():
    fixed = play([make_trial(k, 20, keeper_policy="hand") for k in range(8)], 8)
    trials = [make_trial(k, 200, keeper_policy="hand", taker_policy="learn") for k in range(8)]
    learned = play(trials, 8, TrainerConfig())
    by_hand = np.mean([result.durations.mean() for result in fixed])
    after_learning = np.mean([result.durations[-100:].mean() for result in learned])
    assert after_learning < 0.5 * by_hand


def test_keepers_that_learn_hold_the_ball_longer():
    results = play([make_trial(k, 1200) for k in range(8)], 8, TrainerConfig())
    early = np.mean([result.durations[:100].mean() for result in results])
    late = np.mean([result.durations[-100:].mean() for result in results])
    assert late > 1.15 * early
