"""What a node's process says of a command line that ROS does not understand."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[3] / "scripts"
PROGRAMS = {
    "simulator": ["simulator.py"],
    "keeper": ["keeper.py"],
    "recorder": ["record.py", "bag"],
    "replay": ["replay.py", "bag"],
    "transfer": ["transfer.py", "node"],
    "view": ["view.py", "--live"],
}


def run(program: str, *ros: str) -> "subprocess.CompletedProcess[str]":
    name, *arguments = PROGRAMS[program]
    command = [sys.executable, str(SCRIPTS / name), *arguments, "--ros-args", *ros]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_program_refuses_what_ros_does_not_understand_in_one_line(program: str) -> None:
    done = run(program, "--params-file", "/no/where.yaml")
    assert done.returncode == 1
    assert done.stderr == (
        f"{program}: not understood after --ros-args: Couldn't parse params file:"
        " '--params-file /no/where.yaml'. Error: Error opening YAML file\n"
    )


@pytest.mark.parametrize(
    ("ros", "named"),
    [
        (["--nonsense"], "['--nonsense']"),
        (["-p", "speed"], "'-p speed'"),
        (["-p", "speed:=["], "'-p speed:=['"),
        (["-r", "match:=a//b"], "'-r match:=a//b'"),
        (["--log-level", "loud"], "'--log-level loud'"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_the_line_names_the_argument(ros: list[str], named: str) -> None:
    done = run("simulator", *ros)
    assert done.returncode == 1
    assert done.stderr.startswith("simulator: not understood after --ros-args: ")
    assert named in done.stderr
    assert len(done.stderr.splitlines()) == 1


HANGS_AT_ITS_END = """
import time
import rclpy
from keepaway_sim.ros import running

running.LONGEST_EXIT = 0.2
rclpy.try_shutdown = lambda: time.sleep(3600)
print("all is told")
running.end_ros()
"""


def test_a_middleware_that_hangs_at_the_end_takes_nothing_with_it() -> None:
    done = subprocess.run(
        [sys.executable, "-c", HANGS_AT_ITS_END], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stdout == "all is told\n"
    assert "in end_ros" in done.stderr


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_a_program_without_a_terminal_ends_well(closed: str) -> None:
    program = "from keepaway_sim.ros.running import end_ros; end_ros()"
    command = f'"{sys.executable}" -c "{program}" {closed}'
    assert subprocess.run(command, shell=True, check=False).returncode == 0
