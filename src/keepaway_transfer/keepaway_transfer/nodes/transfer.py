"""The transfer node: applies rho to a weights file when it is asked to.

Its service `transfer/apply` reports in words why it refuses: a missing file, weights of a player or
task that the mapping is not from, an unknown variant, a file that is there already.
"""

import dataclasses
import signal
from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from keepaway_agent.errors import AgentError
from keepaway_agent.learning.weights import load_weights, save_weights
from keepaway_agent.texts import one_line
from keepaway_msgs.srv import ApplyRho
from keepaway_sim.errors import KeepawayError
from keepaway_transfer.mapping import load_mapping
from keepaway_transfer.rho import Transfer, transferred

SPIN_TIMEOUT = 0.25  # [s] at most, from being told to end to ending


class TransferNode(Node):
    """Answers `transfer/apply` (keepaway_msgs/ApplyRho)."""

    def __init__(self, **node_options: Any) -> None:
        """Offer the service; `node_options` are for `rclpy.node.Node`."""
        super().__init__("transfer", **node_options)
        self.create_service(ApplyRho, f"{self.get_name()}/apply", self._on_apply)

    def _on_apply(
        self, request: ApplyRho.Request, response: ApplyRho.Response
    ) -> ApplyRho.Response:
        try:
            response.message, response.target_path = apply(request)
            response.success = True
            self.get_logger().info(response.message)
        except (AgentError, KeepawayError, OSError) as error:
            response.message = str(error)
            self.get_logger().warning(f"refused: {error}")
        return response


def apply(request: ApplyRho.Request) -> tuple[str, str]:
    """Do what a request asks for.

    Returns:
        what was done, in words, and the path of the file that was written.

    Raises:
        AgentError, KeepawayError, OSError: why it cannot be done.
    """
    source = Path(request.source_path)
    mapping = load_mapping(request.mapping_path) if request.mapping_path else None
    variant = request.variant or "rho"
    known = load_weights(source)
    settings = Transfer(request.target_task, variant, mapping, request.seed)
    carried = dataclasses.replace(
        transferred(known, settings), created_by=one_line(f"transfer node: {variant} of {source}")
    )
    target = Path(request.target_path or source.with_stem(f"{source.stem}_{carried.task}"))
    save_weights(target, carried)
    by = request.mapping_path or variant
    return f"{known.task} -> {carried.task} by {by}: {target}", str(target)


def main(args: list[str] | None = None) -> None:
    """Serve until told to end (SIGINT, SIGTERM)."""
    told: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda signum, _: told.append(signum))
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor()
    executor.add_node(TransferNode())
    while not told:
        executor.spin_once(timeout_sec=SPIN_TIMEOUT)
    rclpy.try_shutdown()
