"""Rows of `robustness.py`: weights files and browsers that are not trusted, and the audit."""

from __future__ import annotations

import io
import json
import resource
import zipfile
from pathlib import Path

import numpy as np
from other_machines import (
    expect_one_line,
    row,
    run,
    run_tests,
    script,
)

from keepaway_agent.actions import Role
from keepaway_agent.learning.cmac import make_tiling
from keepaway_agent.learning.weights import LearnedWeights, write_weights

MAX_MEMORY = 500e6  # [bytes] that refusing a file may take


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


# Hostile files and browsers


@row(
    "weights files that unpack to gigabytes, name 10^9 players, hold pickles, NaN, 1e308, escapes"
    " of terminals, paths, thousands of members, numbers of 4,000 digits",
    "refused in a printable line of at most 1,000 characters before anything is sized by them",
)
def hostile_weights(folder: Path) -> None:
    """Reads are bounded, numbers and texts checked first."""
    run_tests("tests/agent/learning/test_weights.py")


@row(
    "the same files given to `describe.py`",
    "one line that names the file, code 1, less than 500 MB",
)
def hostile_weights_described(folder: Path) -> None:
    """As a person meets them."""
    for name, data in bombs():
        path = folder / name
        path.write_bytes(data)
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
        done = run(script("describe.py", str(path)))
        peak = 1024 * max(before, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
        assert peak < MAX_MEMORY, f"{peak / 1e6:.0f} MB"
        expect_one_line(done, name)


@row(
    "requests that do not come, that come byte by byte, 23 connections where 3 may be, a browser"
    " that takes nothing, other hosts' names, `localhost` on port 80, matches with hostile names",
    "each ends in time and holds no thread; other origins get 403; the match is refused, and"
    " names are text",
)
def live_server(folder: Path) -> None:
    """Browsers and their pages are not trusted."""
    run_tests("tests/sim/view/test_live.py", "-k", "not follows")


@row(
    "every `json.dumps`, every clock and every removal in `src/` and `scripts/` looked up",
    "JSON refuses NaN, no program reads the wall's clock to wait, removals are those listed below",
)
def audit(folder: Path) -> None:
    """What the code may not do anywhere."""
    run_tests("tests/contracts/test_machines.py")
