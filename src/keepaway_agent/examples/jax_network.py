"""The small network with a well-kept library: gradients by JAX, Adam and Huber loss by Optax.

Chosen because both are kept by large teams, run on a CPU without a GPU's libraries, and together
weigh 90 MB (PyTorch: 2 GB). They are an extra (`pip install "keepaway[learners]"`); nothing of the
product needs them. The learner is double Q-learning with replay as in `small_network.py`, written
as JAX asks for it: pure functions, mapped over learners by `vmap` and compiled by `jit`.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from small_network import NetworkConfig, QNetworks

Params = list[tuple[jax.Array, jax.Array]]
"""Weights and biases of each layer; with a leading axis of learners."""


def init(key: jax.Array, sizes: tuple[int, ...]) -> Params:
    """One learner's first weights (He et al. 2015)."""
    keys = jax.random.split(key, len(sizes) - 1)
    return [
        (jax.random.normal(k, (a, b)) * (2 / a) ** 0.5, jnp.zeros(b))
        for k, a, b in zip(keys, sizes[:-1], sizes[1:], strict=True)
    ]


def values(params: Params, states: jax.Array) -> jax.Array:
    """(.., num_actions) values in (.., num_inputs) states."""
    for weights, bias in params[:-1]:
        states = jax.nn.relu(states @ weights + bias)
    weights, bias = params[-1]
    return states @ weights + bias


def loss(params: Params, target: Params, batch: tuple[jax.Array, ...]) -> jax.Array:
    """Of double Q-learning (van Hasselt et al. 2016) on one learner's choices."""
    states, actions, rewards, discounts, next_states = batch
    best = values(params, next_states).argmax(axis=-1)
    after = jnp.take_along_axis(values(target, next_states), best[:, None], axis=-1)[:, 0]
    q_tm1 = jnp.take_along_axis(values(params, states), actions[:, None], axis=-1)[:, 0]
    goals = jax.lax.stop_gradient(rewards + discounts * after)
    error: jax.Array = optax.losses.huber_loss(q_tm1, goals)
    return error.mean()


class JaxQNetworks(QNetworks):
    """`QNetworks` whose networks are JAX's and whose optimizer is Optax's."""

    def __init__(
        self,
        num_learners: int,
        num_inputs: int,
        num_actions: int,
        rng: np.random.Generator,
        config: NetworkConfig | None = None,
    ) -> None:
        """Networks that know nothing."""
        super().__init__(num_learners, num_inputs, num_actions, rng, config)
        sizes = (num_inputs, self.config.hidden, self.config.hidden, num_actions)
        keys = jax.random.split(jax.random.key(int(rng.integers(2**31))), num_learners)
        self._params = jax.vmap(partial(init, sizes=sizes))(keys)
        self._slow = self._params
        self._optimizer = optax.adam(self.config.learning_rate)
        self._momentum = jax.vmap(self._optimizer.init)(self._params)
        self._values = jax.jit(jax.vmap(values))
        self._update = jax.jit(jax.vmap(self._update_one))

    def _update_one(
        self, params: Params, target: Params, momentum: Any, batch: tuple[jax.Array, ...]
    ) -> tuple[Params, Any]:
        slopes = jax.grad(loss)(params, target, batch)
        changes, momentum = self._optimizer.update(slopes, momentum)
        return optax.apply_updates(params, changes), momentum

    def values(self, states: np.ndarray) -> np.ndarray:
        """(num_learners, num_actions) in (num_learners, num_inputs) states."""
        return np.asarray(self._values(self._params, states))

    def copy_target(self) -> None:
        """Let the slow copy catch up; JAX's arrays never change, so it is the same one."""
        self._slow = self._params

    def train(self, *batch: np.ndarray) -> None:
        """A step of training on (num_learners, batch, ..) remembered choices."""
        self._params, self._momentum = self._update(self._params, self._slow, self._momentum, batch)
