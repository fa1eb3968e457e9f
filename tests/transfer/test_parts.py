"""What transferred weights carry, taken apart and put together again."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keepaway_agent.actions import Role
from keepaway_agent.learning.cmac import action_values, make_tiling, state_cells
from keepaway_transfer.parts import PARTS, kept, level_of, scaled, split, weight_of

TILING = make_tiling(Role.KEEPER, 3, 2)
SEEDS = st.integers(0, 10_000)


def some_weights(seed, learned=0.6):
    """Weights of 3v2, of which a share was learned: the others are zero."""
    generator = np.random.default_rng(seed)
    weights = generator.normal(0.1, 0.3, size=TILING.weights_shape(3))
    weights[generator.random(weights.shape) > learned] = 0
    return weights


def values(weights, seed):
    """The value of every action in a random state [cycles]."""
    state = np.random.default_rng(seed).uniform(TILING.lows, TILING.highs)
    found = np.empty(len(weights))
    action_values(weights.reshape(*weights.shape[:2], -1), state_cells(state, TILING), found)
    return found


@given(SEEDS)
def test_the_three_parts_add_up_to_the_weights(seed):
    weights = some_weights(seed)
    parts = split(weights)
    np.testing.assert_allclose(parts.level + parts.shape + parts.preferences, weights, atol=1e-13)
    alone = sum(kept(weights, (part,)) for part in PARTS)
    np.testing.assert_allclose(alone, weights, atol=1e-13)


@given(SEEDS)
def test_the_values_add_up_in_every_state(seed):
    weights = some_weights(seed)
    parts = [values(kept(weights, (part,)), seed) for part in PARTS]
    np.testing.assert_allclose(np.sum(parts, axis=0), values(weights, seed), atol=1e-9)


@given(SEEDS)
def test_pairs_of_parts_are_what_the_third_leaves(seed):
    weights = some_weights(seed)
    for part in PARTS:
        others = kept(weights, set(PARTS) - {part})
        np.testing.assert_allclose(others + kept(weights, (part,)), weights, atol=1e-13)


def test_all_parts_at_their_own_level_are_the_weights_to_the_last_bit():
    weights = some_weights(1)
    np.testing.assert_array_equal(kept(weights, PARTS), weights)


@given(SEEDS)
def test_the_level_alone_values_every_action_of_every_state_alike(seed):
    weights = some_weights(seed)
    found = values(kept(weights, ("level",)), seed)
    np.testing.assert_allclose(found, 10 * level_of(weights))  # cycles of 0.1 s


@given(SEEDS)
def test_the_shape_tells_no_actions_apart(seed):
    assert np.ptp(values(kept(some_weights(seed), ("shape",)), seed)) == 0


@given(SEEDS)
def test_preferences_sum_to_zero_in_every_state_and_tell_actions_apart_as_all_do(seed):
    weights = some_weights(seed)
    all_of_it, preferences = (values(kept(weights, p), seed) for p in (PARTS, ("preferences",)))
    assert preferences.sum() == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(
        all_of_it - all_of_it.mean(), preferences - preferences.mean(), atol=1e-9
    )


@given(SEEDS, st.floats(-20, 20))
def test_a_level_that_is_set_takes_the_place_of_the_weights_own(seed, level):
    weights = some_weights(seed)
    found = values(kept(weights, PARTS, level), seed) - values(weights, seed)
    np.testing.assert_allclose(found, 10 * (level - level_of(weights)), atol=1e-9)
    without = kept(weights, ("shape", "preferences"), level)
    np.testing.assert_allclose(without, kept(weights, PARTS, level), atol=1e-13)


def test_the_level_is_the_mean_of_what_was_learned():
    weights = np.zeros(TILING.weights_shape(3))
    weights[0, 0, 0, :2] = 1.0, 4.0
    # 13 variables of 32 active tiles, at 2.5 cycles a weight: 1,040 cycles.
    assert level_of(weights) == pytest.approx(104.0)


def test_weights_of_a_level_have_that_level():
    weights = np.full(TILING.weights_shape(3), weight_of(5.0, TILING.num_features))
    assert level_of(weights) == pytest.approx(5.0)
    assert values(weights, 0) == pytest.approx([50.0] * 3)


@given(SEEDS)
def test_scaling_brings_the_level_to_the_one_asked_for_and_keeps_the_order_of_actions(seed):
    weights = np.abs(some_weights(seed))
    found = scaled(weights, 5.0)
    assert level_of(found) == pytest.approx(5.0)
    np.testing.assert_array_equal(
        np.argsort(values(found, seed)), np.argsort(values(weights, seed))
    )


def test_nothing_learned_carries_nothing_but_the_level_that_is_set():
    nothing = np.zeros(TILING.weights_shape(3))
    for part in PARTS:
        assert not kept(nothing, (part,)).any()
    assert level_of(scaled(nothing, 5.0)) == pytest.approx(5.0)
