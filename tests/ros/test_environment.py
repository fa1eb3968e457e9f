"""The environment that scripts/setup makes: messages go over DDS, and stay on this machine."""

import os
import subprocess
import sys
from pathlib import Path

import rclpy
from ament_index_python import get_package_share_path
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from keepaway_msgs.msg import Perception


def test_a_perception_goes_over_dds_whole(ros_domain: int) -> None:
    sent = Perception(player_index=2, cycle=7, positions=[1.5, -2.5], ages=[Perception.NEVER])
    received: list[Perception] = []
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    node = rclpy.create_node("keeper_1", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    node.create_subscription(Perception, "perception", received.append, 1)
    publisher = node.create_publisher(Perception, "perception", 1)
    for _ in range(100):  # a first message may be lost
        publisher.publish(sent)
        executor.spin_once(timeout_sec=0.1)
        if received:
            break
    node.destroy_node()
    context.shutdown()
    assert received[:1] == [sent]


def test_the_index_knows_the_messages() -> None:
    assert (get_package_share_path("keepaway_msgs") / "msg" / "Perception.msg").is_file()


def test_python_alone_is_enough_to_find_ros(tmp_path: Path) -> None:
    names = ["ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTDDS_BUILTIN_TRANSPORTS"]
    program = f"import os, rclpy; print(*map(os.environ.get, {names}))"
    bare = {"HOME": str(tmp_path), "PATH": os.defpath}
    said = subprocess.run(
        [sys.executable, "-c", program], env=bare, capture_output=True, text=True, check=True
    )
    assert said.stdout == "LOCALHOST UDPv4\n"
