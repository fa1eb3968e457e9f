"""What `benchmark.py` measures over ROS: a ping-pong of messages, matches, and how they start."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

HERE = Path(__file__).resolve().parent
SCRIPTS = HERE.parent
DOMAIN = 93  # so that it receives no match


def measure_ros(args: argparse.Namespace) -> dict[str, float]:
    """Cycles a second (wall time) of a ping-pong of a match's messages, and of matches."""
    os.environ["ROS_DOMAIN_ID"] = str(DOMAIN)
    figures = {
        "ros_floor_cps": ping_pong(num_players=5, cycles=3000),
        "ros_overheard_cps": ping_pong(num_players=5, cycles=3000, is_overheard=True),
    }
    with tempfile.TemporaryDirectory() as folder:
        recorder = [sys.executable, str(SCRIPTS / "record.py"), str(Path(folder) / "recorded")]
        length = "--episodes", str(args.episodes)
        figures["ros_match_cps"] = match(*length)
        figures["ros_bag_cps"] = match(*length, "--record", str(Path(folder) / "bag"))
        beside = subprocess.Popen(recorder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            figures["ros_recorded_cps"] = match(*length)
        finally:
            beside.terminate()
            beside.wait(60)
        figures["ros_single_process_cps"] = match(*length, "--single-process")
    return figures


def match(*options: str) -> float:
    """Cycles a second of a lock-step match of learning keepers."""
    done = subprocess.run(match_command(*options), capture_output=True, text=True, check=True)
    return float(json.loads(done.stdout.splitlines()[-1])["cycles_per_second"])


def match_command(*options: str) -> list[str]:
    """A match of learning keepers."""
    command = [sys.executable, str(SCRIPTS / "match.py"), "--task", "3v2"]
    return [*command, "--keeper-policy", "learn", "--json", *options]


def ping_pong(num_players: int, cycles: int, is_overheard: bool = False) -> float:
    """Perceptions to as many processes, an answer from each, by the fastest sound method.

    Args:
        num_players: processes that answer.
        cycles: perceptions of each.
        is_overheard: by one more process, to which everything is sent, too, and which reads
            nothing: as much as the middleware alone costs of any recorder.

    Returns:
        cycles a second, by the wall's clock.
    """
    import rclpy
    from rclpy.experimental import EventsExecutor

    from keepaway_msgs.msg import ActionRequest, Perception

    code = f"import sys; sys.path.insert(0, {str(HERE)!r}); import benchmark_ros; benchmark_ros."
    calls = [f"echo({p})" for p in range(num_players)]
    calls += [f"overhear({num_players})"] * is_overheard
    players = [subprocess.Popen([sys.executable, "-c", code + call]) for call in calls]
    rclpy.init()
    node = rclpy.create_node("ping", enable_rosout=False, start_parameter_services=False)
    executor = EventsExecutor()
    executor.add_node(node)
    answered: set[int] = set()

    def take(answer: ActionRequest) -> None:
        answered.add(answer.player_index)

    pings = [node.create_publisher(Perception, f"bench_{p}/ping", 10) for p in range(num_players)]
    for p in range(num_players):
        node.create_subscription(ActionRequest, f"bench_{p}/pong", take, 10)
    message = perception(num_players)
    receivers = 1 + is_overheard
    while any(ping.get_subscription_count() < receivers for ping in pings):
        time.sleep(0.05)
    try:
        for cycle in range(-100, cycles):
            if cycle == 0:
                start = time.perf_counter()
            answered.clear()
            message.cycle = cycle + 100
            missing: Iterable[int] = range(num_players)
            while missing:
                for p in missing:
                    pings[p].publish(message)
                until = time.perf_counter() + 0.5
                while len(answered) < num_players and time.perf_counter() < until:
                    executor.spin_once(timeout_sec=0.5)
                missing = [p for p in range(num_players) if p not in answered]
                if ended := [player for player in players if player.poll() is not None]:
                    raise RuntimeError(f"a player ended with {ended[0].returncode}")
        return cycles / (time.perf_counter() - start)
    finally:
        for player in players:
            player.terminate()
            player.wait(30)
        node.destroy_node()
        rclpy.shutdown()


def perception(num_players: int):  # type: ignore[no-untyped-def]
    """A perception as long as a match's."""
    from keepaway_msgs.msg import Perception

    message = Perception()
    message.positions = [1.0] * (2 * num_players + 2)
    message.velocities = [0.1] * (2 * num_players + 2)
    message.ages = [1] * (num_players + 1)
    message.cycles_to_ball = [9] * num_players
    return message


def echo(player: int) -> None:
    """Answer every perception at once; the process of one player of `ping_pong`."""
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.experimental import EventsExecutor

    from keepaway_msgs.msg import ActionRequest, Perception

    rclpy.init()
    node = rclpy.create_node(f"pong_{player}", enable_rosout=False, start_parameter_services=False)
    executor = EventsExecutor()
    executor.add_node(node)
    answer = ActionRequest(player_index=player, action_values=[0.0, 0.0, 0.0])
    publisher = node.create_publisher(ActionRequest, f"bench_{player}/pong", 10)

    def reply(message: Perception) -> None:
        answer.cycle = message.cycle
        publisher.publish(answer)

    node.create_subscription(Perception, f"bench_{player}/ping", reply, 10)
    try:
        while rclpy.ok():
            executor.spin_once(timeout_sec=1.0)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


def overhear(num_players: int) -> None:
    """Receive what all of them send, and read none of it."""
    import rclpy

    from keepaway_msgs.msg import ActionRequest, Perception

    rclpy.init()
    node = rclpy.create_node("overhears", enable_rosout=False, start_parameter_services=False)
    for p in range(num_players):
        node.create_subscription(Perception, f"bench_{p}/ping", print, 10, raw=True)
        node.create_subscription(ActionRequest, f"bench_{p}/pong", print, 10, raw=True)
    while rclpy.ok():
        time.sleep(0.1)


def first_cycle() -> float:
    """Seconds from the start of `match.py` until its simulator reports that it begins."""
    os.environ["ROS_DOMAIN_ID"] = str(DOMAIN)
    from keepaway_sim.match.conductor import BEGINS

    command = match_command("--episodes", "1")
    subprocess.run(command, capture_output=True, check=True)  # compiles, if need be
    start = time.monotonic()
    with subprocess.Popen(
        [*command, "--verbose"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as running:
        assert running.stdout
        begun = [time.monotonic() for line in running.stdout if BEGINS in line]
    if running.returncode or not begun:
        raise RuntimeError(f"the match ended with {running.returncode}, begun: {bool(begun)}")
    return begun[0] - start
