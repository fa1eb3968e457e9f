"""Tile coding (CMAC): the value of an action as a sum of weights of active tiles.

Every state variable is tiled alone (Taylor & Stone 2004; Stone & Sutton 2002): 32 one-dimensional
tilings, each shifted by 1/32 of a tile's width against the one before. A value x of the variable
lies in one tile of every tiling, so 32 tiles are active per variable, and an action's value is
the sum of the active tiles' weights over all variables.

How the tiles lie in memory
---------------------------
The shifts cut the axis into *fine cells*, 1/32 of a width each: x is in fine cell
``c = floor((x - low) * 32 / width)``. Which tiles are active depends on c alone. Let tile number
``tile`` of tiling number ``tiling`` have the flat index ``j = tile * 32 + tiling``, and let it
reach over the 32 fine cells j-31 .. j. Then neighbours in j are neighbours on the axis, a fine
cell apart::

    fine cell    ... c-1 |  c  | c+1 ...
    tile j=c-1    =======]                        reaches up to cell c-1
    tile j=c      =============]                  up to cell c
    tile j=c+1    ===================]            up to cell c+1
      ...
    tile j=c+31          [=====================   from cell c on
    tile j=c+32                [===============   from cell c+1 on

so the active tiles of fine cell c are the 32 neighbours ``j = c .. c+31``: one of every tiling
(32 consecutive numbers leave every remainder by 32 once). Looking up a variable's 32 active tiles
is reading a *window* of 32 neighbouring weights, and learning is adding one number to it. No
hashing, no index lists; the same array seen as (num_tiles, 32) is ordinary tile coding.

Shapes: weights of one learner are (num_actions, num_features, num_tiles * 32) float64. The array
is rectangular: num_tiles is what the variable with the most tiles needs. A value below `low` counts
as `low`, a value beyond the last tile as the last; NaN is refused.

Sums are taken in one fixed order, so every caller of these functions gets the same bits.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from keepaway_agent.actions import Role
from keepaway_agent.compiled import compiled
from keepaway_agent.errors import AgentError
from keepaway_agent.learning.features import Feature, features

NUM_TILINGS: Final = 32
"""Tilings per state variable; a constant, so that the compiler unrolls every window."""

DEFAULT_WIDTHS: Final = {
    "keeper_centre": 2.0,
    "k1_keeper": 2.0,
    "k1_taker": 3.0,
    "taker_centre": 3.0,
    "min_keeper_taker": 4.0,
    "min_angle": math.radians(10.0),
    "taker_ball": 2.0,
}
"""Width of a tile by kind of state variable [m or rad]: the same in every task, after Stone &
Sutton (2002), so that a tile means the same in the source and the target of a transfer."""


@dataclass(frozen=True)
class Tiling:
    """How the state variables of one role in one task are cut into tiles.

    Raises:
        AgentError: lists of unequal length, or a variable without a width and a range.
    """

    feature_names: tuple[str, ...]
    widths: tuple[float, ...]  # of a tile [m or rad]
    lows: tuple[float, ...]  # where a variable's range begins
    highs: tuple[float, ...]  # where it must at least reach to

    def __post_init__(self) -> None:
        lengths = {len(getattr(self, field.name)) for field in fields(self)}
        if lengths != {len(self.feature_names)} or not self.feature_names:
            raise AgentError(f"a tiling of unequal or empty lists: {self}")
        for name, width, low, high in zip(
            self.feature_names, self.widths, self.lows, self.highs, strict=True
        ):
            if not (0 < width < math.inf and -math.inf < low < high < math.inf):
                raise AgentError(f"{name}: no tiles of width {width} from {low} to {high}")

    @property
    def num_features(self) -> int:
        """How many state variables there are."""
        return len(self.feature_names)

    @property
    def num_tilings(self) -> int:
        """How many tilings lie over each state variable."""
        return NUM_TILINGS

    @property
    def num_tiles(self) -> int:
        """Tiles in a tiling: enough for every variable."""
        spans = (np.array(self.highs) - np.array(self.lows)) / np.array(self.widths)
        rounding = 1e-9  # 180 degrees are 18 tiles of 10 degrees, whatever the division gives
        return math.ceil(float(spans.max()) - rounding) + 1

    def weights_shape(self, num_actions: int) -> tuple[int, int, int, int]:
        """(num_actions, num_features, num_tiles, num_tilings)."""
        return num_actions, self.num_features, self.num_tiles, NUM_TILINGS


def default_width(feature: Feature, num_keepers: int, num_takers: int) -> float:
    """Width of a tile [m or rad], by kind alone."""
    return DEFAULT_WIDTHS[feature.kind]


def framework_width(feature: Feature, num_keepers: int, num_takers: int) -> float:
    """Width of a tile as UT Austin's framework computes it, integer divisions included.

    Some widths differ between ranks and between tasks: in 3v2, K3's distances have 3 m where K2's
    have 2 m, and T1's distance 2 m where T2's has 3 m. Kept to compare with, and as the case in
    which a transfer must copy by represented value. (With two keepers or one taker its formulas
    divide by zero; the rank then adds nothing.)
    """
    n, m, rank = num_keepers, num_takers, feature.rank
    if feature.kind in ("k1_keeper", "keeper_centre") and rank >= 2 and n > 2:
        return 2.0 + (rank - 2) // (n - 2)
    if feature.kind == "k1_taker" and m > 1:
        return 3.0 + math.trunc((rank - 2) / (m - 1))
    return DEFAULT_WIDTHS[feature.kind]


WIDTH_PROFILES: Final = {"default": default_width, "framework": framework_width}


def feature_range(feature: Feature, field_length: float, field_width: float) -> float:
    """The greatest value that a state variable takes on the field [m or rad]; the least is 0.

    Two players are at most the field's diagonal apart, and half of it from the centre; a keeper is
    hardly ever further than that from its nearest taker either.
    """
    diagonal = math.hypot(field_length, field_width)
    if feature.kind == "min_angle":
        return math.pi
    if feature.kind in ("keeper_centre", "taker_centre", "min_keeper_taker"):
        return diagonal / 2
    return diagonal


def make_tiling(
    role: Role,
    num_keepers: int,
    num_takers: int,
    field_length: float = 25.0,
    field_width: float = 25.0,
    profile: str = "default",
) -> Tiling:
    """The tiling of a role's state variables in a task.

    Args:
        role: whose state variables.
        num_keepers: keepers in the task.
        num_takers: takers in the task.
        field_length: [m]
        field_width: [m]
        profile: where the widths come from, a name in WIDTH_PROFILES.

    Raises:
        AgentError: no such profile.
    """
    if profile not in WIDTH_PROFILES:
        raise AgentError(f"tile widths {profile!r}: choose one of {', '.join(WIDTH_PROFILES)}")
    width = WIDTH_PROFILES[profile]
    listed = features(role, num_keepers, num_takers)
    return Tiling(
        feature_names=tuple(feature.name for feature in listed),
        widths=tuple(width(feature, num_keepers, num_takers) for feature in listed),
        lows=(0.0,) * len(listed),
        highs=tuple(feature_range(feature, field_length, field_width) for feature in listed),
    )


@compiled
def tile_cells(state, lows, widths, num_weights, cells):
    """The fine cell of every state variable.

    Args:
        state: (num_features,) values.
        lows: (num_features,) where each variable's range begins.
        widths: (num_features,) width of a tile.
        num_weights: weights per variable, num_tiles * 32.
        cells: (num_features,) int64, written: 0 .. num_weights - 32, where out-of-range values
            are put into the first or the last.

    Raises:
        ValueError: a value is NaN.
    """
    last = float(num_weights - NUM_TILINGS)
    for i in range(len(state)):
        cell = np.floor((state[i] - lows[i]) * NUM_TILINGS / widths[i])
        if cell != cell:
            raise ValueError("a state variable is NaN: no perception may hold one")
        cells[i] = int(min(max(cell, 0.0), last))


@compiled
def window_sum(window):
    """Sum of 32 neighbouring weights: eight sums side by side, then their sum."""
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = 0.0
    for k in range(0, NUM_TILINGS, 8):
        s0 += window[k]
        s1 += window[k + 1]
        s2 += window[k + 2]
        s3 += window[k + 3]
        s4 += window[k + 4]
        s5 += window[k + 5]
        s6 += window[k + 6]
        s7 += window[k + 7]
    return ((s0 + s4) + (s2 + s6)) + ((s1 + s5) + (s3 + s7))


@compiled
def action_values(weights, cells, values):
    """The value of every action.

    Args:
        weights: (num_actions, num_features, num_weights).
        cells: (num_features,) fine cells of the state.
        values: (num_actions,) written.
    """
    values[:] = 0.0
    for i in range(len(cells)):
        first, last = cells[i], cells[i] + NUM_TILINGS
        for action in range(len(values)):
            values[action] += window_sum(weights[action, i, first:last])


@compiled
def action_value(weights, cells):
    """The value of one action; (num_features, num_weights) weights, (num_features,) fine cells."""
    value = 0.0
    for i in range(len(cells)):
        value += window_sum(weights[i, cells[i] : cells[i] + NUM_TILINGS])
    return value


@compiled
def add_to_active(weights, cells, amount):
    """Add `amount` to the weight of every active tile.

    Args:
        weights: (num_features, num_weights) of one action.
        cells: (num_features,) fine cells of the state.
        amount: what to add to each.
    """
    for i in range(len(cells)):
        window = weights[i, cells[i] : cells[i] + NUM_TILINGS]
        for k in range(NUM_TILINGS):
            window[k] += amount


def state_cells(state: Sequence[float] | np.ndarray, tiling: Tiling) -> np.ndarray:
    """The fine cell of every state variable, (num_features,): `tile_cells` for people and tests.

    Raises:
        AgentError: not as many values as the tiling has, or a NaN.
    """
    values = np.asarray(state, dtype=np.float64)
    if values.shape != (tiling.num_features,) or np.isnan(values).any():
        raise AgentError(f"not a state of {tiling.num_features} numbers: {values}")
    cells = np.empty(tiling.num_features, dtype=np.int64)
    num_weights = tiling.num_tiles * NUM_TILINGS
    tile_cells(values, np.array(tiling.lows), np.array(tiling.widths), num_weights, cells)
    return cells
