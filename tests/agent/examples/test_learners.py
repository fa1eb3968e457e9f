"""The examples' learners and planner: what they share with the product, and that they learn."""

import numpy as np
import pytest
from planner import Args as PlannerArgs
from planner import Planner, hand_coded
from self_play import Args, evaluate, learn
from small_network import NetworkConfig, QNetworks

from keepaway_agent.environments import KeeperEnv
from keepaway_agent.playing.policies import hand_coded_keeper


def test_the_planners_hand_coded_keeper_is_the_products() -> None:
    rng = np.random.default_rng(0)
    for n, m in ((3, 2), (4, 3), (5, 4)):
        states = rng.uniform(0, 12, (200, 4 * n + 2 * m - 3))
        states[:, 1 - n :] = rng.uniform(0, np.pi, (200, n - 1))
        wanted = [hand_coded_keeper(state, n) for state in states]
        assert hand_coded(states, n).tolist() == wanted
        assert len(set(wanted)) == n


def test_a_plan_leaves_the_present_alone_and_holds_while_nobody_is_near() -> None:
    env = KeeperEnv()
    seen, _ = env.reset(seed=1)
    planner = Planner(PlannerArgs(rollouts=2, horizon=5), 3)
    before = env.get_state().field.world.rows
    seen[3] = 1.0  # dist_k1_t1
    assert planner.choose(env, seen) in (0, 1, 2)
    for row, after in zip(before, env.get_state().field.world.rows, strict=True):
        np.testing.assert_array_equal(row, after)
    seen[3] = 20.0
    assert planner.choose(env, seen) == 0


def test_two_teams_learn_against_each_other_and_are_evaluated() -> None:
    args = Args(task="2v1", hours=0.02, episodes=2)
    teams, durations = learn(args)
    assert durations.sum() >= 0.02 * 36_000
    assert (durations > 0).all()
    for chosen in (teams, {"keeper": teams["keeper"]}, {"taker": teams["taker"]}):
        assert (evaluate(args, chosen) > 0).all()


def test_jax_values_and_steps_are_those_of_the_small_network() -> None:
    """With equal weights, the same values; after the same batch, the same change to a hair."""
    jax_network = pytest.importorskip("jax_network")
    config, rng = NetworkConfig(hidden=6), np.random.default_rng(0)
    ours = QNetworks(2, 3, 2, np.random.default_rng(1), config)
    theirs = jax_network.JaxQNetworks(2, 3, 2, np.random.default_rng(1), config)
    theirs._params = [(ours.layers[k].copy(), ours.layers[k + 1][:, 0].copy()) for k in (0, 2, 4)]
    theirs.copy_target()
    batch = (
        rng.normal(size=(2, 8, 3)).astype(np.float32),
        rng.integers(2, size=(2, 8)),
        rng.normal(size=(2, 8)).astype(np.float32),
        rng.uniform(size=(2, 8)).astype(np.float32),
        rng.normal(size=(2, 8, 3)).astype(np.float32),
    )
    states = rng.normal(size=(2, 3)).astype(np.float32)
    np.testing.assert_allclose(theirs.values(states), ours.values(states), rtol=1e-4, atol=1e-6)
    for _ in range(3):
        ours.train(*batch)
        theirs.train(*batch)
    np.testing.assert_allclose(theirs.values(states), ours.values(states), rtol=1e-2, atol=1e-4)
