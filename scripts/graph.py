"""Show nodes, topics and services of the ROS graph, as it is now.

    .venv/bin/python scripts/graph.py
    .venv/bin/python scripts/graph.py --domain 7 --topic /keeper_1/perception --count 3

What `ros2 node list`, `ros2 topic list` and `ros2 topic echo` show, which no wheel brings along.
"""

import argparse
import os
import sys
import time

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from keepaway_sim.errors import KeepawayError
from keepaway_sim.ros.running import end_ros
from keepaway_sim.ros.subscribing import message_class

HIDDEN = ("/parameter_events", "/rosout")
OWN_SERVICES = ("rcl_interfaces/", "type_description_interfaces/")  # every node has these


def main() -> int:
    """Look for a while, then print."""
    args = parse()
    if args.domain is not None:
        os.environ["ROS_DOMAIN_ID"] = str(args.domain)
    rclpy.init(args=[])
    node = Node("graph_inspector", start_parameter_services=False, enable_rosout=False)
    try:
        discover(node, args.wait)
        if args.topic:
            return echo(node, f"/{args.topic.lstrip('/')}", args.count)
        print_graph(node, args.all)
    except KeyboardInterrupt:
        pass
    except KeepawayError as error:
        print(f"graph: {error}", file=sys.stderr)
        return 1
    finally:
        end_ros()
    return 0


def discover(node: Node, quiet: float) -> None:
    """Wait until nothing new has turned up for `quiet` seconds."""
    found, since = -1, time.monotonic()
    while time.monotonic() - since < quiet:
        names, topics = node.get_node_names_and_namespaces(), node.get_topic_names_and_types()
        ends = sum(node.count_publishers(t) + node.count_subscribers(t) for t, _ in topics)
        if len(names) + ends != found:
            found, since = len(names) + ends, time.monotonic()
        time.sleep(0.1)


def print_graph(node: Node, show_all: bool) -> None:
    """Nodes; topics with their types and the number of publishers and subscribers; services."""
    own = node.get_fully_qualified_name()
    found = [f"{space.rstrip('/')}/{name}" for name, space in node.get_node_names_and_namespaces()]
    if not (others := sorted(name for name in found if name != own)):
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        print(f"no node in ROS domain {domain}: is a match running, or in another one (--domain)?")
        return
    print("Nodes", *(f"  {name}" for name in others), sep="\n")
    print("Topics, publishers -> subscribers")
    for topic, types in sorted(node.get_topic_names_and_types()):
        if show_all or topic not in HIDDEN:
            publishers, subscribers = node.count_publishers(topic), node.count_subscribers(topic)
            print(f"  {topic}  {', '.join(types)}  {publishers} -> {subscribers}")
    print("Services")
    for service, types in sorted(node.get_service_names_and_types()):
        if show_all or not types[0].startswith(OWN_SERVICES):
            print(f"  {service}  {', '.join(types)}")


def echo(node: Node, topic: str, count: int) -> int:
    """Print a topic's next messages, or its latched one."""
    types = dict(node.get_topic_names_and_types()).get(topic)
    publishers = node.get_publishers_info_by_topic(topic)
    if not types or not publishers:
        print(f"graph: no node publishes {topic}", file=sys.stderr)
        return 1
    latched = publishers[0].qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    qos = QoSProfile(
        depth=10,
        reliability=ReliabilityPolicy.RELIABLE if latched else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
    heard: list[object] = []
    node.create_subscription(message_class(types[0]), topic, heard.append, qos)
    while count > 0:
        rclpy.spin_once(node, timeout_sec=0.2)
        while heard and count > 0:
            print(heard.pop(0))
            count -= 1
    return 0


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--domain", type=int, help="ROS domain (default: the environment's)")
    parser.add_argument(
        "--wait", type=float, default=3.5, help="until no new node has come for this time [s]"
    )
    parser.add_argument("--all", action="store_true", help="what every node has, too")
    parser.add_argument("--topic", help="print what is published on this topic instead")
    parser.add_argument("--count", type=int, default=1, help="messages to print (default 1)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
