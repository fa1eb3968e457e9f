"""Tile coding: by hand, and against 32 separate tilings written down as one would explain them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keepaway_agent.actions import Role
from keepaway_agent.errors import AgentError
from keepaway_agent.learning.cmac import (
    NUM_TILINGS,
    Tiling,
    action_values,
    add_to_active,
    make_tiling,
    state_cells,
    tile_cells,
)


def one_variable(width: float = 2.0, low: float = 0.0, high: float = 10.0) -> Tiling:
    return Tiling(("x",), (width,), (low,), (high,))


def separate_tilings(x: float, width: float, low: float) -> list[int]:
    """The active tile of each tiling, tiling t being shifted by t/32 of a width."""
    return [
        math.floor((x - low) / width + (NUM_TILINGS - 1 - tiling) / NUM_TILINGS)
        for tiling in range(NUM_TILINGS)
    ]


def test_fine_cells_by_hand():
    tiling = one_variable(width=2.0)  # a fine cell is 1/16 wide
    cells = [state_cells([x], tiling)[0] for x in (0.0, 0.0624, 0.0625, 1.0, 2.0, 9.99)]
    assert cells == [0, 0, 1, 16, 32, 159]


def test_the_active_tiles_of_1_0_by_hand():
    # fine cell 16: flat tiles 16..47, so tile 0 of tilings 16..31 and tile 1 of tilings 0..15
    weights = np.zeros((1, 6, 32))
    add_to_active(weights.reshape(1, -1), np.array([16]), 1.0)
    assert (weights[0, 0] == [0.0] * 16 + [1.0] * 16).all()
    assert (weights[0, 1] == [1.0] * 16 + [0.0] * 16).all()
    assert weights.sum() == 32


def test_tiles_are_enough_for_the_variable_that_needs_most():
    assert one_variable(width=2.0, high=10.0).num_tiles == 6
    assert make_tiling(Role.KEEPER, 3, 2).num_tiles == 19  # 35.4 m / 2 m; 180 / 10 degrees
    assert make_tiling(Role.KEEPER, 3, 2).weights_shape(3) == (3, 13, 19, 32)


def test_values_out_of_range_count_as_the_first_and_the_last():
    tiling = one_variable(width=2.0, low=1.0, high=11.0)
    outside = [state_cells([x], tiling)[0] for x in (-1e9, 0.99, 1.0, 11.0, 11.1, 1e9, math.inf)]
    assert outside == [0, 0, 0, 160, 160, 160, 160]


def test_the_last_window_ends_with_the_last_tile():
    tiling = one_variable()
    assert state_cells([math.inf], tiling)[0] + NUM_TILINGS == tiling.num_tiles * NUM_TILINGS


def test_nan_is_refused():
    tiling = one_variable()
    with pytest.raises(AgentError, match="nan"):
        state_cells([math.nan], tiling)
    with pytest.raises(ValueError, match="NaN"):
        tile_cells(np.array([math.nan]), np.zeros(1), np.ones(1), 64, np.zeros(1, dtype=np.int64))


@given(
    x=st.floats(0, 10, allow_nan=False, exclude_max=True),
    exponent=st.integers(-2, 2),
    low=st.sampled_from([0.0, -4.0, 1.5]),
)
def test_a_window_is_the_active_tile_of_each_of_32_separate_tilings(x, exponent, low):
    width = 2.0**exponent  # so that both formulas round alike
    (cell,) = state_cells([low + x], one_variable(width, low, low + 10.0))
    window = range(cell, cell + NUM_TILINGS)
    active = sorted((flat % NUM_TILINGS, flat // NUM_TILINGS) for flat in window)
    x_as_stored = (low + x) - low  # adding `low` may round x
    assert active == list(enumerate(separate_tilings(low + x_as_stored, width, low)))


@given(st.integers(0, 2**32))
def test_action_values_are_sums_over_separate_tilings(seed):
    rng = np.random.default_rng(seed)
    tiling = make_tiling(Role.KEEPER, 3, 2)
    weights = rng.normal(size=tiling.weights_shape(3))
    state = rng.uniform(tiling.lows, tiling.highs)
    cells, values = state_cells(state, tiling), np.zeros(3)
    action_values(weights.reshape(3, tiling.num_features, -1), cells, values)
    expected = np.zeros(3)
    for i in range(tiling.num_features):
        for t, tile in enumerate(separate_tilings(state[i], tiling.widths[i], tiling.lows[i])):
            expected += weights[:, i, tile, t]
    np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-9)


def test_an_update_reaches_a_values_neighbours_less_the_further_they_are():
    tiling = one_variable(width=2.0)
    weights = np.zeros((1, 1, tiling.num_tiles * NUM_TILINGS))
    add_to_active(weights[0], state_cells([5.0], tiling), 1 / NUM_TILINGS)
    heights = []
    for x in (5.0, 5.5, 6.0, 6.9375, 7.0, 3.0):
        values = np.zeros(1)
        action_values(weights, state_cells([x], tiling), values)
        heights.append(values[0])
    assert heights == [1, 0.75, 0.5, 1 / 32, 0, 0]


def test_default_widths_are_the_same_in_every_task():
    by_kind: dict[str, set[float]] = {}
    for n, m in [(2, 1), (3, 2), (4, 3), (5, 4)]:
        tiling = make_tiling(Role.KEEPER, n, m)
        for name, width in zip(tiling.feature_names, tiling.widths, strict=True):
            kind = "".join(letter for letter in name if not letter.isdigit())
            by_kind.setdefault(kind, set()).add(width)
    assert by_kind == {
        "dist_k_c": {2.0},
        "dist_k_k": {2.0},
        "dist_k_t": {3.0},
        "dist_t_c": {3.0},
        "min_dist_k_t": {4.0},
        "min_ang_k_t": {math.radians(10)},
    }


@pytest.mark.parametrize(
    ("num_keepers", "num_takers", "k1_keeper", "k1_taker"),
    [
        (3, 2, [2, 3], [2, 3]),
        (4, 3, [2, 2, 3], [3, 3, 3]),
        (5, 4, [2, 2, 2, 3], [3, 3, 3, 3]),
    ],
)
def test_the_frameworks_widths(num_keepers, num_takers, k1_keeper, k1_taker):
    tiling = make_tiling(Role.KEEPER, num_keepers, num_takers, profile="framework")
    widths = dict(zip(tiling.feature_names, tiling.widths, strict=True))
    mates, takers = range(2, num_keepers + 1), range(1, num_takers + 1)
    assert widths["dist_k1_c"] == 2
    assert [widths[f"dist_k1_k{i}"] for i in mates] == k1_keeper
    assert [widths[f"dist_k{i}_c"] for i in mates] == k1_keeper
    assert [widths[f"dist_k1_t{j}"] for j in takers] == k1_taker
    assert {widths[f"dist_t{j}_c"] for j in takers} == {3}
    assert {widths[f"min_dist_k{i}_t"] for i in mates} == {4}


def test_the_smallest_teams_have_framework_widths_too():
    assert make_tiling(Role.KEEPER, 2, 1, profile="framework").widths[:3] == (2, 2, 3)


def test_a_larger_field_gets_more_tiles():
    assert make_tiling(Role.KEEPER, 3, 2, 40, 40).num_tiles == math.ceil(math.hypot(40, 40) / 2) + 1


def test_what_makes_no_tiling_is_refused():
    with pytest.raises(AgentError, match="choose one of default, framework"):
        make_tiling(Role.KEEPER, 3, 2, profile="wide")
    with pytest.raises(AgentError, match="x: no tiles of width 0"):
        one_variable(width=0.0)
    with pytest.raises(AgentError, match="unequal"):
        Tiling(("x", "y"), (1.0,), (0.0,), (1.0,))
