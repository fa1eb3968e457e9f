"""What `robustness.py` makes its rows of: commands, copies of the checkout, libraries that lie."""

from __future__ import annotations

import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from keepaway_agent.actions import Role
from keepaway_agent.learning.cmac import make_tiling
from keepaway_agent.learning.weights import LearnedWeights, write_weights

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


NO_LINKS = """
#include <errno.h>
int link(const char *a, const char *b) { errno = EPERM; return -1; }
int linkat(int a, const char *b, int c, const char *d, int e) { errno = EPERM; return -1; }
"""

CLOCK = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
static long shift(void) {  /* an hour back, once the file CLOCK_BACK_WHEN is there */
    static int seen;
    const char *file = getenv("CLOCK_BACK_WHEN");
    if (!seen && file) seen = access(file, F_OK) == 0;
    return seen ? -3600 : 0;
}
int clock_gettime(clockid_t id, struct timespec *t) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(id, t);
    if (id == CLOCK_REALTIME || id == CLOCK_REALTIME_COARSE) t->tv_sec += shift();
    return result;
}
int gettimeofday(struct timeval *restrict t, void *restrict zone) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    t->tv_sec = now.tv_sec;
    t->tv_usec = now.tv_nsec / 1000;
    return 0;
}
time_t time(time_t *out) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (out) *out = now.tv_sec;
    return now.tv_sec;
}
"""


def shared_library(folder: Path, source: str) -> str:
    """A library that stands before the C library (LD_PRELOAD)."""
    text, made = folder / "preload.c", folder / "preload.so"
    text.write_text(source)
    compiler = ["cc", "-shared", "-fPIC", "-O1", "-o", str(made), str(text), "-ldl"]
    subprocess.run(compiler, check=True)
    return str(made)


def bombs() -> list[tuple[str, bytes]]:
    """Weights files that are not what they say."""
    members = whole_members()
    metadata = json.loads(members["metadata.json"])
    changes: list[dict[str, object]] = [
        {"num_keepers": 10**9},
        {"player": "\x1b]0;owned\x07keeper_1"},
        {"created_by": "\x1b[2J"},
        {"seed": 10**4000},
    ]
    texts = [json.dumps(metadata | each, allow_nan=False).encode() for each in changes]
    files = [packed({**members, "metadata.json": text}) for text in texts]
    for name in members:
        unpacked = {**members, name: bytes(2**28)}
        files += [packed(unpacked), packed(unpacked, {name: 1000})]
    return [(f"bomb_{number}.npz", data) for number, data in enumerate(files)]


def whole_members() -> dict[str, bytes]:
    """The members of a weights file as it should be."""
    tiling, file = make_tiling(Role.KEEPER, 2, 1), io.BytesIO()
    values = np.zeros(tiling.weights_shape(2))
    write_weights(file, LearnedWeights(values, Role.KEEPER, 2, 1, 25.0, 25.0, tiling))
    with zipfile.ZipFile(file) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(members: dict[str, bytes], says: dict[str, int] | None = None) -> bytes:
    """An archive, that may say of a member that it unpacks to other than it does."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
        for name, size in (says or {}).items():
            archive.getinfo(name).file_size = size
    return file.getvalue()


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
