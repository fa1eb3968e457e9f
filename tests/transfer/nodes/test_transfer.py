"""The transfer node: weights of a larger task on demand, and refusals in words."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graph import Graph, weights_of

from keepaway_agent.learning.weights import load_weights, save_weights
from keepaway_msgs.srv import ApplyRho
from keepaway_transfer.mapping import rho_mapping
from keepaway_transfer.nodes.transfer import TransferNode
from keepaway_transfer.rho import Transfer, transferred


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "keeper_1.npz"
    save_weights(path, weights_of())
    return path


@pytest.fixture
def ask(graph: Graph, source: Path) -> Callable[..., Any]:
    """Call the node's service, by default for rho from the source to 4v3."""
    folder = ["--ros-args", "-p", f"weights_dir:={source.parent}"]
    graph.add(TransferNode(context=graph.context, cli_args=folder, use_global_arguments=False))

    def call(**request: object) -> Any:
        wish = {"source_path": str(source), "target_task": "4v3", **request}
        return graph.call(ApplyRho, "transfer/apply", **wish)

    return call


@pytest.mark.parametrize(
    "variant", ["rho", "rho_modified", "shuffled", "rho_shape@5", "optimistic"]
)
def test_it_writes_what_rho_gives(ask: Callable[..., Any], source: Path, variant: str) -> None:
    done = ask(variant=variant, seed=3)
    assert done.success, done.message
    expected = transferred(load_weights(source), Transfer("4v3", variant, seed=3))
    written = load_weights(Path(done.target_path))
    np.testing.assert_array_equal(written.values, expected.values)
    assert (written.task, written.episodes) == ("4v3", 100)


def test_paths_and_variant_may_be_left_to_it(ask: Callable[..., Any], source: Path) -> None:
    assert ask().target_path == str(source.with_name("keeper_1_4v3.npz"))


def test_a_mapping_of_ones_own_is_used(
    ask: Callable[..., Any], source: Path, tmp_path: Path
) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text(
        rho_mapping("3v2", "4v3").to_toml().replace('pass_k4 = "pass_k3"', 'pass_k4 = "hold"')
    )
    done = ask(mapping_path=str(mine), target_path=str(tmp_path / "out.npz"))
    assert done.success, done.message
    values = load_weights(tmp_path / "out.npz").values
    np.testing.assert_array_equal(values[3], values[0])


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        ({"source_path": "none.npz"}, "/none.npz cannot be read"),
        ({"source_path": "/none.npz"}, "/none.npz is not in "),
        ({"target_task": "four"}, "task='four'"),
        ({"target_task": "2v1"}, "fewer players"),
        ({"variant": "sigma"}, "variant='sigma'"),
        ({"mapping_path": "/none.toml"}, "none.toml"),
        ({"mapping_path": "/none.toml"}, "/none.toml is not in "),
        ({"target_path": "../x.npz"}, "set weights_dir to a folder above it"),
    ],
)
def test_it_refuses_in_words(ask: Callable[..., Any], request_: dict[str, str], why: str) -> None:
    done = ask(**request_)
    assert not done.success
    assert why in done.message


def test_it_does_not_write_over_a_file(ask: Callable[..., Any], source: Path) -> None:
    before = source.read_bytes()
    done = ask(target_path=str(source))
    assert not done.success
    assert "is there already" in done.message
    assert source.read_bytes() == before
