"""Two matches launched side by side with ROS's own `launch`, each in a namespace; end both.

    .venv/bin/python scripts/checks/two_launches.py               # where `ros2` is on the PATH
    .venv/bin/python scripts/checks/two_launches.py --tools DIR   # tools installed into DIR

What must hold, else the script ends with code 1: a match is played in both; each has its clock, and
there is no other; Ctrl-C ends every process of the first with exit code 0; a simulator that has
played all its episodes ends the launch of the second, with exit code 0; a wrong value is refused by
the argument's name. `ros_tools.py --help` says where the tools come from.
"""

from __future__ import annotations

import argparse
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from ros_tools import PATIENCE, ToolsError, environment, running, shell, wait_for_players
from ros_tools_page import PLAYERS

LAUNCH = "ros2 launch keepaway_transfer match.launch.py"
FIRST = f"exec {LAUNCH} namespace:=/a speed:=1"
SECOND = f"exec {LAUNCH} namespace:=/b episodes:=40 speed:=0"
NODES = ("simulator", *PLAYERS)
WRONG = {"speed": "fast", "task": "three", "profile": "1999", "params_file": "/none.yaml"}


def main() -> int:
    """Try it; say what was seen."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tools", type=Path, metavar="DIR", help="prefix that the tools are in")
    args = parser.parse_args()
    try:
        with environment(args.tools) as env, tempfile.TemporaryDirectory() as folder:
            check_refusals(Path(folder), env)
            check_matches(Path(folder), env)
    except ToolsError as error:
        print(f"two_launches: {error}", file=sys.stderr)
        return 1
    return 0


def check_refusals(folder: Path, env: Mapping[str, str]) -> None:
    """Wrong values end the launch with code 1 and the argument's name."""
    for name, value in WRONG.items():
        done = shell(f"{LAUNCH} {name}:={value}", folder, env)
        if done.returncode != 1 or name not in done.stdout or "Traceback" in done.stdout:
            raise ToolsError(f"{name}:={value}: code {done.returncode}:\n{done.stdout}")
    print(f"refused by name: {', '.join(f'{name}:={value}' for name, value in WRONG.items())}")


def check_matches(folder: Path, env: Mapping[str, str]) -> None:
    """Two matches, each with its own clock, each with its own end."""
    logs = {name: folder / f"{name}.txt" for name in "ab"}
    with (
        running(FIRST, logs["a"], folder, env) as first,
        running(SECOND, logs["b"], folder, env) as second,
    ):
        wait_for_players(env, folder, "/a")
        check_clocks(folder, env)
        ends_well(second, logs["b"], "all its episodes played")
        first.send_signal(signal.SIGINT)
        ends_well(first, logs["a"], "Ctrl-C")


def check_clocks(folder: Path, env: Mapping[str, str]) -> None:
    """Of the clocks there are those of the two matches only."""
    topics = shell("ros2 topic list", folder, env).stdout.splitlines()
    clocks = sorted(topic for topic in topics if topic.endswith("clock"))
    if clocks != ["/a/clock", "/b/clock"]:
        raise ToolsError(f"clocks: {', '.join(clocks)}")
    print(f"clocks: {', '.join(clocks)}")


def ends_well(launch: subprocess.Popen[bytes], log: Path, reason: str) -> None:
    """A launch ends with code 0, and so did each of its processes."""
    code = launch.wait(PATIENCE)
    text = log.read_text(encoding="utf-8")
    clean = {f"{program}" for program in re.findall(r"\[(\w+)-\d+\]: process has finished", text)}
    num = len(re.findall(r"process has finished cleanly", text))
    if code or num != len(NODES) or "process has died" in text or "Traceback" in text:
        raise ToolsError(f"{reason}: code {code}, {num} processes ended cleanly:\n{text}")
    print(f"{reason}: exit code 0, {num} processes ended cleanly ({', '.join(sorted(clean))})")


if __name__ == "__main__":
    sys.exit(main())
