"""The examples' small network: its gradients, and what it learns where the answer is known."""

import numpy as np
from small_network import NetworkConfig, QNetworks, gradients, values_of


def test_gradients_are_those_of_finite_differences() -> None:
    rng = np.random.default_rng(0)
    networks = QNetworks(2, 3, 2, rng, NetworkConfig(hidden=5))
    layers = [layer.astype(np.float64) for layer in networks.layers]
    states, wanted = rng.normal(size=(2, 7, 3)), rng.normal(size=(2, 7, 2))

    def loss() -> float:
        return float(0.5 * np.sum((values_of(layers, states)[-1] - wanted) ** 2))

    outputs = values_of(layers, states)
    slopes = gradients(layers, outputs, outputs[-1] - wanted)
    for layer, slope in zip(layers, slopes, strict=True):
        place = tuple(rng.integers(size) for size in layer.shape)
        before, step = layer[place], 1e-6
        layer[place] = before + step
        above = loss()
        layer[place] = before - step
        np.testing.assert_allclose((above - loss()) / (2 * step), slope[place], rtol=1e-4)
        layer[place] = before


def test_each_network_learns_its_own_task() -> None:
    """Learner k is paid for choice k; the values become what is paid."""
    config = NetworkConfig(hidden=8, learn_after=32, learning_rate=5e-3, copy_every=50)
    networks = QNetworks(2, 2, 2, np.random.default_rng(1), config)
    states, everybody = np.ones((2, 2)), np.ones(2, dtype=np.bool_)
    for _ in range(2000):
        actions = networks.choose(states, epsilon=0.5)
        paid = (actions == np.arange(2)).astype(np.float64)
        networks.learn(everybody, states, actions, paid, np.zeros(2), states)
    np.testing.assert_allclose(
        values_of(networks.layers, states[:, None])[-1][:, 0], np.eye(2), atol=0.1
    )
