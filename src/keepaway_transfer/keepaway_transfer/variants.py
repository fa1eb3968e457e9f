"""The ways to carry weights over, by name; a level can be set behind the name.

>>> variant_of("rho_averaged")
Variant(rule='rho', averaged=True, rescaled=False, scaled=False, parts=('level', 'shape', \
'preferences'), level=None)
>>> variant_of("optimistic@5").level  # every action of every state is worth 5 s
5.0
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from keepaway_transfer.errors import MappingError
from keepaway_transfer.parts import PARTS, Sample, WeightsArray, kept, scaled, weight_of

LEVEL_SIGN = "@"


@dataclass(frozen=True)
class Variant:
    """A way to carry weights over: the rule of its mapping and what is done to the weights."""

    rule: str = "rho"  # of mapping.MAPPING_RULES
    averaged: bool = False  # weights still zero take the mean of the others
    rescaled: bool = False  # action values keep the scale they have in the source task
    scaled: bool = False  # all weights are multiplied to bring their level to the one that is set
    parts: tuple[str, ...] = PARTS  # what of the weights is kept
    level: float | None = None  # [s] set instead of the weights' own

    @property
    def needs_no_source(self) -> bool:
        """Does it give the same whatever was learned before?"""
        return self.parts == ("level",) and self.level is not None

    @property
    def needs_sample(self) -> bool:
        """Is a level to be found in the copied weights?"""
        return self.scaled or self.parts != PARTS or self.level is not None

    def changed(
        self, carried: WeightsArray, scale: float, sample: Callable[[], Sample]
    ) -> WeightsArray:
        """What becomes of copied weights.

        Args:
            carried: (num_actions, num_features, num_tiles, num_tilings) of the target.
            scale: state variables of the source over mapped ones of the target: an action's value
                is a sum over state variables.
            sample: gives the states of the target that a level is a mean over.

        Raises:
            MappingError: a level is needed, and there is no sample of the target's states.
        """
        if self.rescaled:
            carried = carried * scale
        if self.averaged and carried.any():
            carried = np.where(carried == 0, carried[carried != 0].mean(), carried)
        if not self.needs_sample:
            return carried
        if self.scaled:
            return scaled(carried, sample(), self.level or 0.0)
        return kept(carried, sample(), self.parts, self.level)


def constant(level: float, shape: tuple[int, int, int, int]) -> WeightsArray:
    """Weights that value every action of every state at this level [s]."""
    return np.full(shape, weight_of(level, shape[1]))


RHO = Variant()
"""The paper's."""

VARIANTS: Mapping[str, Variant] = {
    "rho": RHO,
    "rho_modified": Variant("rho_modified"),  # its sensitivity test
    "rho_averaged": Variant(averaged=True),  # Taylor, Stone & Liu 2007
    "rescaled": Variant(rescaled=True),
    "rho_scaled": Variant(scaled=True),  # to a level that must be set
    "partial": Variant("partial"),
    # What rho carries, part by part (`parts`).
    "optimistic": Variant(parts=("level",)),  # a constant; with a level it needs no source
    "rho_shape": Variant(parts=("shape",)),
    "rho_preferences": Variant(parts=("preferences",)),
    "rho_level_shape": Variant(parts=("level", "shape")),
    "rho_level_preferences": Variant(parts=("level", "preferences")),
    "rho_shape_preferences": Variant(parts=("shape", "preferences")),
    # The same after averaging.
    "averaged_shape": Variant(averaged=True, parts=("shape",)),
    "averaged_preferences": Variant(averaged=True, parts=("preferences",)),
    "averaged_shape_preferences": Variant(averaged=True, parts=("shape", "preferences")),
    "averaged_scaled": Variant(averaged=True, scaled=True),
    "shuffled": Variant("shuffled"),  # a negative control
}


def variant_of(text: str) -> Variant:
    """The variant of a name in VARIANTS, or of a name and a level [s]: "rho_shape@5".

    Raises:
        MappingError: no such variant, a level that is no number, or none where one is needed.
    """
    name, sign, level = text.partition(LEVEL_SIGN)
    if name not in VARIANTS:
        raise MappingError(f"variant={text!r}: choose one of {', '.join(VARIANTS)}")
    variant = VARIANTS[name]
    if sign:
        return replace(variant, level=_level(text, level))
    if variant.scaled:
        raise MappingError(f"variant={text!r}: set a level in seconds, like {name}@5")
    return variant


def _level(text: str, level: str) -> float:
    try:
        seconds = float(level)
    except ValueError:
        seconds = math.nan
    if not math.isfinite(seconds):
        raise MappingError(f"variant={text!r}: {level!r} is no level: give seconds, as in rho@5")
    return seconds
