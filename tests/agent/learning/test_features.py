"""State variables: hand-worked scene, the paper's words, and what must not change them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keepaway_agent.actions import Role
from keepaway_agent.learning.features import (
    BY_BALL,
    BY_K1,
    feature_names,
    keeper_features,
    keeper_state,
    nearest_to_ball,
    rank_players,
    taker_features,
    taker_state,
)

TASKS = [(2, 1), (3, 2), (4, 3), (5, 4), (6, 3), (3, 5)]


def keeper_view(position, num_keepers, k1=0, ordering=BY_BALL):
    order = np.zeros(len(position) - 1, dtype=np.int64)
    rank_players(position, num_keepers, k1, -1, ordering, order)
    state = np.full(len(keeper_features(num_keepers, len(order) - num_keepers)), np.nan)
    keeper_state(position, order, num_keepers, state)
    return order, state


def taker_view(position, num_keepers, own):
    order = np.zeros(len(position) - 1, dtype=np.int64)
    k1 = nearest_to_ball(position, 0, num_keepers)
    rank_players(position, num_keepers, k1, own, BY_BALL, order)
    state = np.full(len(taker_features(num_keepers, len(order) - num_keepers)), np.nan)
    taker_state(position, order, num_keepers, state)
    return order, state


def test_a_keepers_thirteen_variables_worked_out_by_hand(scene):
    order, state = keeper_view(scene.position, 3)
    expected = {
        "dist_k1_c": 3,
        "dist_k1_k2": 5,
        "dist_k1_k3": 13,
        "dist_k1_t1": 4,
        "dist_k1_t2": 5,
        "dist_k2_c": 4,
        "dist_k3_c": math.sqrt(148),
        "dist_t1_c": 1,
        "dist_t2_c": math.sqrt(52),
        "min_dist_k2_t": math.sqrt(17),
        "min_dist_k3_t": math.sqrt(128),
        "min_ang_k2_t": math.acos(3 / 5),
        "min_ang_k3_t": math.acos(33 / 65),
    }
    assert order.tolist() == [0, 1, 2, 3, 4]
    assert dict(zip(feature_names(Role.KEEPER, 3, 2), state, strict=True)) == pytest.approx(
        expected, abs=1e-12
    )
    assert list(expected) == list(feature_names(Role.KEEPER, 3, 2))


def test_a_takers_variables_worked_out_by_hand(scene):
    order, state = taker_view(scene.position, 3, own=4)
    expected = {
        "dist_t1_b": math.hypot(4.5, 3),
        "dist_t1_k2": 10,
        "dist_t1_k3": math.sqrt(128),
        "dist_k1_k2": 5,
        "dist_k1_k3": 13,
        "ang_k2_t1": math.pi,
        "ang_k3_t1": math.acos(33 / 65),
        "dist_t2_b": math.hypot(0.5, 4),
        "min_dist_k2_t": math.sqrt(17),
        "min_dist_k3_t": math.sqrt(145),
        "min_ang_k2_t": math.acos(3 / 5),
        "min_ang_k3_t": math.acos(5 / 13),
    }
    assert order.tolist() == [0, 1, 2, 4, 3]
    assert dict(zip(feature_names(Role.TAKER, 3, 2), state, strict=True)) == pytest.approx(
        expected, abs=1e-7
    )


@pytest.mark.parametrize(("num_keepers", "num_takers"), TASKS)
def test_there_are_4n_2m_3_variables(num_keepers, num_takers):
    assert len(keeper_features(num_keepers, num_takers)) == 4 * num_keepers + 2 * num_takers - 3


def test_the_papers_counts():
    counts = [len(feature_names(Role.KEEPER, n, n - 1)) for n in (3, 4, 5)]
    assert counts == [13, 19, 25]


@pytest.mark.parametrize(("num_keepers", "num_takers"), TASKS)
def test_every_variable_of_every_task_is_written_and_in_range(num_keepers, num_takers):
    rng = np.random.default_rng(5)
    position = rng.uniform(-12, 12, (num_keepers + num_takers + 1, 2))
    states = [keeper_view(position, num_keepers)[1]]
    states += [taker_view(position, num_keepers, num_keepers + j)[1] for j in range(num_takers)]
    for state in states:
        assert np.isfinite(state).all()
        assert (state >= 0).all()


def test_players_rank_by_distance_to_the_ball_or_to_k1():
    # K0 ---- ball ---- K1     K2 is nearer to K0, K1 is nearer to the ball.
    position = np.array([(0, 0), (2.5, 0), (-2, 0), (4, 0), (-3, 0), (1.0, 0)])
    by_ball, _ = keeper_view(position, 3, ordering=BY_BALL)
    by_k1, _ = keeper_view(position, 3, ordering=BY_K1)
    assert by_ball.tolist() == [0, 1, 2, 3, 4]
    assert by_k1.tolist() == [0, 2, 1, 4, 3]


def test_equally_distant_players_rank_in_match_order():
    position = np.array([(1, 0), (0, 3), (0, -3), (3, 0), (0, 3), (0, 0)], dtype=float)
    for k1 in range(3):
        order, _ = keeper_view(position, 3, k1)
        mates = [k for k in range(3) if k != k1]
        near = sorted(mates, key=lambda k: (np.hypot(*position[k]), k))
        assert order.tolist() == [k1, *near, 3, 4]


def test_a_player_on_the_very_spot_of_k1_has_no_angle_and_is_taken_as_blocking():
    position = np.array([(1, 1), (1, 1), (5, 5), (2, 2), (1, 1)], dtype=float)
    _, state = keeper_view(position, 3)
    names = feature_names(Role.KEEPER, 3, 1)
    assert state[names.index("min_ang_k2_t")] == 0.0
    assert state[names.index("min_ang_k3_t")] == pytest.approx(0.0, abs=1e-7)


# whole millimetres: nearer than rounding errors, two players have no direction to each other
coordinates = st.integers(-13000, 13000).map(lambda millimetres: millimetres / 1000)


@given(
    players=st.lists(st.tuples(coordinates, coordinates), min_size=6, max_size=6),
    turn=st.floats(0, 2 * math.pi),
    mirror=st.booleans(),
)
def test_turning_and_mirroring_the_field_changes_no_variable(players, turn, mirror):
    position = np.array(players)
    rotation = np.array([(math.cos(turn), -math.sin(turn)), (math.sin(turn), math.cos(turn))])
    moved = position @ rotation.T
    if mirror:
        moved[:, 1] *= -1
    order, state = keeper_view(position, 3)
    moved_order, moved_state = keeper_view(moved, 3)
    if order.tolist() == moved_order.tolist():  # equal distances may rank either way
        # acos is steep near 0 and pi: 1e-16 in the cosine are 1e-8 in the angle
        np.testing.assert_allclose(state, moved_state, atol=1e-6)


@given(
    players=st.lists(st.tuples(coordinates, coordinates), min_size=8, max_size=8, unique=True),
    seed=st.integers(0, 1000),
)
def test_who_wears_which_number_changes_no_variable(players, seed):
    position = np.array(players)
    distances = np.hypot(*(position[:-1] - position[-1]).T)
    if len(set(distances)) < len(distances):
        return
    rng = np.random.default_rng(seed)
    relabel = np.concatenate([[0], 1 + rng.permutation(3), 4 + rng.permutation(3), [7]])
    _, state = keeper_view(position, 4)
    _, relabelled = keeper_view(position[relabel], 4)
    np.testing.assert_array_equal(state, relabelled)
