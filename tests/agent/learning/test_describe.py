"""Descriptions: what is said and drawn is what the weights give."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from keepaway_agent.actions import Role
from keepaway_agent.learning.cmac import NUM_TILINGS, action_values, make_tiling, state_cells
from keepaway_agent.learning.describe import (
    contributions,
    describe,
    draw_preferences,
    draw_values,
    preferences,
    scene,
    values_in,
)
from keepaway_agent.learning.features import nearest_to_ball
from keepaway_agent.learning.weights import LearnedWeights, save_weights

SCRIPT = Path(__file__).parents[3] / "scripts/describe.py"


def make_weights(
    num_keepers: int = 3, num_takers: int = 2, role: Role = Role.KEEPER
) -> LearnedWeights:
    tiling = make_tiling(role, num_keepers, num_takers)
    values = np.random.default_rng(2).normal(size=tiling.weights_shape(num_keepers))
    return LearnedWeights(
        values, role, num_keepers, num_takers, 25.0, 25.0, tiling, episodes=1500, player="keeper_1"
    )


def test_contributions_add_up_to_the_action_values():
    weights = make_weights()
    state = np.random.default_rng(0).uniform(weights.tiling.lows, weights.tiling.highs)
    cells, values = state_cells(state, weights.tiling), np.zeros(3)
    action_values(weights.values.reshape(3, 13, -1), cells, values)
    added = contributions(weights)
    assert added.shape == (3, 13, (weights.tiling.num_tiles - 1) * NUM_TILINGS + 1)
    np.testing.assert_allclose(sum(added[:, i, cells[i]] for i in range(13)), values, atol=1e-9)


def test_words_say_who_learned_what_and_how_much():
    said = describe(make_weights())
    assert said.startswith("keeper_1, a keeper in 3v2 on 25 m x 25 m\nlearned from 1,500 episodes")
    assert "min_ang_k3_t    10 deg     100%" in said
    assert len(said.splitlines()) == 8 + 13


@pytest.mark.parametrize(("num_keepers", "num_takers"), [(2, 1), (3, 2), (4, 3), (6, 5)])
def test_in_the_scene_k1_has_the_ball_and_k2_is_the_nearest_mate(num_keepers, num_takers):
    position = scene(make_weights(num_keepers, num_takers))
    assert nearest_to_ball(position, 0, num_keepers) == 0
    assert np.linalg.norm(position[0] - position[-1]) < 1.0
    distances = np.linalg.norm(position[1:num_keepers] - position[-1], axis=1)
    assert distances.argmin() == 0
    assert (np.abs(position) < 12.5).all()


@pytest.mark.parametrize("role", list(Role))
def test_preferences_are_the_greatest_values(role):
    weights = make_weights(role=role)
    x, y = np.meshgrid([-5.0, 0.0, 5.0], [-4.0, 4.0])
    shown = preferences(weights, x, y)
    position = scene(weights)
    for at in np.ndindex(x.shape):
        position[3] = x[at], y[at]
        values = np.sort(values_in(weights, position))
        assert values_in(weights, position)[shown.action[at]] == values[-1]
        assert shown.margin[at] == values[-1] - values[-2]


def test_untrained_weights_prefer_nothing():
    weights = make_weights()
    weights.values[:] = 0
    assert (preferences(weights, *np.meshgrid([0.0, 1.0], [0.0])).action == -1).all()


@pytest.mark.parametrize("role", list(Role))
@pytest.mark.parametrize("num_keepers", [2, 3, 9])
def test_every_state_variable_and_action_is_drawn(role, num_keepers, monkeypatch):
    monkeypatch.setattr("keepaway_agent.learning.describe.PLACES", 7)
    weights = make_weights(num_keepers, num_keepers - 1, role)
    panels = [axes for axes in draw_values(weights).axes if axes.axison]
    assert len(panels) == weights.tiling.num_features
    assert all(len(axes.lines) == num_keepers for axes in panels)
    assert len(draw_preferences(weights).axes) == 2


def test_the_script_describes_and_draws(tmp_path):
    path = tmp_path / "keeper_1.npz"
    save_weights(path, make_weights())
    command = [sys.executable, SCRIPT, path]
    done = subprocess.run(
        [*command, "--draw", tmp_path], capture_output=True, text=True, check=True
    )
    assert done.stdout == f"{path}: {describe(make_weights())}\n"
    pictures = [tmp_path / f"keeper_1_{what}.png" for what in ("values", "preferences")]
    assert all(picture.read_bytes().startswith(b"\x89PNG") for picture in pictures)
    said = subprocess.run([*command, "--json"], capture_output=True, text=True, check=True).stdout
    assert json.loads(said)["episodes"] == 1500
    refused = subprocess.run([*command[:2], SCRIPT], capture_output=True, text=True, check=False)
    assert refused.returncode == 1
    assert "not a whole weights file" in refused.stderr
