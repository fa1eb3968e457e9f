"""What rows of `robustness.py` are made of: commands, their expected ends, copies of the tree."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "src/keepaway_sim/docs/robustness.md"
BEGIN, END = "<!-- rows: written by scripts/checks/robustness.py -->\n", "<!-- end of rows -->\n"


class Row(NamedTuple):
    """A line of the table."""

    what: str  # was done
    happens: str
    check: Callable[[Path], None]  # in an empty folder; AssertionError if something else happens
    is_long: bool


ROWS: dict[str, Row] = {}


def row(what: str, happens: str, is_long: bool = False) -> Callable[..., Callable[[Path], None]]:
    """Make a check a row of the table, named as its function."""

    def add(check: Callable[[Path], None]) -> Callable[[Path], None]:
        ROWS[check.__name__] = Row(what, happens, check, is_long)
        return check

    return add


def passes(name: str, each: Row) -> bool:
    """Do a row; whether what it says happens."""
    start = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="robustness-") as folder:
        try:
            each.check(Path(folder))
        except AssertionError as error:
            print(f"{name}: FAILED: {error}", flush=True)
            return False
    print(f"{name}: {each.happens} ({time.monotonic() - start:.0f} s)", flush=True)
    return True


def with_table(text: str) -> str:
    """A page with the table of the rows as they are now between its marks."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    lines = ["| row | what was done | what happened |", "|---|---|---|"]
    for name, each in ROWS.items():
        long = " (`--long`)" if each.is_long else ""
        lines.append(f"| `{name}`{long} | {each.what} | {each.happens} |")
    return before + BEGIN + "\n" + "\n".join(lines) + "\n\n" + END + after


def shared_library(folder: Path, source: str) -> str:
    """A library that stands before the C library (LD_PRELOAD)."""
    text, made = folder / "preload.c", folder / "preload.so"
    text.write_text(source)
    compiler = ["cc", "-shared", "-fPIC", "-O1", "-o", str(made), str(text), "-ldl"]
    subprocess.run(compiler, check=True)
    return str(made)


def script(name: str, *arguments: object) -> list[str]:
    """The command of a script of this checkout."""
    return [sys.executable, str(ROOT / "scripts" / name), *map(str, arguments)]


def training(*arguments: object) -> list[str]:
    """The command of a training."""
    return script("train.py", *arguments)


def environment(**changes: str) -> dict[str, str]:
    """This process's environment with changes, in a domain of its own."""
    own = ("AMENT_PREFIX_PATH", "FASTRTPS_DEFAULT_PROFILES_FILE", "ROS_HOME")  # of this checkout
    kept = {name: value for name, value in os.environ.items() if name not in own}
    return {**kept, "ROS_DOMAIN_ID": "21", **changes}


def run(
    command: Sequence[str], cwd: str | None = None, **env: str
) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run(
        command, capture_output=True, text=True, check=False, env=environment(**env), cwd=cwd
    )


def expect_success(command: Sequence[str], cwd: str | None = None, **env: str) -> None:
    """Run a command; AssertionError with what it wrote if it fails."""
    done = run(command, cwd, **env)
    assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"


def expect_one_line(done: subprocess.CompletedProcess[str], words: str) -> None:
    """AssertionError unless a command was refused in one printable line with these words."""
    assert done.returncode == 1, done
    (line,) = done.stderr.splitlines() or [""]
    assert words in line, done.stderr
    assert line.isprintable(), ascii(line)


def expect_stopped(
    command: Sequence[str], number: int, times: int = 1, *, after: float | None = None
) -> list[str]:
    """Send a signal to a command that runs, and expect the exit code of that signal.

    Args:
        command: that is started.
        number: of the signal.
        times: that it is sent, 50 ms apart.
        after: the start [s]; None waits for the first line that it prints.

    Returns:
        the lines of its standard error.
    """
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, env=environment()) as started:
        assert started.stdout
        if after is None:
            started.stdout.readline()
        else:
            time.sleep(after)
        for _ in range(times):
            started.send_signal(number)
            time.sleep(0.05)
        _, errors = started.communicate(timeout=60)
    # Python's own handlers end the process by the signal itself: to a shell the same codes.
    assert started.returncode in (128 + number, -number), (started.returncode, errors)
    return errors.decode().splitlines()


def run_tests(*arguments: str) -> None:
    """Run tests of this checkout."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    expect_success(command, cwd=str(ROOT))


def copy_checkout(folder: Path) -> None:
    """This checkout's files, without what was made of them."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    for name in filter(None, listed.stdout.decode().split("\0")):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name)
