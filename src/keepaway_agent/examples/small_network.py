"""Small neural networks for Q-learning, in numpy alone: many at once, one for each learner.

Double Q-learning with replay and a slow copy (Mnih et al. 2015; van Hasselt et al. 2016), for
decisions that take different numbers of cycles: a choice's target is what it was paid plus
`discount` times the value of the choice after it. Layers are arrays with a leading axis of
learners, so that `matmul` trains all of them together.
"""

import itertools
from dataclasses import dataclass

import numpy as np

Layers = list[np.ndarray]
"""Weights and biases, alternately: (num_learners, num_in, num_out), (num_learners, 1, num_out)."""


@dataclass(frozen=True)
class NetworkConfig:
    """How the networks learn."""

    hidden: int = 48  # units in each of two layers
    learning_rate: float = 5e-4  # of Adam
    memory: int = 20_000  # choices to replay
    batch: int = 32  # choices a training step
    train_every: int = 4  # choices between two training steps
    copy_every: int = 1000  # choices between two copies for the targets
    learn_after: int = 1000  # choices before the first training step


class Replay:
    """The last choices of `num_learners` learners, and what they led to; a ring for each."""

    def __init__(self, num_learners: int, num_inputs: int, size: int) -> None:
        """Nothing is remembered yet."""
        shape, self._size = (num_learners, size), size
        self._rings: tuple[np.ndarray, ...] = (
            np.zeros((*shape, num_inputs), np.float32),  # states
            np.zeros(shape, np.int64),  # actions
            np.zeros(shape, np.float32),  # rewards
            np.zeros(shape, np.float32),  # discounts
            np.zeros((*shape, num_inputs), np.float32),  # next states
        )
        self._rows = np.arange(num_learners)
        self.num_stored = np.zeros(num_learners, np.int64)

    def store(self, who: np.ndarray, *choice: np.ndarray) -> None:
        """Remember a choice of each of (num_learners,) bool `who`; see `QNetworks.learn`."""
        rows = np.flatnonzero(who)
        at = self.num_stored[rows] % self._size
        for ring, new in zip(self._rings, choice, strict=True):
            ring[rows, at] = new[rows]
        self.num_stored[rows] += 1

    def sample(self, rng: np.random.Generator, batch: int) -> list[np.ndarray]:
        """Choices drawn evenly, (num_learners, batch, ..): what `store` was given, in order."""
        filled = np.minimum(self.num_stored, self._size)
        picked = (rng.random((len(self._rows), batch)) * filled[:, None]).astype(np.int64)
        return [ring[self._rows[:, None], picked] for ring in self._rings]


class QNetworks:
    """`num_learners` networks that value `num_actions` choices in a state, and what they remember.

    They are fed in step: choice by choice, all of them together.
    """

    def __init__(
        self,
        num_learners: int,
        num_inputs: int,
        num_actions: int,
        rng: np.random.Generator,
        config: NetworkConfig | None = None,
    ) -> None:
        """Networks that know nothing."""
        self.config = config or NetworkConfig()
        sizes = [num_inputs, self.config.hidden, self.config.hidden, num_actions]
        self.layers: Layers = []
        for a, b in itertools.pairwise(sizes):
            scale = np.sqrt(2 / a) if b != num_actions else 0.01
            self.layers.append(rng.normal(0, scale, (num_learners, a, b)).astype(np.float32))
            self.layers.append(np.zeros((num_learners, 1, b), np.float32))
        self._target = [layer.copy() for layer in self.layers]
        self._moments = [(np.zeros_like(layer), np.zeros_like(layer)) for layer in self.layers]
        self._rng, self._num_learners, self._num_updates = rng, num_learners, 0
        self._replay = Replay(num_learners, num_inputs, self.config.memory)
        self._num_choices = 0

    def values(self, states: np.ndarray) -> np.ndarray:
        """(num_learners, num_actions) in (num_learners, num_inputs) states."""
        return values_of(self.layers, states[:, None, :])[-1][:, 0]

    def choose(self, states: np.ndarray, epsilon: float) -> np.ndarray:
        """Choices (num_learners,) in (num_learners, num_inputs) states, some of them at random."""
        values = self.values(states)
        explores = self._rng.random(self._num_learners) < epsilon
        any_action = self._rng.integers(values.shape[1], size=self._num_learners)
        return np.where(explores, any_action, values.argmax(axis=1))

    def learn(
        self,
        who: np.ndarray,
        states: np.ndarray,
        actions: np.ndarray,
        rewards: np.ndarray,
        discounts: np.ndarray,
        next_states: np.ndarray,
    ) -> None:
        """Remember what choices led to, and train now and then.

        Args:
            who: (num_learners,) bool, whose choices these are; the others had none.
            states, actions: what was seen and chosen.
            rewards: since then.
            discounts: of what comes after; 0 at an episode's end.
            next_states: seen now.
        """
        self._replay.store(who, states, actions, rewards, discounts, next_states)
        self._num_choices += 1
        if self._replay.num_stored.min() < self.config.learn_after:
            return
        if self._num_choices % self.config.train_every == 0:
            self.train(*self._replay.sample(self._rng, self.config.batch))
        if self._num_choices % self.config.copy_every == 0:
            self.copy_target()

    def copy_target(self) -> None:
        """Let the slow copy catch up."""
        self._target = [layer.copy() for layer in self.layers]

    def train(
        self,
        states: np.ndarray,
        actions: np.ndarray,
        rewards: np.ndarray,
        discounts: np.ndarray,
        next_states: np.ndarray,
    ) -> None:
        """A step of training on (num_learners, batch, ..) remembered choices."""
        best = values_of(self.layers, next_states)[-1].argmax(axis=2)[..., None]
        after = np.take_along_axis(values_of(self._target, next_states)[-1], best, axis=2)[..., 0]
        goals = rewards + discounts * after
        outputs = values_of(self.layers, states)
        actions = actions[..., None]
        error = np.take_along_axis(outputs[-1], actions, axis=2)[..., 0] - goals
        slope = np.zeros_like(outputs[-1])
        share = np.clip(error, -1, 1)[..., None] / self.config.batch
        np.put_along_axis(slope, actions, share, axis=2)
        self._descend(gradients(self.layers, outputs, slope))

    def _descend(self, slopes: Layers) -> None:
        """A step of Adam (Kingma & Ba 2015)."""
        self._num_updates += 1
        rate = self.config.learning_rate * np.sqrt(1 - 0.999**self._num_updates)
        rate /= 1 - 0.9**self._num_updates
        for layer, slope, (first, second) in zip(self.layers, slopes, self._moments, strict=True):
            first += 0.1 * (slope - first)
            second += 0.001 * (slope * slope - second)
            layer -= rate * first / (np.sqrt(second) + 1e-8)


def values_of(layers: Layers, states: np.ndarray) -> list[np.ndarray]:
    """Every layer's outputs for (num_learners, n, num_inputs) states; the last are the values."""
    outputs = [states]
    for i in range(0, len(layers), 2):
        output = outputs[-1] @ layers[i] + layers[i + 1]
        outputs.append(np.maximum(output, 0) if i + 2 < len(layers) else output)
    return outputs


def gradients(layers: Layers, outputs: list[np.ndarray], slope: np.ndarray) -> Layers:
    """Of a loss with this slope in the values, for every one of `layers`."""
    slopes: Layers = []
    for i in range(len(layers) - 2, -1, -2):
        inputs = outputs[i // 2]
        slopes[:0] = [inputs.swapaxes(1, 2) @ slope, slope.sum(axis=1, keepdims=True)]
        slope = (slope @ layers[i].swapaxes(1, 2)) * (inputs > 0)
    return slopes
