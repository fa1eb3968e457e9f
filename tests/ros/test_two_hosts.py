"""A match across two hosts: two network namespaces that share nothing but a cable between them."""

import json
import os
import subprocess
import sys
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
SMALLEST = ROOT / "src" / "keepaway_agent" / "examples" / "smallest_agent.py"
ADDRESSES = ("10.213.7.1", "10.213.7.2")


class Hosts(NamedTuple):
    """The names of two network namespaces."""

    near: str
    far: str


def ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True, timeout=900)


@pytest.fixture
def hosts() -> Iterator[Hosts]:
    tag = uuid.uuid4().hex[:6]
    made = Hosts(f"keepaway-{tag}-a", f"keepaway-{tag}-b")
    try:
        for name in made:
            ip("netns", "add", name)
    except (OSError, subprocess.CalledProcessError) as error:
        ip_says = getattr(error, "stderr", str(error))
        pytest.skip(f"no network namespaces here: {ip_says}")
    try:
        ends = f"ka{tag}a", f"ka{tag}b"
        ip("link", "add", ends[0], "type", "veth", "peer", "name", ends[1])
        for name, end, address in zip(made, ends, ADDRESSES, strict=True):
            ip("link", "set", end, "netns", name)
            ip("-n", name, "address", "add", f"{address}/24", "dev", end)
            ip("-n", name, "link", "set", end, "up")
            ip("-n", name, "link", "set", "lo", "up")
            ip("-n", name, "route", "add", "default", "dev", end)
        yield made
    finally:
        for name in made:
            ip("netns", "delete", name)


def on(host: str, command: list[str], env: dict[str, str]) -> "subprocess.Popen[str]":
    """Start a command on a host that has a shared memory of its own."""
    alone = 'mount -t tmpfs none /dev/shm && exec "$@"'
    return subprocess.Popen(
        ["ip", "netns", "exec", host, "sh", "-c", alone, "sh", *command],
        env={**os.environ, "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4", **env},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("way", ["named", "multicast"])
def test_a_match_is_played_across_hosts(hosts: Hosts, ros_domain: int, way: str) -> None:
    """The takers play on the other host; the simulator and the keepers on this one."""
    near = far = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    if way == "named":
        near, far = ({"ROS_STATIC_PEERS": address} for address in reversed(ADDRESSES))
    takers = [
        on(hosts.far, [sys.executable, str(SMALLEST), "--ros-args", "-r", f"__node:={name}"], far)
        for name in ("taker_1", "taker_2")
    ]
    match = [sys.executable, str(ROOT / "scripts" / "match.py"), "--episodes", "2", "--json"]
    match += ["--keeper-agent", str(SMALLEST), "--elsewhere", "taker_1", "--elsewhere", "taker_2"]
    try:
        played = on(hosts.near, match, near)
        out, err = played.communicate(timeout=900)
        assert played.returncode == 0, err
        summary = json.loads(out.splitlines()[-1])
        assert len(summary["episode_cycles"]) == 2
        assert summary["troubles"] == {}
    finally:
        for taker in takers:
            taker.kill()
            taker.communicate(timeout=900)
