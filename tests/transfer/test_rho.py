"""What a target task starts with after rho."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keepaway_agent.actions import Role
from keepaway_agent.learning.cmac import Tiling, action_values, make_tiling, state_cells
from keepaway_agent.learning.config import SarsaConfig
from keepaway_agent.learning.weights import LearnedWeights, load_weights, save_weights
from keepaway_sim.task import Task
from keepaway_transfer.errors import MappingError
from keepaway_transfer.mapping import (
    partial_mapping,
    rho_mapping,
    shuffled_mapping,
    state_variables,
)
from keepaway_transfer.rho import Transfer, nearest_tiles, rho, transferred
from keepaway_transfer.variants import VARIANTS, Variant, variant_of


def tiling_of(task, profile="default"):
    parsed = Task.parse(task)
    return make_tiling(Role.KEEPER, parsed.num_keepers, parsed.num_takers, profile=profile)


def random_weights(task, seed=0, profile="default"):
    num_actions = Task.parse(task).num_keepers
    shape = tiling_of(task, profile).weights_shape(num_actions)
    return np.random.default_rng(seed).normal(size=shape)


def values(weights, tiling, state):
    """The value of every action in a state, as an agent computes it."""
    flat = weights.reshape(*weights.shape[:2], -1)
    result = np.empty(len(flat))
    action_values(flat, state_cells(state, tiling), result)
    return result


def random_state(task, generator):
    tiling = tiling_of(task)
    return generator.uniform(tiling.lows, tiling.highs)


def carried(source, target, seed=0):
    return rho(
        random_weights(source, seed),
        tiling_of(source),
        tiling_of(target),
        rho_mapping(source, target),
    )


def named(name):
    """The variant of this name, at 5 s where it needs a level."""
    return f"{name}@5" if VARIANTS[name].scaled else name


def test_every_target_tile_has_the_weight_of_its_variables_and_actions_stand_in():
    weights, target = random_weights("3v2"), carried("3v2", "4v3")
    k4_c, k3_c = (
        state_variables("4v3").index("dist_k4_c"),
        state_variables("3v2").index("dist_k3_c"),
    )
    assert target.shape == tiling_of("4v3").weights_shape(4)
    np.testing.assert_array_equal(target[3, k4_c], weights[2, k3_c])
    np.testing.assert_array_equal(target[0, 18], weights[0, 12])


def test_three_values_worked_by_hand():
    # In 2v1 each tile of variable i and action a weighs (i + 1) * (1, 10)[a]. A 2v1 value is the
    # sum over variables i = 1..7 of 32 i, times 1 or 10; rho takes variables 2, 4, 6 and 7 (of
    # K2) once more and variables 3 and 5 (of T1) once more: 1 + 2 * (2 + 3 + 4 + 5 + 6 + 7) = 55.
    tiling = tiling_of("2v1")
    weights = np.ones(tiling.weights_shape(2)) * np.arange(1.0, 8.0)[None, :, None, None]
    weights[1] *= 10
    assert values(weights, tiling, np.full(7, 1.5)).tolist() == [32 * 28, 320 * 28]
    target = rho(weights, tiling, tiling_of("3v2"), rho_mapping("2v1", "3v2"))
    assert values(target, tiling_of("3v2"), np.full(13, 1.5)).tolist() == [
        32 * 55,
        320 * 55,
        320 * 55,
    ]


@pytest.mark.parametrize("variant", ["rho", "rho_modified", "rescaled", "partial"])
@pytest.mark.parametrize("profile", ["default", "framework"])
def test_from_a_task_to_itself_nothing_changes(variant, profile):
    weights, tiling = random_weights("3v2", profile=profile), tiling_of("3v2", profile)
    mapping = Transfer("3v2", variant).mapping_from("3v2")
    same = rho(weights, tiling, tiling, mapping, variant_of(variant))
    np.testing.assert_array_equal(same, weights)


@given(st.integers(0, 10_000))
def test_just_after_rho_pass2_and_pass3_have_the_same_value_in_every_state(seed):
    generator = np.random.default_rng(seed)
    found = values(carried("3v2", "4v3"), tiling_of("4v3"), random_state("4v3", generator))
    assert found[2] == found[3]
    assert len(set(found)) == 3


def test_a_target_state_that_is_a_source_state_with_copies_sums_the_copies():
    generator = np.random.default_rng(5)
    weights, small, large = random_weights("3v2"), tiling_of("3v2"), tiling_of("4v3")
    state = random_state("3v2", generator)
    mapping = rho_mapping("3v2", "4v3")
    twice = state[list(mapping.variable_indices)]
    new = [i for i, name in enumerate(mapping.chi_x) if name not in state_variables("3v2")]
    only_new = rho(weights, small, large, mapping)
    only_new[:, [i for i in range(19) if i not in new]] = 0
    expected = values(weights, small, state) + values(only_new, large, twice)[:3]
    np.testing.assert_allclose(values(carried("3v2", "4v3"), large, twice)[:3], expected)


def test_rescaled_keeps_the_scale_of_the_values():
    # If every variable says the same, 13 of them sum to 13/19 of what 19 sum to.
    weights = np.full(tiling_of("3v2").weights_shape(3), 0.25)
    rescaled = Variant(rescaled=True)
    target = rho(weights, tiling_of("3v2"), tiling_of("4v3"), rho_mapping("3v2", "4v3"), rescaled)
    source_value = values(weights, tiling_of("3v2"), np.ones(13))[0]
    assert values(target, tiling_of("4v3"), np.ones(19)) == pytest.approx([source_value] * 4)


def test_rescaled_counts_only_variables_that_are_mapped():
    weights = random_weights("3v2")
    mapping = partial_mapping("3v2", "4v3")
    plain, rescaled = (
        rho(weights, tiling_of("3v2"), tiling_of("4v3"), mapping, Variant(rescaled=option))
        for option in (False, True)
    )
    np.testing.assert_array_equal(plain, rescaled)  # 13 of 13


def test_partial_leaves_the_weights_of_new_variables_at_zero():
    target = rho(
        random_weights("3v2"), tiling_of("3v2"), tiling_of("4v3"), partial_mapping("3v2", "4v3")
    )
    zero = [name for i, name in enumerate(state_variables("4v3")) if not target[:, i].any()]
    assert zero == [
        "dist_k1_k4", "dist_k1_t3", "dist_k4_c", "dist_t3_c", "min_dist_k4_t", "min_ang_k4_t",
    ]  # fmt: skip


def test_averaged_gives_the_mean_of_the_non_zero_weights_to_the_zero_ones_alone():
    weights = np.zeros(tiling_of("3v2").weights_shape(3))
    weights[0, 0, 0, :2] = 1.0, 4.0  # dist_k1_c is mapped once, hold once
    averaged = Variant(averaged=True)
    target = rho(weights, tiling_of("3v2"), tiling_of("4v3"), rho_mapping("3v2", "4v3"), averaged)
    assert target[0, 0, 0, :3].tolist() == [1.0, 4.0, 2.5]
    assert set(np.unique(target)) == {1.0, 2.5, 4.0}


def test_a_source_that_learned_nothing_gives_a_target_that_knows_nothing():
    weights = np.zeros(tiling_of("3v2").weights_shape(3))
    mapping, averaged = rho_mapping("3v2", "4v3"), Variant(averaged=True)
    assert not rho(weights, tiling_of("3v2"), tiling_of("4v3"), mapping, averaged).any()


def test_shuffled_carries_other_weights_than_rho():
    mapping = shuffled_mapping("3v2", "4v3", np.random.default_rng(1))
    shuffled = rho(random_weights("3v2"), tiling_of("3v2"), tiling_of("4v3"), mapping)
    assert np.any(shuffled != carried("3v2", "4v3"))


def test_a_chain_over_4v3_is_the_direct_way_to_5v4():
    through = rho(
        carried("3v2", "4v3"), tiling_of("4v3"), tiling_of("5v4"), rho_mapping("4v3", "5v4")
    )
    np.testing.assert_array_equal(through, carried("3v2", "5v4"))


def one_variable(width, low=0.0, high=24.0):
    return Tiling(("x",), (width,), (low,), (high,))


def test_equal_widths_take_the_tile_of_the_same_number():
    tiles = nearest_tiles(one_variable(2.0), 0, one_variable(2.0), 0)
    assert tiles.tolist() == list(range(13 * 32))


def test_a_shifted_range_takes_the_tile_of_the_same_value():
    # The target's values begin at 2 m, one source tile (32 fine cells) above the source's.
    tiles = nearest_tiles(one_variable(2.0), 0, one_variable(2.0, low=2.0), 0)
    assert tiles.tolist() == list(range(32, 13 * 32))


def test_values_the_source_never_tiled_take_its_outermost_tiles():
    tiles = nearest_tiles(one_variable(2.0), 0, one_variable(2.0, low=-2.0, high=26.0), 0)
    assert tiles.tolist() == [0] * 32 + list(range(13 * 32)) + [13 * 32 - 1] * 32


def test_three_metre_tiles_take_two_metre_tiles_at_the_same_value():
    # Target tile 47 lies (47 - 15) / 32 * 3 m = 3 m up; the source tile there is 3 / 2 * 32 + 15.
    tiles = nearest_tiles(one_variable(2.0), 0, one_variable(3.0), 0)
    assert tiles[[15, 47, 79]].tolist() == [15, 63, 111]
    assert tiles[0] == 0  # 1.4 m below the low end, where the source has no tile: its lowest


@pytest.mark.parametrize(("source_width", "target_width"), [(2.0, 3.0), (3.0, 2.0), (2.0, 2.5)])
def test_a_source_value_is_found_again_for_the_same_represented_value(source_width, target_width):
    # A value function that is linear in x is the same whatever window it is averaged over.
    source, target = one_variable(source_width), one_variable(target_width)
    cell = source_width / 32
    centres = (np.arange(source.num_tiles * 32) - 15) * cell
    weights = (0.5 * centres - 2).reshape(1, 1, -1, 32)
    copied = weights.reshape(-1)[nearest_tiles(source, 0, target, 0)].reshape(1, 1, -1, 32)
    for x in np.linspace(4, 19, 40):
        original, found = values(weights, source, [x])[0], values(copied, target, [x])[0]
        assert original == pytest.approx(32 * (0.5 * x - 2), abs=32 * 0.5 * cell)
        assert found == pytest.approx(original, abs=32 * 0.5 * (cell + target_width / 32))


def test_the_frameworks_widths_carry_a_learned_bump_to_where_it_was_learned():
    # K3's distance has tiles of 3 m in 3v2; K3 in 4v3 has 2 m: pass_k3 was good at 12 m.
    source, target = tiling_of("3v2", "framework"), tiling_of("4v3", "framework")
    k3 = state_variables("3v2").index("dist_k1_k3")
    k3_of_4v3 = state_variables("4v3").index("dist_k1_k3")
    assert (source.widths[k3], target.widths[k3_of_4v3]) == (3.0, 2.0)
    weights = np.zeros(source.weights_shape(3))
    state = np.ones(13)
    state[k3] = 12.0
    cells = state_cells(state, source)
    weights[2, k3].reshape(-1)[cells[k3] : cells[k3] + 32] = 1.0
    target_weights = rho(weights, source, target, rho_mapping("3v2", "4v3"))

    def value_at(x):
        state = np.full(19, 20.0)
        state[15:] = 3.0  # angles [rad]
        state[k3_of_4v3] = x
        return values(target_weights, target, state)[2]

    assert value_at(12.0) == 32
    assert value_at(12.0 - 2.6) == value_at(12.0 + 2.6) == 0


def test_weights_of_another_task_are_refused():
    with pytest.raises(MappingError, match="where 3v2 has"):
        rho(random_weights("4v3"), tiling_of("3v2"), tiling_of("4v3"), rho_mapping("3v2", "4v3"))


def test_a_tiling_of_another_task_is_refused():
    with pytest.raises(MappingError, match="not the tiling of a keeper in 4v3"):
        rho(random_weights("3v2"), tiling_of("3v2"), tiling_of("5v4"), rho_mapping("3v2", "4v3"))


def test_an_unknown_variant_is_refused_with_those_there_are():
    with pytest.raises(MappingError, match="choose one of rho, rho_modified"):
        Transfer("4v3", "rho2")


def learned(task, profile="default", role=Role.KEEPER, **changes):
    parsed = Task.parse(task)
    tiling = make_tiling(role, parsed.num_keepers, parsed.num_takers, profile=profile)
    return LearnedWeights(
        values=np.random.default_rng(0).normal(size=tiling.weights_shape(parsed.num_keepers)),
        role=role,
        num_keepers=parsed.num_keepers,
        num_takers=parsed.num_takers,
        field_length=25.0,
        field_width=25.0,
        tiling=tiling,
        **changes,
    )


@pytest.mark.parametrize("variant", sorted(VARIANTS))
@pytest.mark.parametrize("profile", ["default", "framework"])
def test_every_variant_makes_whole_weights_of_the_target_task(variant, profile):
    found = transferred(learned("3v2", profile), Transfer("4v3", named(variant)))
    assert (found.task, found.tiling) == ("4v3", tiling_of("4v3", profile))
    assert found.values.any()


def test_what_a_keeper_learned_and_how_goes_with_its_weights():
    sarsa = SarsaConfig(epsilon=0.05)
    source = learned("3v2", sarsa=sarsa, episodes=1000, hours=2.5, player="keeper_2", ordering="k1")
    found = transferred(source, Transfer("4v3"))
    assert (found.sarsa, found.episodes, found.hours) == (sarsa, 1000, 2.5)
    assert (found.player, found.ordering) == ("keeper_2", "k1")


def test_other_widths_than_the_sources_can_be_asked_for():
    found = transferred(learned("3v2", "framework"), Transfer("4v3", widths="default"))
    assert found.tiling == tiling_of("4v3")


def test_a_mapping_of_ones_own_is_used_instead_of_the_variants():
    source = learned("3v2")
    own = transferred(source, Transfer("4v3", mapping=partial_mapping("3v2", "4v3")))
    np.testing.assert_array_equal(
        own.values, transferred(source, Transfer("4v3", "partial")).values
    )


def test_a_mapping_between_other_tasks_is_refused():
    with pytest.raises(MappingError, match="from 4v3 to 5v4, not from 3v2 to 4v3"):
        transferred(learned("3v2"), Transfer("4v3", mapping=rho_mapping("4v3", "5v4")))


def test_the_weights_of_a_taker_are_refused():
    with pytest.raises(MappingError, match="weights of a taker"):
        transferred(learned("3v2", role=Role.TAKER), Transfer("4v3"))


def test_transferred_weights_survive_their_file(tmp_path):
    found = transferred(learned("3v2"), Transfer("4v3"))
    save_weights(tmp_path / "keeper.npz", found)
    np.testing.assert_array_equal(load_weights(tmp_path / "keeper.npz").values, found.values)
