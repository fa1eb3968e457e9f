"""The transfer node: applies rho to a weights file when it is asked to.

Its service `transfer/apply` reports in words why it refuses: a missing file, weights of a player or
task that the mapping is not from, an unknown variant, a file that is there already, a path that is
not in `weights_dir`.
"""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from keepaway_agent.errors import AgentError
from keepaway_agent.files import path_within
from keepaway_agent.learning.weights import load_weights, save_weights
from keepaway_agent.texts import one_line
from keepaway_msgs.srv import ApplyRho
from keepaway_sim.errors import KeepawayError
from keepaway_sim.ros.parameters import declare_settings, warn_of_unknown
from keepaway_sim.ros.running import run_node
from keepaway_sim.settings import setting
from keepaway_transfer.mapping import load_mapping
from keepaway_transfer.rho import Transfer, transferred

SPIN_TIMEOUT = 0.25  # [s] at most, from the signal to the end


@attrs.frozen
class TransferSettings:
    """The transfer node's parameters."""

    weights_dir: str = setting(
        ".", "folder in which its service may read and write files, and nowhere else"
    )


class TransferNode(Node):
    """Answers `transfer/apply` (keepaway_msgs/ApplyRho)."""

    def __init__(self, **node_options: Any) -> None:
        """Offer the service; `node_options` are for `rclpy.node.Node`."""
        super().__init__("transfer", **node_options)
        self._folder = Path(declare_settings(self, TransferSettings).weights_dir)
        warn_of_unknown(self, (TransferSettings,))
        self.create_service(ApplyRho, f"{self.get_name()}/apply", self._on_apply)

    def _on_apply(
        self, request: ApplyRho.Request, response: ApplyRho.Response
    ) -> ApplyRho.Response:
        try:
            response.message, response.target_path = apply(request, self._folder)
            response.success = True
            self.get_logger().info(response.message)
        except (AgentError, KeepawayError, OSError) as error:
            response.message = str(error)
            self.get_logger().warning(f"refused: {error}")
        return response


def apply(request: ApplyRho.Request, folder: Path) -> tuple[str, str]:
    """Do what a request asks for, with files in a folder.

    Returns:
        what was done, in words, and the path of the file that was written.

    Raises:
        AgentError, KeepawayError, OSError: why it cannot be done.
    """
    source = path_within(folder, request.source_path)
    mapping = None
    if request.mapping_path:
        mapping = load_mapping(str(path_within(folder, request.mapping_path)))
    variant = request.variant or "rho"
    known = load_weights(source)
    settings = Transfer(request.target_task, variant, mapping, request.seed)
    carried = dataclasses.replace(
        transferred(known, settings), created_by=one_line(f"transfer node: {variant} of {source}")
    )
    beside = source.with_stem(f"{source.stem}_{carried.task}")
    target = path_within(folder, request.target_path or str(beside))
    save_weights(target, carried)
    by = request.mapping_path or variant
    return f"{known.task} -> {carried.task} by {by}: {target}", str(target)


def main(args: list[str] | None = None) -> None:
    """Serve until a signal asks it to end (SIGINT, SIGTERM).

    Raises:
        SystemExit: it cannot serve.
    """
    run_node("transfer", _serve, (TransferSettings,), KeepawayError, args)


def _serve(must_end: Callable[[], bool]) -> None:
    executor = SingleThreadedExecutor()
    executor.add_node(TransferNode())
    while not must_end():
        executor.spin_once(timeout_sec=SPIN_TIMEOUT)


if __name__ == "__main__":
    main()
