"""Who can reach a match: what the middleware's settings really keep out."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

SHARED_MEMORY = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
    "FASTDDS_BUILTIN_TRANSPORTS": "SHM",
}
HERE, THERE = "10.99.0.1", "10.99.0.2"
NODE = """
import sys, time, rclpy
from keepaway_msgs.msg import Episode
rclpy.init()
node, heard = rclpy.create_node(sys.argv[1]), []
if sys.argv[1] == "listener":
    node.create_subscription(Episode, "episode", heard.append, 10)
else:
    publisher = node.create_publisher(Episode, "episode", 10)
    node.create_timer(0.05, lambda: publisher.publish(Episode()))
until = time.monotonic() + float(sys.argv[2])
while time.monotonic() < until and not heard:
    rclpy.spin_once(node, timeout_sec=0.1)
print(len(heard))
"""
SOCKETS = """
import os, rclpy
from pathlib import Path
rclpy.init()
node = rclpy.create_node("node")
links = [os.readlink(each) for each in Path("/proc/self/fd").iterdir() if each.is_symlink()]
own = {link[8:-1] for link in links if link.startswith("socket:")}
for kind in ("udp", "udp6", "tcp", "tcp6"):
    for line in Path(f"/proc/self/net/{kind}").read_text().splitlines()[1:]:
        if line.split()[9] in own:
            print(kind, line.split()[1])
"""


def command(program: str, *arguments: str) -> list[str]:
    return [sys.executable, "-c", program, *arguments]


def test_asked_for_dds_security_these_wheels_refuse_and_do_not_play_openly(
    tmp_path: Path, ros_domain: int
) -> None:
    enclave = tmp_path / "enclaves" / "player"
    enclave.mkdir(parents=True)
    for name in ("identity_ca.cert", "cert", "key", "permissions_ca.cert"):
        (enclave / f"{name}.pem").write_text("")
    for name in ("governance", "permissions"):
        (enclave / f"{name}.p7s").write_text("")
    asked = {
        "ROS_SECURITY_ENABLE": "true",
        "ROS_SECURITY_STRATEGY": "Enforce",
        "ROS_SECURITY_KEYSTORE": str(tmp_path),
    }
    program = "from keepaway_agent.nodes.keeper import main; main()"
    player = command(program, "--ros-args", "--enclave", "/player")
    done = subprocess.run(player, env={**os.environ, **asked}, capture_output=True, text=True)
    assert done.returncode != 0
    assert "doesn't have the security libraries" in done.stderr


def test_over_shared_memory_alone_a_node_has_no_socket(ros_domain: int) -> None:
    def sockets(settings: dict[str, str]) -> str:
        env = {**os.environ, **settings}
        return subprocess.run(
            command(SOCKETS), env=env, capture_output=True, text=True, check=True
        ).stdout

    assert "udp" in sockets({})
    assert sockets(SHARED_MEMORY) == ""


@pytest.fixture
def two_machines() -> Iterator[tuple[str, str]]:
    """Two network namespaces with a cable between them."""
    if os.geteuid() != 0 or not shutil.which("ip"):
        pytest.skip("network namespaces need root and iproute2")
    here, there = f"keepaway-{os.getpid()}-a", f"keepaway-{os.getpid()}-b"
    lines = [
        f"netns add {here}",
        f"netns add {there}",
        f"link add cable netns {here} type veth peer name cable netns {there}",
        *(f"-n {name} link set {link} up" for name in (here, there) for link in ("lo", "cable")),
        f"-n {here} addr add {HERE}/24 dev cable",
        f"-n {there} addr add {THERE}/24 dev cable",
    ]
    try:
        for line in lines:
            done = subprocess.run(["ip", *line.split()], capture_output=True, text=True)
            if done.returncode:
                pytest.skip(f"no network namespaces here: {done.stderr}")
        yield here, there
    finally:
        for name in (here, there):
            subprocess.run(["ip", "netns", "del", name], capture_output=True)


@pytest.mark.parametrize(
    ("settings", "peer", "is_reached"),
    [
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, "", True),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, "", False),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, HERE, True),  # the middleware's own gap
        (SHARED_MEMORY, HERE, False),
    ],
    ids=["subnet", "localhost", "localhost, called by its address", "shared memory"],
)
def test_a_stranger_on_another_machine_reaches_a_node_only_where_said(
    two_machines: tuple[str, str],
    ros_domain: int,
    settings: dict[str, str],
    peer: str,
    is_reached: bool,
) -> None:
    here, there = (["ip", "netns", "exec", name] for name in two_machines)
    seconds = "20" if is_reached else "5"
    outside = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_STATIC_PEERS": peer}
    stranger = subprocess.Popen(
        [*there, *command(NODE, "stranger", "60")],
        env={**os.environ, **outside},
        stdout=subprocess.DEVNULL,
    )
    listener = subprocess.run(
        [*here, *command(NODE, "listener", seconds)],
        env={**os.environ, **settings},
        capture_output=True,
        text=True,
        check=True,
    )
    stranger.kill()
    stranger.wait()
    assert (int(listener.stdout) > 0) == is_reached
