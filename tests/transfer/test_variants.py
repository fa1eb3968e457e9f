"""Names of ways to carry weights over, and what is refused."""

import re
from pathlib import Path

import numpy as np
import pytest

from keepaway_agent.actions import Role
from keepaway_agent.learning.cmac import make_tiling
from keepaway_transfer import variants
from keepaway_transfer.errors import MappingError
from keepaway_transfer.mapping import MAPPING_RULES
from keepaway_transfer.parts import PARTS, level_of, sample_of
from keepaway_transfer.variants import VARIANTS, constant, variant_of

TILING = make_tiling(Role.KEEPER, 4, 3)
SAMPLE = sample_of("4v3", TILING)
COPIED = np.random.default_rng(0).normal(0.2, 0.1, size=TILING.weights_shape(4))
COPIED[:, :, 9:] = 0  # never learned


def changed(text):
    return variant_of(text).changed(COPIED, 13 / 19, lambda: SAMPLE)


def test_every_part_alone_and_every_pair_has_a_name():
    plain = {frozenset(one.parts) for one in VARIANTS.values() if not one.averaged}
    pairs = {frozenset(set(PARTS) - {part}) for part in PARTS}
    assert plain == {*pairs, frozenset(PARTS), *(frozenset({part}) for part in PARTS)}


def test_the_readme_names_every_variant():
    readme = Path(variants.__file__).parents[1] / "README.md"
    table = readme.read_text("utf-8").split("## Ways to carry")[1].split("## Studies")[0]
    named = set(re.findall(r"`(\w+)(?:@5)?`", table))
    assert named >= set(VARIANTS)


def test_every_variant_has_a_rule_that_there_is():
    assert {variant.rule for variant in VARIANTS.values()} == set(MAPPING_RULES)


@pytest.mark.parametrize("name", sorted(VARIANTS))
def test_a_level_can_be_set_for_every_variant(name):
    low, high = changed(f"{name}@5"), changed(f"{name}@8")
    if VARIANTS[name].scaled:
        np.testing.assert_allclose(high, low * 8 / 5)
    else:
        np.testing.assert_allclose(high - low, 30 / (19 * 32))  # 3 s over all tiles


def test_optimistic_is_a_constant_at_the_level_set_or_at_that_of_the_copied_weights():
    own, five = changed("optimistic"), changed("optimistic@5")
    assert np.ptp(own) == np.ptp(five) == 0
    assert level_of(own, SAMPLE) == pytest.approx(level_of(COPIED, SAMPLE))
    assert level_of(five, SAMPLE) == pytest.approx(5.0)
    np.testing.assert_array_equal(five, constant(5.0, COPIED.shape))


def test_only_a_constant_of_a_set_level_needs_no_source():
    needs_none = [name for name in VARIANTS if variant_of(f"{name}@5").needs_no_source]
    assert needs_none == ["optimistic"]
    assert not VARIANTS["optimistic"].needs_no_source


@pytest.mark.parametrize("name", ["rho", "rho_averaged", "rescaled", "partial"])
def test_without_a_level_no_sample_of_states_is_asked_for(name):
    def no_sample():
        raise AssertionError

    assert variant_of(name).changed(COPIED, 1.0, no_sample).any()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("rho2", "variant='rho2': choose one of rho, rho_modified"),
        ("rho2@5", "variant='rho2@5': choose one of"),
        ("rho@", "variant='rho@': '' is no level: give seconds"),
        ("rho@nan", "'nan' is no level"),
        ("rho@five", "'five' is no level"),
        ("rho_scaled", "set a level in seconds, like rho_scaled@5"),
    ],
)
def test_what_is_no_variant_is_refused_in_words(text, message):
    with pytest.raises(MappingError, match=message):
        variant_of(text)
