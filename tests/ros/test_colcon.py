"""The tree builds with colcon, as people with an ordinary ROS 2 build it, and is whole there."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
import rclpy
from rclpy.context import Context
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.wait_for_message import wait_for_message

from keepaway_msgs.msg import Match

pytestmark = pytest.mark.xdist_group("colcon")  # mostly a compiler that runs

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
EXECUTABLES = {
    "keepaway_sim": {"simulator", "recorder", "replayer"},
    "keepaway_agent": {"keeper", "taker"},
    "keepaway_transfer": {"transfer"},
}


class Workspace(NamedTuple):
    """A folder that colcon has built into."""

    install: Path

    def shell(self, command: str) -> list[str]:
        """A command as `ros2 run` would start it: after the workspace's set-up script."""
        return ["bash", "-c", f"source {self.install}/setup.bash && exec {command}"]


@pytest.fixture(scope="module")
def workspace(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """The tree built against the wheels; an ordinary ROS 2 needs no arguments for CMake."""
    folder = tmp_path_factory.mktemp("colcon")
    arguments: list[str | Path] = [
        *("--log-base", folder / "log", "build", "--executor", "sequential"),
        *("--base-paths", root, "--build-base", folder / "build"),
        *("--install-base", folder / "install"),
        "--cmake-args",
        f"-DCMAKE_PROJECT_INCLUDE={root}/msgs/cmake/wheel_prefix.cmake",
        f"-DPython3_EXECUTABLE={sys.executable}",
    ]
    wheels = {"CMAKE_PREFIX_PATH": sys.prefix, "AMENT_PREFIX_PATH": sys.prefix}
    built = subprocess.run(
        [sys.executable, "-m", "colcon", *arguments],
        env=os.environ | wheels,
        cwd=folder,
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    return Workspace(folder / "install")


@pytest.mark.parametrize("package", EXECUTABLES)
def test_ros2_run_finds_every_node(workspace: Workspace, package: str) -> None:
    folder = workspace.install / package / "lib" / package
    assert {path.name for path in folder.iterdir()} == EXECUTABLES[package]


@pytest.mark.parametrize("package", EXECUTABLES)
def test_every_file_of_a_package_is_installed(
    workspace: Workspace, root: Path, package: str
) -> None:
    source = root / "src" / package / package
    (installed,) = (workspace.install / package).glob(f"lib/python*/site-packages/{package}")

    def files(folder: Path) -> set[Path]:
        found = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
        return {path for path in found if "__pycache__" not in path.parts}

    assert files(installed) == files(source)


def test_ros2_launch_finds_the_match(workspace: Workspace) -> None:
    share = workspace.install / "keepaway_transfer" / "share" / "keepaway_transfer"
    assert (share / "launch" / "match.launch.py").is_file()


@pytest.mark.parametrize("package", ["keepaway_msgs", *EXECUTABLES])
def test_package_is_indexed_and_imported_from_the_workspace(
    workspace: Workspace, package: str
) -> None:
    program = (
        f"import {package}, ament_index_python as index;"
        f"print({package}.__file__, index.get_package_prefix('{package}'))"
    )
    command = workspace.shell(f'{sys.executable} -c "{program}"')
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    imported, prefix = said.split()
    assert Path(imported).is_relative_to(workspace.install)
    assert Path(prefix) == workspace.install / package


def test_simulator_runs_from_the_workspace_until_it_is_interrupted(
    workspace: Workspace, ros_domain: int
) -> None:
    executable = workspace.install / "keepaway_sim" / "lib" / "keepaway_sim" / "simulator"
    simulator = subprocess.Popen(workspace.shell(f"{executable} --ros-args -p task:=4v3"))
    try:
        match = first_match(ros_domain)
    finally:
        simulator.send_signal(signal.SIGINT)
        returned = simulator.wait(timeout=900)
    assert (match.num_keepers, match.num_takers) == (4, 3)
    assert returned == 0


def first_match(domain: int) -> Match:
    """The match that somebody in this domain says is played."""
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("spectator", context=context)
    arrived, match = wait_for_message(Match, node, "match", qos_profile=LATCHED, time_to_wait=240)
    node.destroy_node()
    context.shutdown()
    assert arrived, "no match within four minutes, in which machine code is made"
    return match
