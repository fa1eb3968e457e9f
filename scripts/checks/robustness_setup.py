"""Rows of `robustness.py`: set-ups in odd places, files and folders that a person owns."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

from other_machines import (
    ROOT,
    copy_checkout,
    expect_one_line,
    expect_success,
    row,
    run,
    run_tests,
    script,
    shared_library,
    training,
)

ODD_NAME = "it's ü (x) $HOME & \\ \" 🙂 ` end"

NO_LINKS = """
#include <errno.h>
int link(const char *a, const char *b) { errno = EPERM; return -1; }
int linkat(int a, const char *b, int c, const char *d, int e) { errno = EPERM; return -1; }
"""


# Set-up


@row(
    "`scripts/setup` where the path has `:`, `;`, a line break or `$LIB` in it",
    "refused at once in a line that names the character",
)
def path_that_cannot_work(folder: Path) -> None:
    """Characters that separate lists of folders."""
    for odd in (":", ";", "\n", "$LIB"):
        place = folder / f"a{odd}b" / "scripts"
        place.mkdir(parents=True)
        shutil.copy(ROOT / "scripts/setup", place)
        done = run([str(place / "setup")])
        expect_one_line(done, f"has '{odd.replace(chr(10), chr(92) + 'n')}' in it")


@row(
    "`scripts/setup` beside a `.venv` that it did not make",
    "refused in a line; the `.venv` is as it was",
)
def somebody_elses_venv(folder: Path) -> None:
    """A .venv of a person's own is not replaced."""
    copy_checkout(folder)
    own = folder / ".venv" / "notes.txt"
    own.parent.mkdir()
    own.write_text("mine")
    done = run([str(folder / "scripts/setup")])
    assert done.returncode == 1, done
    assert "was not made by this script" in done.stderr, done
    assert [path.name for path in own.parent.iterdir()] == ["notes.txt"]


@row(
    f"set-up, a training and a match in a folder called `{ODD_NAME.replace('`', chr(39))}` (with a"
    " backtick), with `LC_ALL=C` and umask 077",
    "all work; messages were built in a plainly named folder, which is gone",
    is_long=True,
)
def odd_folder(folder: Path) -> None:
    """A whole set-up where CMake cannot build."""
    place = folder / ODD_NAME
    copy_checkout(place)
    python = str(place / ".venv/bin/python")
    expect_success(["bash", "-c", 'umask 077; "$0"', str(place / "scripts/setup")], LC_ALL="C")
    out = str(place / "out")
    train = [python, str(place / "scripts/train.py"), "--episodes", "5", "--save-weights", out]
    expect_success(train, LC_ALL="C")
    match = [python, str(place / "scripts/match.py"), "--episodes", "2"]
    expect_success([*match, "--single-process", "--domain", "21"], LC_ALL="C")
    assert not list(Path(tempfile.gettempdir()).glob("keepaway-setup-*"))


@row(
    "`scripts/setup` killed (SIGKILL, with all that it had started) at 5 moments, and run again",
    "the last run makes it whole: messages import, and a training runs",
    is_long=True,
)
def killed_setup(folder: Path) -> None:
    """Killed at any moment, run again it is whole."""
    copy_checkout(folder)
    for _ in range(5):
        with subprocess.Popen([str(folder / "scripts/setup")], start_new_session=True) as started:
            time.sleep(random.uniform(1, 90))
            os.killpg(started.pid, signal.SIGKILL)
    expect_success([str(folder / "scripts/setup")])
    python = str(folder / ".venv/bin/python")
    expect_success([python, "-c", "import keepaway_msgs.msg"])
    expect_success([python, str(folder / "scripts/train.py"), "--episodes", "5"])


@row(
    "set-up, a training and a match by another user, who may not write in the checkout",
    "nothing is made anew and all work; logs go to that user's home",
    is_long=True,
)
def another_users_checkout(folder: Path) -> None:
    """Needs root, to be another user, and a Python that others may run."""
    assert os.geteuid() == 0, "run it as root"
    place, home = folder / "checkout", folder / "home"
    home.mkdir()
    os.chown(home, 65534, 65534)
    folder.chmod(0o755)
    copy_checkout(place)
    expect_success([str(place / "scripts/setup"), "--no-compile"], PYTHON="/usr/bin/python3")
    other = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
    expect_success([*other, str(place / "scripts/setup"), "--no-compile"], HOME=str(home))
    for words in ("train.py --episodes 5", "match.py --episodes 2 --domain 21 --single-process"):
        name, *options = words.split()
        command = [str(place / ".venv/bin/python"), str(place / "scripts" / name), *options]
        expect_success([*other, *command], HOME=str(home), cwd=str(home))


# Files


@row(
    "`scripts/demo --out DIR`, where DIR holds a letter; where it holds an earlier demo and notes",
    "refused, and the letter stays; of the demo only what it made is replaced, and the notes stay",
)
def demo_folder(folder: Path) -> None:
    """Nothing a user owns is deleted."""
    run_tests("tests/scripts/test_demo.py")


@row(
    "a training into a file system without hard links (`link` fails with EPERM)",
    "the same files, whole, and none beside them",
)
def no_hard_links(folder: Path) -> None:
    """Like exFAT, SMB and some FUSE file systems."""
    library = shared_library(folder, NO_LINKS)
    out = folder / "out"
    expect_success([*training("--episodes", 5), "--save-weights", str(out)], LD_PRELOAD=library)
    names = sorted(str(path.relative_to(out)) for path in out.rglob("*") if path.is_file())
    weights = [f"keeper_{number}.npz" for number in (1, 2, 3)]
    trial = [f"trial_0000/{name}" for name in ("episodes.csv", *weights)]
    assert names == [*weights, "training.json", *trial], names


@row(
    "a trial that cannot be moved into its place; weights that cannot",
    "kept beside it under a name that the error says",
)
def kept_beside(folder: Path) -> None:
    """A learned table is never lost."""
    run_tests("tests/agent/test_files.py")


@row(
    "`--save-weights`, `--out` in a place that cannot be written",
    "refused in a line before the work begins",
)
def unwritable_folder(folder: Path) -> None:
    """Known before hours of work."""
    for command in (
        [*training("--episodes", 10**7), "--save-weights", "/proc/keepaway"],
        [*script("study.py", "tiny"), "--out", "/proc/keepaway"],
    ):
        done = run(command)
        expect_one_line(done, "/proc/keepaway")
