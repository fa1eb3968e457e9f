"""`scripts/graph.py` as a person calls it, beside a node with a topic and a service."""

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger

SCRIPT = Path(__file__).resolve().parents[2] / "scripts/graph.py"


def graph(domain: int, *options: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, str(SCRIPT), "--domain", str(domain), *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture
def domain(ros_domain: int) -> Iterator[int]:
    """A domain with a node that publishes something latched and offers a service."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain)
    node = rclpy.create_node("there", context=context)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_publisher(String, "words", latched).publish(String(data="so it is"))
    node.create_service(Trigger, "ask", lambda _, response: response)
    executor = rclpy.executors.SingleThreadedExecutor(context=context)
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()
    yield ros_domain
    executor.shutdown()
    context.shutdown()


def test_it_shows_nodes_topics_and_services(domain: int) -> None:
    done = graph(domain)
    assert done.returncode == 0, done.stderr
    lines = [line.strip() for line in done.stdout.splitlines()]
    assert "/there" in lines
    assert "/words  std_msgs/msg/String  1 -> 0" in lines
    assert "/ask  std_srvs/srv/Trigger" in lines
    assert not any("/rosout" in line for line in lines)


def test_it_prints_what_is_latched(domain: int) -> None:
    done = graph(domain, "--topic", "/words")
    assert (done.returncode, done.stderr) == (0, "")
    assert "so it is" in done.stdout


def test_a_topic_that_nobody_publishes_is_refused_in_a_line(ros_domain: int) -> None:
    done = graph(ros_domain, "--topic", "/words")
    assert done.returncode == 1
    assert done.stderr == "graph: no node publishes /words\n"
