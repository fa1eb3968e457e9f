"""What transferred weights carry, taken apart and put together again."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keepaway_agent.actions import Role
from keepaway_agent.learning.cmac import action_values, make_tiling, state_cells
from keepaway_transfer.errors import MappingError
from keepaway_transfer.parts import (
    PARTS,
    STATES_FILE,
    kept,
    level_of,
    sample_of,
    scaled,
    split,
    weight_of,
)

TILING = make_tiling(Role.KEEPER, 3, 2)
SAMPLE = sample_of("3v2", TILING)
SEEDS = st.integers(0, 10_000)


def some_weights(seed, learned=0.6):
    """Weights of 3v2, of which a share was learned: the others are zero."""
    generator = np.random.default_rng(seed)
    weights = generator.normal(0.1, 0.3, size=TILING.weights_shape(3))
    weights[generator.random(weights.shape) > learned] = 0
    return weights


def values(weights, seed):
    """The value of every action in a random state [cycles]."""
    return values_in(weights, np.random.default_rng(seed).uniform(TILING.lows, TILING.highs))


def values_in(weights, state):
    """The value of every action in this state [cycles]."""
    found = np.empty(len(weights))
    action_values(weights.reshape(*weights.shape[:2], -1), state_cells(state, TILING), found)
    return found


@given(SEEDS)
def test_the_three_parts_add_up_to_the_weights(seed):
    weights = some_weights(seed)
    parts = split(weights, SAMPLE)
    np.testing.assert_allclose(parts.level + parts.shape + parts.preferences, weights, atol=1e-13)
    alone = sum(kept(weights, SAMPLE, (part,)) for part in PARTS)
    np.testing.assert_allclose(alone, weights, atol=1e-13)


@given(SEEDS)
def test_the_values_add_up_in_every_state(seed):
    weights = some_weights(seed)
    parts = [values(kept(weights, SAMPLE, (part,)), seed) for part in PARTS]
    np.testing.assert_allclose(np.sum(parts, axis=0), values(weights, seed), atol=1e-9)


@given(SEEDS)
def test_pairs_of_parts_are_what_the_third_leaves(seed):
    weights = some_weights(seed)
    for part in PARTS:
        others = kept(weights, SAMPLE, set(PARTS) - {part})
        np.testing.assert_allclose(others + kept(weights, SAMPLE, (part,)), weights, atol=1e-13)


def test_all_parts_at_their_own_level_are_the_weights_to_the_last_bit():
    weights = some_weights(1)
    np.testing.assert_array_equal(kept(weights, SAMPLE, PARTS), weights)


@given(SEEDS)
def test_the_level_alone_values_every_action_of_every_state_alike(seed):
    weights = some_weights(seed)
    found = values(kept(weights, SAMPLE, ("level",)), seed)
    np.testing.assert_allclose(found, 10 * level_of(weights, SAMPLE))  # cycles of 0.1 s


@given(SEEDS)
def test_the_shape_tells_no_actions_apart(seed):
    assert np.ptp(values(kept(some_weights(seed), SAMPLE, ("shape",)), seed)) == 0


@given(SEEDS)
def test_preferences_sum_to_zero_in_every_state_and_tell_actions_apart_as_all_do(seed):
    weights = some_weights(seed)
    all_of_it, preferences = (
        values(kept(weights, SAMPLE, p), seed) for p in (PARTS, ("preferences",))
    )
    assert preferences.sum() == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(
        all_of_it - all_of_it.mean(), preferences - preferences.mean(), atol=1e-9
    )


@given(SEEDS, st.floats(-20, 20))
def test_a_level_that_is_set_takes_the_place_of_the_weights_own(seed, level):
    weights = some_weights(seed)
    found = values(kept(weights, SAMPLE, PARTS, level), seed) - values(weights, seed)
    np.testing.assert_allclose(found, 10 * (level - level_of(weights, SAMPLE)), atol=1e-9)
    without = kept(weights, SAMPLE, ("shape", "preferences"), level)
    np.testing.assert_allclose(without, kept(weights, SAMPLE, PARTS, level), atol=1e-13)


@given(SEEDS)
def test_the_level_is_the_mean_value_over_the_sample_and_its_actions(seed):
    weights = some_weights(seed)
    with np.load(STATES_FILE) as drawn:
        found = [values_in(weights, state) for state in drawn["3v2"]]
    assert level_of(weights, SAMPLE) == pytest.approx(np.mean(found) / 10)  # cycles of 0.1 s


def test_a_task_without_a_sample_is_refused_with_those_that_have_one():
    with pytest.raises(MappingError, match=r"no reference states of 4v1, .* 3v2, 4v3, 5v4"):
        sample_of("4v1", make_tiling(Role.KEEPER, 4, 1))


def test_weights_of_a_level_have_that_level():
    weights = np.full(TILING.weights_shape(3), weight_of(5.0, TILING.num_features))
    assert level_of(weights, SAMPLE) == pytest.approx(5.0)
    assert values(weights, 0) == pytest.approx([50.0] * 3)


@given(SEEDS)
def test_scaling_brings_the_level_to_the_one_asked_for_and_keeps_the_order_of_actions(seed):
    weights = np.abs(some_weights(seed))
    found = scaled(weights, SAMPLE, 5.0)
    assert level_of(found, SAMPLE) == pytest.approx(5.0)
    np.testing.assert_array_equal(
        np.argsort(values(found, seed)), np.argsort(values(weights, seed))
    )


def test_nothing_learned_carries_nothing_but_the_level_that_is_set():
    nothing = np.zeros(TILING.weights_shape(3))
    for part in PARTS:
        assert not kept(nothing, SAMPLE, (part,)).any()
    assert level_of(scaled(nothing, SAMPLE, 5.0), SAMPLE) == pytest.approx(5.0)
