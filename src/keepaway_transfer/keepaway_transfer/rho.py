"""The behaviour transfer function rho: what was learned on a source task as a start for a target.

A target tile takes the weight that the source has for the same represented value: of the source
state variable and action that the inter-task mapping names, the tile whose centre is nearest to
the target tile's centre (Taylor & Stone 2004; with the averaging step it is rho_CMAC of Taylor,
Stone & Liu, JMLR 8, 2007). Between equal tile widths that is the tile of the same number. Between
unequal ones the 32 active tiles of a value take weights from around the same value, spread over
the target's width instead of the source's.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from keepaway_agent.actions import Role
from keepaway_agent.learning.cmac import NUM_TILINGS, WIDTH_PROFILES, Tiling, make_tiling
from keepaway_agent.learning.weights import LearnedWeights
from keepaway_sim.task import Task
from keepaway_sim.version import code_version
from keepaway_transfer.errors import MappingError
from keepaway_transfer.mapping import MAPPING_RULES, InterTaskMapping, actions, state_variables
from keepaway_transfer.parts import WeightsArray, sample_of
from keepaway_transfer.variants import RHO, Variant, variant_of


@dataclass(frozen=True)
class Transfer:
    """What decides how a player's weights are carried over.

    Raises:
        MappingError: no such variant.
    """

    target: str  # task, "4v3"
    variant: str = "rho"  # as `variants.variant_of` reads it: "rho", "optimistic@5"
    mapping: InterTaskMapping | None = None  # one's own, instead of the variant's
    seed: int = 0  # of the shuffled mapping
    widths: str = ""  # profile of the target's tile widths; empty: the source's

    def __post_init__(self) -> None:
        variant_of(self.variant)  # refuse an unknown one now

    def mapping_from(self, source: str) -> InterTaskMapping:
        """The mapping from this source task.

        Raises:
            MappingError: one's own mapping is between other tasks, or there is no rule.
        """
        if self.mapping is None:
            rule = MAPPING_RULES[variant_of(self.variant).rule]
            return rule(source, self.target, np.random.default_rng(self.seed))
        if (self.mapping.source, self.mapping.target) != (source, self.target):
            raise MappingError(
                f"the mapping goes from {self.mapping.source} to {self.mapping.target},"
                f" not from {source} to {self.target}"
            )
        return self.mapping


def transferred(source: LearnedWeights, transfer: Transfer) -> LearnedWeights:
    """What a keeper of the target task starts with, after a keeper of the source task.

    The field, the order of players and the learning parameters stay what they were, and so do the
    episodes and hours it took.

    Raises:
        MappingError: weights of a taker, tiles of no known profile, or as `rho` and `Transfer` do.
    """
    if source.role != Role.KEEPER:
        raise MappingError(f"weights of a {source.role.name.lower()}: rho is for keepers'")
    target = Task.parse(transfer.target)
    tiling = make_tiling(
        Role.KEEPER,
        target.num_keepers,
        target.num_takers,
        source.field_length,
        source.field_width,
        transfer.widths or _profile(source),
    )
    mapping = transfer.mapping_from(source.task)
    variant = variant_of(transfer.variant)
    values = rho(source.values, source.tiling, tiling, mapping, variant)
    return replace(
        source,
        values=values,
        tiling=tiling,
        num_keepers=target.num_keepers,
        num_takers=target.num_takers,
        code_version=code_version(),
    )


def rho(
    weights: WeightsArray,
    source: Tiling,
    target: Tiling,
    mapping: InterTaskMapping,
    variant: Variant = RHO,
) -> WeightsArray:
    """Weights for the target task from those of a keeper of the source task.

    Args:
        weights: (num_actions, num_features, num_tiles, num_tilings) of the source.
        source: how the source's state variables are tiled.
        target: how the target's are.
        mapping: which source variable and action stand for each of the target.
        variant: what is done to the copied weights; the rule of its mapping is not looked at.

    Returns:
        (num_actions, num_features, num_tiles, num_tilings) of the target.

    Raises:
        MappingError: weights or tilings that are not of the mapping's tasks; or as the variant.
    """
    _check_tasks(weights, source, target, mapping)
    known = weights.reshape(*weights.shape[:2], -1)
    carried = np.zeros(target.weights_shape(len(mapping.chi_a)))
    flat = carried.reshape(*carried.shape[:2], -1)
    for variable, of_source in enumerate(mapping.variable_indices):
        tiles = nearest_tiles(source, of_source, target, variable)
        for action, source_action in enumerate(mapping.action_indices):
            if of_source >= 0 and source_action >= 0:
                flat[action, variable] = known[source_action, of_source, tiles]
    mapped = sum(index >= 0 for index in mapping.variable_indices)
    scale = source.num_features / mapped if mapped else 1.0
    return variant.changed(carried, scale, lambda: sample_of(mapping.target, target))


def nearest_tiles(
    source: Tiling, source_variable: int, target: Tiling, target_variable: int
) -> NDArray[np.int64]:
    """For each flat tile of a target variable the source tile with the nearest centre.

    Flat tile j = tile * 32 + tiling reaches over the 32 fine cells j-31 .. j, so its centre lies
    (j - 15) / 32 widths above the variable's low end. Centres off the source's tiles take its
    first or last tile.

    Returns:
        (num_tiles * num_tilings of the target,) flat source tiles.
    """
    middle = NUM_TILINGS // 2 - 1
    tiles = np.arange(target.num_tiles * NUM_TILINGS)
    cell = target.widths[target_variable] / NUM_TILINGS
    centres = target.lows[target_variable] + (tiles - middle) * cell  # [m or rad]
    source_cell = source.widths[source_variable] / NUM_TILINGS
    nearest = np.rint((centres - source.lows[source_variable]) / source_cell) + middle
    return np.asarray(np.clip(nearest, 0, source.num_tiles * NUM_TILINGS - 1), dtype=np.int64)


def _profile(source: LearnedWeights) -> str:
    """The profile of tile widths that made the source's tiling."""
    teams, field = (
        (source.num_keepers, source.num_takers),
        (source.field_length, source.field_width),
    )
    for profile in WIDTH_PROFILES:
        if make_tiling(Role.KEEPER, *teams, *field, profile) == source.tiling:
            return profile
    raise MappingError(
        f"the weights have tiles of no known profile: name the target's,"
        f" {' or '.join(WIDTH_PROFILES)}"
    )


def _check_tasks(
    weights: WeightsArray, source: Tiling, target: Tiling, mapping: InterTaskMapping
) -> None:
    expected = source.weights_shape(len(actions(mapping.source)))
    if weights.shape != expected:
        raise MappingError(
            f"weights of shape {weights.shape} where {mapping.source} has {expected}"
        )
    for tiling, task in ((source, mapping.source), (target, mapping.target)):
        if tiling.feature_names != state_variables(task):
            raise MappingError(
                f"not the tiling of a keeper in {task}: it has {', '.join(tiling.feature_names)}"
            )
