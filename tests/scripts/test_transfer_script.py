"""`scripts/transfer.py` as a person calls it."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from keepaway_agent.actions import Role
from keepaway_agent.learning.cmac import make_tiling
from keepaway_agent.learning.weights import LearnedWeights, load_weights, save_weights
from keepaway_transfer.rho import Transfer, transferred

SCRIPT = Path(__file__).parents[2] / "scripts/transfer.py"


def transfer(*arguments):
    return subprocess.run(
        [sys.executable, SCRIPT, *map(str, arguments)], capture_output=True, text=True, check=False
    )


@pytest.fixture
def keeper(tmp_path):
    tiling = make_tiling(Role.KEEPER, 3, 2)
    values = np.random.default_rng(0).normal(size=tiling.weights_shape(3))
    path = tmp_path / "keeper_1.npz"
    save_weights(path, LearnedWeights(values, Role.KEEPER, 3, 2, 25.0, 25.0, tiling))
    return path


def test_a_chain_writes_the_weights_of_its_last_task(keeper, tmp_path):
    out = tmp_path / "start.npz"
    done = transfer("apply", keeper, "4v3", "5v4", "--variant", "rescaled", "--out", out)
    assert done.stdout == f"3v2 -> 4v3 -> 5v4 by rescaled: {out}\n"
    middle = transferred(load_weights(keeper), Transfer("4v3", "rescaled"))
    expected = transferred(middle, Transfer("5v4", "rescaled"))
    written = load_weights(out)
    np.testing.assert_array_equal(written.values, expected.values)
    assert written.created_by.startswith("scripts/transfer.py apply")


def test_a_printed_mapping_is_one_that_can_be_used(keeper, tmp_path):
    own = tmp_path / "mine.toml"
    own.write_text(transfer("mapping", "3v2", "4v3", "--variant", "partial").stdout)
    out = tmp_path / "start.npz"
    transfer("apply", keeper, "4v3", "--mapping", own, "--out", out)
    expected = transferred(load_weights(keeper), Transfer("4v3", "partial"))
    np.testing.assert_array_equal(load_weights(out).values, expected.values)


def test_a_file_in_the_way_is_refused_in_one_line(keeper):
    done = transfer("apply", keeper, "4v3", "--out", keeper)
    assert done.returncode == 1
    assert done.stderr.startswith("transfer: ")
    assert "overwrite" in done.stderr


def test_a_level_is_set_behind_the_variants_name(keeper, tmp_path):
    out = tmp_path / "start.npz"
    transfer("apply", keeper, "4v3", "--variant", "optimistic@5", "--out", out)
    (weight,) = np.unique(load_weights(out).values)
    assert weight * 19 * 32 / 10 == pytest.approx(5.0)  # all active tiles, in seconds


def test_only_the_node_takes_arguments_of_ros(keeper, tmp_path):
    done = transfer(
        "apply", keeper, "4v3", "--out", tmp_path / "start.npz", "--ros-args", "-p", "x"
    )
    assert done.returncode == 2
    assert done.stderr.endswith("unrecognized arguments: --ros-args -p x\n")
    done = transfer("node", "--ros-args", "--nonsense")
    assert done.returncode == 1
    assert done.stderr.startswith("transfer: not understood after --ros-args: ")
    assert "--nonsense" in done.stderr
