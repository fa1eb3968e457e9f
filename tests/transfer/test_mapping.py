"""Which source variable and action each target one takes, and what is refused."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from keepaway_transfer.errors import MappingError
from keepaway_transfer.mapping import (
    MAPPING_RULES,
    ZERO,
    InterTaskMapping,
    actions,
    load_mapping,
    modified_mapping,
    partial_mapping,
    rho_mapping,
    shuffled_mapping,
    state_variables,
)


@pytest.mark.parametrize(("task", "count"), [("3v2", 13), ("4v3", 19), ("5v4", 25)])
def test_the_papers_tasks_have_13_19_and_25_state_variables(task, count):
    assert len(state_variables(task)) == count


def test_rho_from_3v2_to_4v3_is_the_papers_table():
    rho = rho_mapping("3v2", "4v3")
    assert rho.variable_indices == (0, 1, 2, 2, 3, 4, 4, 5, 6, 6, 7, 8, 8, 9, 10, 10, 11, 12, 12)
    assert rho.action_indices == (0, 1, 2, 2)


def test_rho_from_3v2_to_5v4_gives_both_new_players_what_the_last_one_has():
    rho = rho_mapping("3v2", "5v4")
    assert [rho.chi_x[f"dist_k1_k{i}"] for i in (2, 3, 4, 5)] == ["dist_k1_k2", *["dist_k1_k3"] * 3]
    assert rho.action_indices == (0, 1, 2, 2, 2)


def test_modified_takes_k2_and_t1_for_the_new_players_and_leaves_the_actions():
    modified = modified_mapping("3v2", "4v3")
    assert modified.variable_indices == (
        0,
        1,
        2,
        1,
        3,
        4,
        3,
        5,
        6,
        5,
        7,
        8,
        7,
        9,
        10,
        9,
        11,
        12,
        11,
    )
    assert modified.action_indices == (0, 1, 2, 2)


def test_partial_leaves_exactly_the_six_new_variables_at_zero():
    partial = partial_mapping("3v2", "4v3")
    assert [name for name, source in partial.chi_x.items() if source == ZERO] == [
        "dist_k1_k4", "dist_k1_t3", "dist_k4_c", "dist_t3_c", "min_dist_k4_t", "min_ang_k4_t",
    ]  # fmt: skip
    assert partial.variable_indices.count(-1) == 6


def test_shuffled_uses_every_source_name_as_often_as_rho_but_elsewhere():
    rho = rho_mapping("3v2", "4v3")
    shuffled = shuffled_mapping("3v2", "4v3", np.random.default_rng(1))
    assert sorted(shuffled.variable_indices) == sorted(rho.variable_indices)
    assert shuffled.variable_indices != rho.variable_indices


def test_shuffled_is_repeated_by_its_seed():
    first, again, other = (
        shuffled_mapping("3v2", "4v3", np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert first == again != other


@given(st.integers(2, 6), st.integers(1, 6), st.sampled_from(["rho", "rho_modified", "partial"]))
def test_every_rule_is_the_identity_between_equal_tasks(num_keepers, num_takers, rule):
    task = f"{num_keepers}v{num_takers}"
    mapping = MAPPING_RULES[rule](task, task, np.random.default_rng(0))
    assert mapping.variable_indices == tuple(range(len(state_variables(task))))
    assert mapping.action_indices == tuple(range(num_keepers))


@given(
    st.integers(2, 5),
    st.integers(1, 5),
    st.integers(0, 3),
    st.integers(0, 3),
    st.sampled_from(sorted(MAPPING_RULES)),
)
def test_every_rule_covers_every_larger_task_with_variables_of_the_same_kind(
    n, m, more_n, more_m, rule
):
    source, target = f"{n}v{m}", f"{n + more_n}v{m + more_m}"
    mapping = MAPPING_RULES[rule](source, target, np.random.default_rng(0))  # made means checked
    assert tuple(mapping.chi_x) == state_variables(target)
    if rule != "shuffled":
        kinds = {
            re.sub(r"\d", "", a) == re.sub(r"\d", "", b)
            for a, b in mapping.chi_x.items()
            if b != ZERO
        }
        assert kinds == {True}


def test_a_smaller_target_has_no_rule():
    with pytest.raises(MappingError, match="4v3 to 3v2"):
        rho_mapping("4v3", "3v2")


def changed(**changes):
    """The table of rho from 3v2 to 4v3 with entries of chi_x replaced (None: left out)."""
    chi_x = {**rho_mapping("3v2", "4v3").chi_x, **changes}
    return {name: source for name, source in chi_x.items() if source is not None}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dist_k1_k4": None}, "chi_x has no entry for 'dist_k1_k4'"),
        ({"dist_k1_k5": "dist_k1_k3"}, "'dist_k1_k5', which the target"),
        ({"dist_k1_k4": "dist_k1_k4"}, "'dist_k1_k4', which the source"),
    ],
)
def test_a_gap_or_a_name_too_many_is_refused_by_name(change, message):
    with pytest.raises(MappingError, match=re.escape(message)):
        InterTaskMapping("3v2", "4v3", changed(**change), rho_mapping("3v2", "4v3").chi_a)


def test_a_missing_action_is_refused_by_name():
    with pytest.raises(MappingError, match="chi_a has no entry for 'pass_k4'"):
        InterTaskMapping("3v2", "4v3", changed(), {name: name for name in actions("3v2")})


def test_a_mapping_comes_back_from_its_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(partial_mapping("3v2", "4v3").to_toml())
    assert load_mapping(path) == partial_mapping("3v2", "4v3")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("source = '3v2'\n", "mine.toml: 'target' is missing"),
        ("source = ", "mine.toml: not a TOML file"),
        (rho_mapping("3v2", "4v3").to_toml().replace("pass_k2", "pass_k9"), "mine.toml: chi_a"),
    ],
)
def test_a_broken_file_is_refused_with_its_name(tmp_path, text, message):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(MappingError, match=re.escape(message)):
        load_mapping(path)
