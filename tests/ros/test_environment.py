"""The environment that scripts/setup makes: messages go over DDS, and stay on this machine."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest
import rclpy
from ament_index_python import get_package_share_path
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from keepaway_msgs.msg import Perception

ROOT = Path(__file__).resolve().parents[2]
LAST = 1000
READER = f"""
import rclpy
from keepaway_msgs.msg import Perception
rclpy.init()
node, heard = rclpy.create_node("reader"), []
node.create_subscription(Perception, "perception", lambda said: heard.append(said.cycle), 200)
while {LAST} not in heard:
    rclpy.spin_once(node)
print("heard {LAST}", flush=True)
"""


def test_tests_of_nodes_share_one_worker(request: pytest.FixtureRequest) -> None:
    if os.environ.get("PYTEST_XDIST_WORKER") and getattr(request.config.option, "loadgroup", False):
        assert request.node.nodeid.endswith("@ros")  # which xdist adds where it keeps to groups


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
    names = ["ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE"]
    program = f"import os, rclpy; print(*map(os.environ.get, {names}))"
    bare = {"HOME": str(tmp_path), "PATH": os.defpath}
    said = subprocess.run(
        [sys.executable, "-c", program], env=bare, capture_output=True, text=True, check=True
    )
    assert said.stdout == f"LOCALHOST {ROOT / 'src/keepaway_sim/fastdds.xml'}\n"


def test_writers_repeat_what_there_is_twenty_times_a_second() -> None:
    """By default every 3 s: so long a reader that lost the last message would wait for it."""
    assert period("heartbeatPeriod") == 0.05


def test_processes_announce_themselves_twice_a_second() -> None:
    """By default every 3 s: so long two would wait that missed each other's first words."""
    assert period("leaseAnnouncement") == 0.5


def period(name: str) -> float:
    """A period of our profiles for Fast DDS [s]."""
    profiles = ElementTree.parse(ROOT / "src/keepaway_sim/fastdds.xml").getroot()
    found = profiles.find(f".//{{*}}{name}")
    assert found is not None
    parts = {part.tag.rpartition("}")[2]: int(part.text or "") for part in found}
    assert parts.keys() == {"sec", "nanosec"}
    return parts["sec"] + parts["nanosec"] / 1e9


def test_what_a_slow_reader_lost_it_has_in_the_end(ros_domain: int) -> None:
    """A reader is frozen while more is said than its queue holds, so that the end is lost."""
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    node = rclpy.create_node("writer", context=context)
    publisher = node.create_publisher(Perception, "perception", 200)
    environment = {**os.environ, "ROS_DOMAIN_ID": str(ros_domain)}
    reader = subprocess.Popen(
        [sys.executable, "-c", READER], env=environment, stdout=subprocess.PIPE, text=True
    )
    assert reader.stdout is not None
    try:
        while not publisher.get_subscription_count():
            time.sleep(0.05)
        publisher.publish(Perception())
        time.sleep(1.0)
        reader.send_signal(signal.SIGSTOP)
        for cycle in range(1, LAST + 1):
            publisher.publish(Perception(cycle=cycle))
        reader.send_signal(signal.SIGCONT)
        assert reader.stdout.readline() == f"heard {LAST}\n"
    finally:
        reader.kill()
        reader.communicate()
        node.destroy_node()
        context.shutdown()
