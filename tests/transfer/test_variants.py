"""Names of ways to carry weights over, and what is refused."""

import numpy as np
import pytest

from keepaway_transfer.errors import MappingError
from keepaway_transfer.mapping import MAPPING_RULES
from keepaway_transfer.parts import PARTS, level_of
from keepaway_transfer.variants import VARIANTS, variant_of

COPIED = np.random.default_rng(0).normal(0.2, 0.1, size=(4, 19, 14, 32))
COPIED[:, :, 9:] = 0  # never learned


def test_every_part_alone_and_every_pair_has_a_name():
    plain = {frozenset(one.parts) for one in VARIANTS.values() if not one.averaged}
    pairs = {frozenset(set(PARTS) - {part}) for part in PARTS}
    assert plain == {*pairs, frozenset(PARTS), *(frozenset({part}) for part in PARTS)}


def test_every_variant_has_a_rule_that_there_is():
    assert {variant.rule for variant in VARIANTS.values()} == set(MAPPING_RULES)


@pytest.mark.parametrize("name", sorted(VARIANTS))
def test_a_level_can_be_set_for_every_variant(name):
    changed = variant_of(f"{name}@5").changed(COPIED, 13 / 19)
    shifted = variant_of(f"{name}@8").changed(COPIED, 13 / 19)
    if VARIANTS[name].scaled:
        np.testing.assert_allclose(shifted, changed * 8 / 5)
    else:
        np.testing.assert_allclose(shifted - changed, 30 / (19 * 32))  # 3 s over all tiles


def test_optimistic_is_a_constant_at_the_level_set_or_at_that_of_the_copied_weights():
    own, five = (variant_of(name).changed(COPIED, 1.0) for name in ("optimistic", "optimistic@5"))
    assert np.ptp(own) == np.ptp(five) == 0
    assert level_of(own) == pytest.approx(level_of(COPIED))
    assert level_of(five) == pytest.approx(5.0)


def test_only_a_constant_of_a_set_level_needs_no_source():
    needs_none = [name for name in VARIANTS if variant_of(f"{name}@5").needs_no_source]
    assert needs_none == ["optimistic"]
    assert not VARIANTS["optimistic"].needs_no_source


def test_averaged_weights_have_their_level_alone_where_nothing_was_learned():
    shape = variant_of("averaged_shape").changed(COPIED, 1.0)
    assert np.abs(shape[:, :, 9:]).max() < 1e-13
    assert np.abs(shape[:, :, :9]).max() > 1e-3


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
