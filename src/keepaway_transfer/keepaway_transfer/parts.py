"""What transferred weights carry, in three parts that add up: level, shape and preferences.

Let w(a, i, j) be the weight of action a, state variable i and tile j, and n the number of state
variables. In every state 32 tiles of each variable are active, and an action's value is their sum::

    Q(s, a) = sum over i, and over the 32 tiles j active in s, of w(a, i, j)

Let c be the mean of all weights that are not zero, and m(i, j) the mean of w(a, i, j) over the
actions. Every weight is then the sum of three::

    w(a, i, j) = c  +  (m(i, j) - c)  +  (w(a, i, j) - m(i, j))
                level      shape              preferences

and because Q is linear in the weights, so is every value the sum of three values: the level
32 n c, the same in every state for every action; the shape, which tells states apart and is the
same for all actions; and the preferences, which tell actions apart and sum to zero over them.

The mean is over weights that are not zero because only those were ever learned; it is also what
averaging puts in place of the others (Taylor, Stone & Liu 2007), so averaged weights have no shape
and no preferences where nothing was learned. It is a mean over tiles, not over the states of play:
tiles that were seldom seen count as much as others.

Weights are worth cycles, levels are given in seconds.

>>> weights = np.zeros((2, 1, 2, 32))
>>> weights[0], weights[1] = 1.0, 3.0
>>> level_of(weights)  # 32 weights of 2 are active on average: 64 cycles
6.4
>>> kept(weights, ("preferences",))[:, 0, 0, 0].tolist()
[-1.0, 1.0]
>>> kept(weights, ("preferences",), level=3.2)[:, 0, 0, 0].tolist()
[0.0, 2.0]
"""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from keepaway_agent.learning.cmac import NUM_TILINGS
from keepaway_sim.world.config import CYCLE_TIME

PARTS = ("level", "shape", "preferences")

Weights = NDArray[np.float64]


class Split(NamedTuple):
    """The three parts of some weights; by broadcasting they add up to them."""

    level: float
    shape: Weights  # (1, num_features, num_tiles, num_tilings)
    preferences: Weights  # (num_actions, num_features, num_tiles, num_tilings)


def split(weights: Weights) -> Split:
    """The three parts of weights, (num_actions, num_features, num_tiles, num_tilings)."""
    level = _mean_learned(weights)
    over_actions = weights.mean(axis=0, keepdims=True)
    return Split(level, over_actions - level, weights - over_actions)


def kept(weights: Weights, parts: Collection[str], level: float | None = None) -> Weights:
    """The weights with some of their parts only.

    Args:
        weights: (num_actions, num_features, num_tiles, num_tilings).
        parts: names of PARTS.
        level: [s] instead of the weights' own, whether or not that is among the parts.
    """
    if set(parts) == set(PARTS) and level is None:
        return weights
    found = split(weights)
    constant = found.level if "level" in parts else 0.0
    if level is not None:
        constant = weight_of(level, weights.shape[1])
    result = np.full(weights.shape, constant)
    if "shape" in parts:
        result += found.shape
    if "preferences" in parts:
        result += found.preferences
    return result


def scaled(weights: Weights, level: float) -> Weights:
    """The weights times the number that brings their level to this one [s].

    Weights without a level of their own become constant.
    """
    own, asked = _mean_learned(weights), weight_of(level, weights.shape[1])
    return weights * (asked / own) if own else np.full(weights.shape, asked)


def level_of(weights: Weights) -> float:
    """What an action is worth on average [s]: the value that the level alone gives it."""
    return float(_mean_learned(weights) * NUM_TILINGS * weights.shape[1] * CYCLE_TIME)


def weight_of(level: float, num_features: int) -> float:
    """The weight that, in every tile, values every action at this level [s]."""
    return level / CYCLE_TIME / (NUM_TILINGS * num_features)


def _mean_learned(weights: Weights) -> float:
    learned = weights[weights != 0]
    return float(learned.mean()) if learned.size else 0.0
