"""What transferred weights carry, in three parts that add up: level, shape and preferences.

Let w(a, i, j) be the weight of action a, state variable i and tile j, and n the number of state
variables. In every state 32 tiles of each variable are active, and an action's value is their sum::

    Q(s, a) = sum over i, and over the 32 tiles j active in s, of w(a, i, j)

Let L be the mean of Q(s, a) over all actions and over a sample of states that is fixed for each
task, let c = L / (32 n), and let m(i, j) be the mean of w(a, i, j) over the actions. Every weight
is then the sum of three::

    w(a, i, j) = c  +  (m(i, j) - c)  +  (w(a, i, j) - m(i, j))
                level      shape              preferences

and because Q is linear in the weights, so is every value the sum of three values: the level L, the
same in every state for every action; the shape, which differs between states, is the same for all
actions and has the mean 0 over the sample; and the preferences, which tell actions apart and sum to
0 over them in every state.

The sample (`scripts/checks/reference_states.py`) is of states in which keepers have a choice when
they choose at random. A mean over tiles is no stand-in for it: tiles that were hardly ever seen
count there as much as others, and it comes out far below the values that are met in play.

Weights are worth cycles, levels are given in seconds.

>>> from keepaway_agent.learning.cmac import make_tiling
>>> from keepaway_agent.actions import Role
>>> tiling = make_tiling(Role.KEEPER, 2, 1)
>>> weights = np.zeros(tiling.weights_shape(2))
>>> weights[0], weights[1] = 1.0, 3.0
>>> sample = sample_of("2v1", tiling)
>>> round(level_of(weights, sample), 9)  # 7 variables, 32 tiles of each at 2 cycles: 448
44.8
>>> kept(weights, sample, ("preferences",))[:, 0, 0, 0].tolist()
[-1.0, 1.0]
>>> kept(weights, sample, ("preferences",), level=44.8)[:, 0, 0, 0].round(9).tolist()
[1.0, 3.0]
"""

from collections.abc import Collection
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from keepaway_agent.learning.cmac import NUM_TILINGS, Tiling, state_cells
from keepaway_sim.world.config import CYCLE_TIME
from keepaway_transfer.errors import MappingError

PARTS = ("level", "shape", "preferences")
STATES_FILE = Path(__file__).with_name("reference_states.npz")

WeightsArray = NDArray[np.float64]
Sample = NDArray[np.int64]  # (num_states, num_features), the fine cells of the sample's states


class Split(NamedTuple):
    """The three parts of some weights; by broadcasting they add up to them."""

    level: float
    shape: WeightsArray  # (1, num_features, num_tiles, num_tilings)
    preferences: WeightsArray  # (num_actions, num_features, num_tiles, num_tilings)


@cache
def sample_of(task: str, tiling: Tiling) -> Sample:
    """The sample of states of a task, in a keeper's tiling of it.

    The states are of 25 m x 25 m; on another field they are taken as they are.

    Raises:
        MappingError: no states of this task were drawn.
    """
    with np.load(STATES_FILE) as drawn:
        if task not in drawn:
            raise MappingError(
                f"no reference states of {task}, which a level is a mean over: there are those of"
                f" {', '.join(drawn)}"
            )
        return np.array([state_cells(state, tiling) for state in drawn[task]])


@cache
def has_sample(task: str) -> bool:
    """Were states of this task drawn?"""
    with np.load(STATES_FILE) as drawn:
        return task in drawn


def split(weights: WeightsArray, sample: Sample) -> Split:
    """The three parts of weights, (num_actions, num_features, num_tiles, num_tilings)."""
    level = _mean_weight(weights, sample)
    over_actions = weights.mean(axis=0, keepdims=True)
    return Split(level, over_actions - level, weights - over_actions)


def kept(
    weights: WeightsArray, sample: Sample, parts: Collection[str], level: float | None = None
) -> WeightsArray:
    """The weights with some of their parts only.

    Args:
        weights: (num_actions, num_features, num_tiles, num_tilings).
        sample: that the level is a mean over.
        parts: names of PARTS.
        level: [s] instead of the weights' own, whether or not that is among the parts.
    """
    if set(parts) == set(PARTS) and level is None:
        return weights
    found = split(weights, sample)
    constant = found.level if "level" in parts else 0.0
    if level is not None:
        constant = weight_of(level, weights.shape[1])
    result = np.full(weights.shape, constant)
    if "shape" in parts:
        result += found.shape
    if "preferences" in parts:
        result += found.preferences
    return result


def scaled(weights: WeightsArray, sample: Sample, level: float) -> WeightsArray:
    """The weights times the number that brings their level to this one [s].

    Weights without a level of their own become constant.
    """
    own, asked = _mean_weight(weights, sample), weight_of(level, weights.shape[1])
    return weights * (asked / own) if own else np.full(weights.shape, asked)


def level_of(weights: WeightsArray, sample: Sample) -> float:
    """What an action is worth on average [s]: the value that the level alone gives it."""
    return float(_mean_weight(weights, sample) * NUM_TILINGS * weights.shape[1] * CYCLE_TIME)


def weight_of(level: float, num_features: int) -> float:
    """The weight that, in every tile, values every action at this level [s]."""
    return level / CYCLE_TIME / (NUM_TILINGS * num_features)


def _mean_weight(weights: WeightsArray, sample: Sample) -> float:
    """The mean weight of all tiles that are active in the sample."""
    flat = weights.mean(axis=0).reshape(weights.shape[1], -1)
    sums = np.pad(np.cumsum(flat, axis=1), ((0, 0), (1, 0)))
    variables = np.arange(weights.shape[1])
    windows = sums[variables, sample + NUM_TILINGS] - sums[variables, sample]
    return float(windows.mean() / NUM_TILINGS)
