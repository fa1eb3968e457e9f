"""SMDP Sarsa(lambda): by hand, and what batches must not change."""

import itertools
import pickle
from copy import deepcopy

import numpy as np
import pytest

from keepaway_agent.actions import Role
from keepaway_agent.compiled import compiled
from keepaway_agent.errors import AgentError
from keepaway_agent.learning import sarsa
from keepaway_agent.learning.cmac import Tiling, make_tiling
from keepaway_agent.learning.config import SarsaConfig
from keepaway_agent.learning.sarsa import NO_ACTION, make_learners, tiles_of

X = Tiling(("x",), (2.0,), (0.0,), (10.0,))  # one variable; a fine cell is 1/16 wide
GREEDY_FIRST = np.array([0.9, 0.5, 0.0])  # no exploring; the first of equal actions
GREEDY_LAST = np.array([0.9, 0.5, 0.99])


def learner(lambda_=0.0, alpha=0.5, **settings):
    config = SarsaConfig(alpha=alpha, lambda_=lambda_, epsilon=0.0, **settings)
    return make_learners(1, 2, X, config)


def values(learners, x):
    """Values of both actions at x, without disturbing the learner."""
    copy = deepcopy(learners)
    copy.state[0, 0] = x
    sarsa.look(copy, 0)
    return copy.values[0].tolist()


def start(learners, x, uniforms):
    learners.state[0, 0] = x
    return sarsa.start(learners, 0, uniforms)


def step(learners, r_t, x, uniforms, discount_t=1.0):
    learners.state[0, 0] = x
    return sarsa.step(learners, 0, r_t, discount_t, uniforms)


def test_two_episodes_with_lambda_0_by_hand():
    me = learner(lambda_=0.0)
    assert start(me, 1.0, GREEDY_LAST) == 1  # both are worth 0
    assert step(me, 4.0, 1.0, GREEDY_FIRST) == 0  # still 0: chosen before the update
    assert values(me, 1.0) == [0, 2]  # delta = 4 + 0 - 0, alpha = 1/2
    sarsa.end(me, 0, 2.0)
    assert values(me, 1.0) == [1, 2]  # delta = 2 - 0

    assert start(me, 1.0, GREEDY_FIRST) == 1
    # 1.5 is 8 fine cells on, and shares 24 of 32 tiles with 1.0
    assert values(me, 1.5) == [0.75, 1.5]
    assert step(me, 1.0, 1.5, GREEDY_FIRST) == 1  # delta = 1 + 1.5 - 2 = 0.5
    assert values(me, 1.0) == [1, 2.25]
    assert values(me, 1.5) == [0.75, 1.6875]
    sarsa.end(me, 0, 1.0)  # delta = 1 - 1.6875, the value right after the update
    assert values(me, 1.5) == [0.75, 1.34375]
    assert values(me, 1.0) == [1, 2.25 - 0.75 * 0.34375]


def test_an_episode_with_lambda_one_half_by_hand():
    me = learner(lambda_=0.5)
    assert start(me, 1.0, GREEDY_LAST) == 1  # flat tiles 16..47 get the trace 1
    assert step(me, 4.0, 1.5, GREEDY_LAST) == 0 + 1  # Q(1.5) is 0 for both before the update
    assert values(me, 1.0) == [0, 2]
    traces = me.traces[0].reshape(2, -1)
    assert (traces[1, 16:24] == 0.5).all()  # decayed
    assert (traces[1, 24:56] == 1.0).all()  # replaced, not added up
    assert traces.sum() == 8 * 0.5 + 32
    # The update made Q(1.5) 24/16, so delta = 1/2: 1/128 to each tile of trace 1, half to others.
    sarsa.end(me, 0, 2.0)
    assert values(me, 1.5) == [0, 24 / 16 + 32 / 128]
    assert values(me, 1.0) == [0, 32 / 16 + 8 / 256 + 24 / 128]
    assert not me.traces.any()


def test_the_traces_of_other_actions_are_cleared_where_the_new_state_is():
    me = learner(lambda_=0.5)
    start(me, 1.0, GREEDY_LAST)
    assert step(me, 0.0, 1.5, GREEDY_FIRST) == 0
    traces = me.traces[0].reshape(2, -1)
    assert (traces[0, 24:56] == 1.0).all()
    assert (traces[1, 16:24] == 0.5).all()
    assert not traces[1, 24:].any()


def test_traces_below_the_minimum_count_as_none():
    me = learner(lambda_=0.5, min_trace=0.3)
    start(me, 1.0, GREEDY_LAST)
    step(me, 0.0, 5.0, GREEDY_LAST)
    assert me.num_traced[0] == 64
    step(me, 0.0, 9.0, GREEDY_LAST)  # those of 1.0 are down to 0.25
    assert me.num_traced[0] == 64
    assert me.traces[0].sum() == 32 * 0.5 + 32


def test_a_reward_before_any_decision_teaches_nothing():
    me = learner()
    sarsa.end(me, 0, 100.0)
    assert not me.weights.any()


def test_the_final_reward_counts_once():
    me = learner()
    start(me, 1.0, GREEDY_LAST)
    sarsa.end(me, 0, 8.0)
    sarsa.end(me, 0, 8.0)
    assert values(me, 1.0) == [0, 4]


def test_forgetting_an_episode_learns_nothing_from_its_end():
    me = learner(lambda_=0.5)
    start(me, 1.0, GREEDY_LAST)
    sarsa.forget(me, 0)
    sarsa.end(me, 0, 8.0)
    assert not me.weights.any()
    assert not me.traces.any()


def test_a_decision_is_paid_for_the_cycles_since_the_last_one():
    me = learner()
    for x, cycle in ((1.0, 10), (5.0, 17)):
        me.state[0, 0] = x
        sarsa.decide(me, 0, 1.0, cycle, GREEDY_LAST)
    assert values(me, 1.0) == [0, 3.5]  # 7 cycles, alpha = 1/2
    sarsa.finish(me, 0, 1.0, 20)
    assert values(me, 5.0) == [0, 1.5]  # 3 cycles


def test_an_action_that_goes_on_is_paid_from_then_on():
    # P KeepawayPlayer.cc: going on with a pass counts as the last action again
    me = learner()
    sarsa.resume(me, 0, 9)
    assert me.cycle[0] == 0  # nothing that could go on
    me.state[0, 0] = 1.0
    sarsa.decide(me, 0, 1.0, 10, GREEDY_LAST)
    for cycle in (11, 12):
        sarsa.resume(me, 0, cycle)
    me.state[0, 0] = 5.0
    sarsa.decide(me, 0, 1.0, 17, GREEDY_LAST)
    assert values(me, 1.0) == [0, 2.5]  # 5 cycles, alpha = 1/2


def test_time_discounts_by_the_cycle():
    me = learner(gamma=0.5)
    for x, cycle in ((1.0, 0), (5.0, 3)):
        me.state[0, 0] = x
        sarsa.decide(me, 0, 1.0, cycle, GREEDY_LAST)
    assert values(me, 1.0) == [0, 0.5 * (1 + 0.5 + 0.25)]
    assert sarsa.pay(1.0, 0.5, 3) == (1.75, 0.125)
    assert sarsa.pay(-1.0, 1.0, 7) == (-7.0, 1.0)


def test_ties_break_evenly_and_only_between_the_best():
    best = np.array([1.0, 3.0, 2.0, 3.0, 3.0])
    chosen = [sarsa.greedy_action(best, u) for u in np.linspace(0, 1, 3000, endpoint=False)]
    assert np.bincount(chosen, minlength=5).tolist() == [0, 1000, 0, 1000, 1000]


def test_a_tie_of_earlier_actions_is_forgotten_when_a_better_one_comes():
    assert sarsa.greedy_action(np.array([1.0, 1.0, 2.0]), 0.99) == 2
    assert sarsa.greedy_action(np.array([1.0, 1.0, 2.0]), 0.0) == 2


def test_exploring_chooses_any_action_evenly():
    best = np.array([0.0, 5.0, 0.0, 0.0])
    uniforms = ((0.05, u, 0.3) for u in np.linspace(0, 1, 4000, endpoint=False))
    chosen = [sarsa.epsilon_greedy(best, 0.1, np.array(triple)) for triple in uniforms]
    assert np.bincount(chosen).tolist() == [1000] * 4
    assert sarsa.epsilon_greedy(best, 0.1, np.array([0.1, 0.9, 0.3])) == 1
    assert sarsa.random_action(3, np.nextafter(1.0, 0.0)) == 2


def play(seed, tiling, num_steps=300):
    """Random episodes as (state, uniforms, reward of the step before, whether it ends after)."""
    rng = np.random.default_rng(seed)
    state = rng.uniform(tiling.lows, tiling.highs)
    for _ in range(num_steps):
        state = np.clip(state + rng.normal(0, 0.3, len(state)), -0.5, np.array(tiling.highs) + 0.5)
        yield state, rng.random(3), float(rng.integers(1, 20)), rng.random() < 0.05


@compiled
def play_compiled(learners, i, states, uniforms, rewards, ends):
    """The same calls as from Python, in a compiled loop as the trainer's."""
    for t in range(len(states)):
        for feature in range(states.shape[1]):
            learners.state[i, feature] = states[t, feature]
        if learners.action[i] == NO_ACTION:
            sarsa.start(learners, i, uniforms[t])
        else:
            sarsa.step(learners, i, rewards[t], 1.0, uniforms[t])
        if ends[t]:
            sarsa.end(learners, i, rewards[t])


@pytest.mark.parametrize("lambda_", [0.0, 0.8])
def test_a_learner_is_bit_equal_alone_in_a_batch_and_called_from_python(lambda_):
    tiling = make_tiling(Role.KEEPER, 3, 2)
    config = SarsaConfig(lambda_=lambda_, epsilon=0.1)
    episodes = [
        tuple(np.array(column) for column in zip(*play(seed, tiling), strict=True))
        for seed in range(4)
    ]
    batch = make_learners(4, 3, tiling, config)
    for i, columns in enumerate(episodes):
        play_compiled(batch, i, *columns)
    for i, (states, uniforms, rewards, ends) in enumerate(episodes):
        alone = make_learners(1, 3, tiling, config)
        for state, uniform, reward, is_end in zip(states, uniforms, rewards, ends, strict=True):
            alone.state[0] = state
            if alone.action[0] == NO_ACTION:
                sarsa.start(alone, 0, uniform)
            else:
                sarsa.step(alone, 0, reward, 1.0, uniform)
            if is_end:
                sarsa.end(alone, 0, reward)
        assert alone.weights.any()
        np.testing.assert_array_equal(tiles_of(alone, 0), tiles_of(batch, i))


def test_learners_that_share_a_table_learn_from_each_other_and_keep_their_own_traces():
    team = make_learners(4, 2, X, SarsaConfig(alpha=0.5, lambda_=0.5), learners_per_table=2)
    assert team.table.tolist() == [0, 0, 1, 1]
    team.state[0, 0] = 1.0
    sarsa.start(team, 0, GREEDY_LAST)
    assert not team.traces[1].any()
    sarsa.end(team, 0, 4.0)
    for i, expected in enumerate((2, 2, 0, 0)):
        team.state[i, 0] = 1.0
        sarsa.look(team, i)
        assert team.values[i, 1] == expected


@pytest.mark.parametrize(
    ("setting", "value"),
    [*itertools.product(["alpha", "gamma", "lambda_", "epsilon"], [-0.1, 1.1, float("nan"), "1"])],
)
def test_settings_out_of_range_are_refused_by_name(setting, value):
    with pytest.raises(AgentError, match=f"{setting}={value!r}"):
        SarsaConfig(**{setting: value})


def test_learners_that_do_not_share_out_are_refused():
    with pytest.raises(AgentError, match="5 learners"):
        make_learners(5, 2, X, learners_per_table=2)


def test_a_learner_goes_on_from_a_snapshot_as_it_went_on_then():
    team = make_learners(2, 2, X, SarsaConfig(alpha=0.5, lambda_=0.5, epsilon=0.0))

    def go_on(i: int) -> list[float]:
        for x, r_t in ((1.5, 2.0), (3.0, -1.0), (1.0, 0.5)):
            team.state[i, 0] = x
            sarsa.step(team, i, r_t, 1.0, GREEDY_FIRST)
        sarsa.end(team, i, 1.0)
        return tiles_of(team, i).ravel().tolist()

    team.state[0, 0] = 1.0
    sarsa.start(team, 0, GREEDY_LAST)
    kept = pickle.loads(pickle.dumps(sarsa.snapshot(team, 0)))
    expected = go_on(0)
    for i in (0, 1):
        sarsa.restore(team, i, kept)
        assert go_on(i) == expected


def test_a_snapshot_of_another_shape_is_refused():
    kept = sarsa.snapshot(learner(), 0)
    with pytest.raises(AgentError, match="a snapshot of weights"):
        sarsa.restore(make_learners(1, 3, X), 0, kept)
