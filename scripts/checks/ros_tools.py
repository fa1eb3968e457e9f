"""Try ROS's own command-line tools on a running match, and write the page of what they print.

    .venv/bin/python scripts/checks/ros_tools.py                      # where `ros2` is on the PATH
    .venv/bin/python scripts/checks/ros_tools.py --tools DIR          # tools installed into DIR
    .venv/bin/python scripts/checks/ros_tools.py --tools DIR --write  # the page

Every command of the page is run in order, and must end with its exit code and print what it is
expected to; the script ends with code 1 where one does not. The wheels of ROS have no `ros2`:
`--help` says how it is installed beside them.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from ros_tools_page import MATCH, SECTIONS, Step, page

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "src/keepaway_sim/docs/ros_tools.md"
PATIENCE = 120.0  # [s] for a command; the first start of a match compiles
INSTALLATION = """
An ordinary ROS 2 has the tools: source /opt/ros/jazzy/setup.bash. Beside the wheels of this
environment they are installed from their sources on GitHub, branch jazzy, into a folder outside
the checkout:
    ros2/ros2cli: ros2cli ros2node ros2topic ros2service ros2param ros2run ros2pkg ros2interface
    ros2/launch: launch launch_xml launch_yaml        ros2/launch_ros: launch_ros ros2launch
    ros2/rosidl_runtime_py                            osrf/osrf_pycommon
    .venv/bin/python -m pip install --no-deps --no-build-isolation --prefix DIR FOLDERS..
and ros2/rcl_interfaces: composition_interfaces, which launch_ros imports; it is built with a copy
of msgs/cmake and of msgs/pyproject.toml with its own name. To use them by hand:
    export PATH=DIR/bin:.venv/bin:$PATH AMENT_PREFIX_PATH=DIR:$AMENT_PREFIX_PATH
    export PYTHONPATH=$(echo DIR/lib/python3.*/site-packages) LD_LIBRARY_PATH=DIR/lib
"""


class ToolsError(Exception):
    """There are no tools, or a command did not do what it should."""


class Done(NamedTuple):
    """What a command did.

    Attributes:
        step: that was done.
        code: with which the command ended.
        text: that it printed.
    """

    step: Step
    code: int
    text: str

    def troubles(self) -> Iterator[str]:
        """Where that is not what was expected, in words."""
        if self.code != self.step.code:
            yield f"{self.step.command}: exit code {self.code}, not {self.step.code}:\n{self.text}"
        for wanted in self.step.prints:
            if not re.search(wanted, self.text, re.M):
                yield f"{self.step.command}: did not print {wanted!r}:\n{self.text}"

    def shortened(self) -> str:
        """The lines that the page shows."""
        lines = self.text.splitlines()
        cut = ["..."] if len(lines) > self.step.lines else []
        return "\n".join([*lines[: self.step.lines], *cut])


def main() -> int:
    """Run every command; print or write the page."""
    args = parse()
    try:
        with environment(args.tools) as env, tempfile.TemporaryDirectory() as folder:
            text = page(run_all(Path(folder), env))
    except ToolsError as error:
        print(f"ros_tools: {error}", file=sys.stderr)
        return 1
    if args.write:
        PAGE.write_text(text, encoding="utf-8")
    else:
        print(text, end="")
    return 0


def run_all(folder: Path, env: Mapping[str, str]) -> list[list[str]]:
    """What the page shows of each command, done while a match is running.

    Raises:
        ToolsError: a command ends or prints otherwise than expected.
    """
    log = folder / "match.txt"
    with running(f"exec {MATCH.command}", log, folder, env) as match:
        wait_for_players(env, folder)
        done = [[run(step, folder, env) for step in section.steps] for section in SECTIONS]
        match.send_signal(signal.SIGINT)
        code = match.wait(PATIENCE)
    done.insert(0, [Done(MATCH, code, tidy(log.read_text(encoding="utf-8"), folder))])
    troubles = [trouble for each in done for one in each for trouble in one.troubles()]
    if troubles:
        raise ToolsError("\n".join(troubles))
    return [[one.shortened() for one in each] for each in done]


@contextlib.contextmanager
def environment(tools: Path | None) -> Iterator[dict[str, str]]:
    """The environment variables with which `ros2` is found; the tools' daemon ends at the end.

    Raises:
        ToolsError: it is nowhere.
    """
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, "PYTHONUNBUFFERED": "1", "RCUTILS_COLORIZED_OUTPUT": "0"}
        if tools is not None:
            env |= with_tools(tools.absolute(), Path(folder))
        if shutil.which("ros2", path=env["PATH"]) is None:
            raise ToolsError(f"there is no `ros2`.{INSTALLATION}")
        try:
            yield env
        finally:
            subprocess.run(["ros2", "daemon", "stop"], env=env, capture_output=True, check=False)


def with_tools(tools: Path, folder: Path) -> dict[str, str]:
    """What is set for tools in a prefix; a program `ros2`, for this Python, is put into a folder.

    Raises:
        ToolsError: the prefix has none.
    """
    program = tools / "bin" / "ros2"
    packages = sorted(tools.glob("lib/python3*/site-packages"))
    if not program.is_file() or not packages:
        raise ToolsError(f"{tools} has no bin/ros2 or no lib/python3*/site-packages.{INSTALLATION}")
    start = folder / "ros2"
    start.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{program}" "$@"\n', encoding="utf-8")
    start.chmod(0o755)
    before = {
        "PATH": folder,
        "PYTHONPATH": packages[0],
        "LD_LIBRARY_PATH": tools / "lib",
        "AMENT_PREFIX_PATH": f"{Path(sys.prefix)}{os.pathsep}{tools}",
    }
    return {
        name: os.pathsep.join(filter(None, (str(first), os.environ.get(name))))
        for name, first in before.items()
    }


@contextlib.contextmanager
def running(
    command: str, log: Path, folder: Path, env: Mapping[str, str]
) -> Iterator[subprocess.Popen[bytes]]:
    """A command that runs beside others, in a session of its own, its output in a file."""
    with log.open("wb") as output:
        process = subprocess.Popen(
            ["bash", "-c", command],
            cwd=folder,
            env=env,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGTERM)
            process.wait(PATIENCE)


def wait_for_players(env: Mapping[str, str], folder: Path, namespace: str = "") -> None:
    """Wait until episodes are played.

    Raises:
        ToolsError: none is, for too long.
    """
    until = time.monotonic() + PATIENCE
    command = f"ros2 topic echo --once {namespace}/field_state keepaway_msgs/msg/FieldState"
    while time.monotonic() < until:
        if shell(command, folder, env, timeout=20.0).returncode == 0:
            return
    raise ToolsError(f"no match plays after {PATIENCE:.0f} s")


def shell(
    command: str, folder: Path, env: Mapping[str, str], timeout: float = PATIENCE
) -> subprocess.CompletedProcess[str]:
    """Run a command as a person does, in a folder; what takes too long is ended (code 143)."""
    log = folder / "output.txt"
    is_late = contextlib.suppress(subprocess.TimeoutExpired)
    with running(command, log, folder, env) as process, is_late:
        process.wait(timeout)
    return subprocess.CompletedProcess(command, process.wait(), log.read_text(encoding="utf-8"))


def run(step: Step, folder: Path, env: Mapping[str, str]) -> Done:
    """Do what a step says."""
    done = shell(step.command, folder, env)
    return Done(step, done.returncode, tidy(done.stdout, folder))


def tidy(text: str, folder: Path) -> str:
    """An output without what is only of this machine: colours, folders, what was killed."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", text)
    text = re.sub(r"^.*\[RTPS_TRANSPORT_SHM Error\].*\n", "", text, flags=re.M)
    for path, name in (
        (str(folder), "~/match"),
        (str(ROOT), "~/keepaway"),
        (str(Path.home()), "~"),
    ):
        text = text.replace(path, name)
    return text.strip("\n").rstrip()


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=f"{__doc__}{INSTALLATION}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--tools", type=Path, metavar="DIR", help="prefix that the tools are in")
    parser.add_argument("--write", action="store_true", help="write the page")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
