"""Compiled Sarsa(lambda) agrees with a slow, obvious one on random episodes.

In the slow one every tile is a key of a dictionary, and every trace decays at every step.
"""

from collections import defaultdict

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from keepaway_agent.learning import sarsa
from keepaway_agent.learning.cmac import NUM_TILINGS, Tiling
from keepaway_agent.learning.config import SarsaConfig
from keepaway_agent.learning.sarsa import make_learners, tiles_of

PLANE = Tiling(("x", "y"), (2.0, 0.5), (0.0, 0.0), (10.0, 3.0))

Tile = tuple[int, int, int, int]  # action, variable, tiling, tile


class ReferenceSarsa:
    """One learner, as a textbook would write it down."""

    def __init__(self, num_actions: int, tiling: Tiling, config: SarsaConfig) -> None:
        self.num_actions, self.tiling, self.config = num_actions, tiling, config
        self.weights: dict[Tile, float] = defaultdict(float)
        self.traces: dict[Tile, float] = {}
        self.action: int | None = None
        self.q_tm1 = 0.0

    def tiles(self, state: np.ndarray, action: int) -> set[Tile]:
        """The active tiles."""
        active = set()
        for variable, x in enumerate(state):
            width, low = self.tiling.widths[variable], self.tiling.lows[variable]
            cell = int(np.floor((x - low) * NUM_TILINGS / width))
            cell = min(max(cell, 0), (self.tiling.num_tiles - 1) * NUM_TILINGS)
            for tiling in range(NUM_TILINGS):
                tile = (cell + NUM_TILINGS - 1 - tiling) // NUM_TILINGS
                active.add((action, variable, tiling, tile))
        return active

    def value(self, state: np.ndarray, action: int) -> float:
        return sum(self.weights[tile] for tile in self.tiles(state, action))

    def start(self, state: np.ndarray, uniforms: np.ndarray) -> int:
        self.traces = {}
        action = self._choose(state, uniforms)
        return self._remember(state, action, self.value(state, action))

    def step(self, r_t: float, discount_t: float, state: np.ndarray, uniforms: np.ndarray) -> int:
        action = self._choose(state, uniforms)
        q_t = self.value(state, action)
        self._learn(r_t + discount_t * q_t - self.q_tm1)
        decay = discount_t * self.config.lambda_
        self.traces = {tile: decay * trace for tile, trace in self.traces.items()}
        if self.config.lambda_ > 0:
            limit = self.config.min_trace
            self.traces = {tile: trace for tile, trace in self.traces.items() if trace >= limit}
        return self._remember(state, action, self.value(state, action))

    def end(self, r_t: float) -> None:
        if self.action is not None:
            self._learn(r_t - self.q_tm1)
        self.traces, self.action = {}, None

    def _choose(self, state: np.ndarray, uniforms: np.ndarray) -> int:
        explore, which, tie = uniforms
        if explore < self.config.epsilon:
            return int(which * self.num_actions)
        values = [self.value(state, action) for action in range(self.num_actions)]
        best = [action for action, value in enumerate(values) if value == max(values)]
        return best[int(tie * len(best))]

    def _learn(self, delta: float) -> None:
        step_size = self.config.alpha / (self.tiling.num_features * NUM_TILINGS)
        for tile, trace in self.traces.items():
            self.weights[tile] += step_size * delta * trace

    def _remember(self, state: np.ndarray, action: int, value: float) -> int:
        for other in range(self.num_actions):
            for tile in self.tiles(state, other):
                self.traces[tile] = 1.0 if other == action else 0.0
        self.action, self.q_tm1 = action, value
        return action

    def dense_weights(self) -> np.ndarray:
        """(num_actions, num_features, num_tiles, num_tilings)."""
        weights = np.zeros(self.tiling.weights_shape(self.num_actions))
        for (action, variable, tiling, tile), weight in self.weights.items():
            weights[action, variable, tile, tiling] = weight
        return weights


def play(seed, num_steps=60):
    """Random episodes as (state, uniforms, reward of the step before, whether it ends after)."""
    rng = np.random.default_rng(seed)
    state = rng.uniform(PLANE.lows, PLANE.highs)
    for _ in range(num_steps):
        state = np.clip(state + rng.normal(0, 0.3, len(state)), -0.5, np.array(PLANE.highs) + 0.5)
        yield state, rng.random(3), float(rng.integers(1, 20)), rng.random() < 0.05


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    lambda_=st.sampled_from([0.0, 0.3, 0.9, 1.0]),
    gamma=st.sampled_from([1.0, 0.95]),
    min_trace=st.sampled_from([0.0, 0.01]),
)
def test_random_episodes_agree_with_the_textbook(seed, lambda_, gamma, min_trace):
    config = SarsaConfig(lambda_=lambda_, gamma=gamma, epsilon=0.2, min_trace=min_trace)
    textbook = ReferenceSarsa(3, PLANE, config)
    me = make_learners(1, 3, PLANE, config)
    for state, uniforms, reward, ends in play(seed):
        me.state[0] = state
        if textbook.action is None:
            expected = textbook.start(state, uniforms)
            action = sarsa.start(me, 0, uniforms)
        else:
            discount = gamma ** int(reward)
            expected = textbook.step(reward, discount, state, uniforms)
            action = sarsa.step(me, 0, reward, discount, uniforms)
        assert action == expected
        if ends:
            textbook.end(reward)
            sarsa.end(me, 0, reward)
    np.testing.assert_allclose(tiles_of(me, 0), textbook.dense_weights(), rtol=1e-9, atol=1e-12)
