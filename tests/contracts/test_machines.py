"""What no program of this tree may do on somebody's machine, held against every line of it."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CHECK = ROOT / "scripts/checks/robustness.py"
PAGE = ROOT / "src/keepaway_sim/docs/robustness.md"
REMOVES = re.compile(
    r"rmtree\(|\.unlink\(|\.rmdir\(|os\.remove\(|os\.truncate\(|\.rename\(|os\.replace\("
    r"|\w+\.replace\((?:path|target|\w*place)\)|\brm -|-delete"
)
TRUNCATES = {"src/keepaway_transfer/keepaway_transfer/studies/results.py"}
"""Cuts off half a line that a writer which was killed left, under the folder's lock."""


def sources() -> Iterator[Path]:
    for folder in ("src", "scripts"):
        yield from sorted((ROOT / folder).rglob("*.py"))


def calls(path: Path) -> Iterator[ast.Call]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    yield from (node for node in ast.walk(tree) if isinstance(node, ast.Call))


def test_numbers_that_json_cannot_say_are_written_nowhere() -> None:
    lax = [
        f"{path.relative_to(ROOT)}:{call.lineno}"
        for path in sources()
        for call in calls(path)
        if ast.unparse(call.func) in ("json.dump", "json.dumps")
        and "allow_nan" not in {keyword.arg for keyword in call.keywords}
    ]
    assert lax == [], "give allow_nan=False"


def test_nothing_waits_by_the_walls_clock() -> None:
    by_the_wall = ("time.time", "time.time_ns", "datetime.now", "datetime.datetime.now")
    found = [
        f"{path.relative_to(ROOT)}:{call.lineno}"
        for path in sources()
        for call in calls(path)
        if ast.unparse(call.func) in by_the_wall
    ]
    assert found == []


def test_what_removes_files_is_in_the_list_of_the_documentation() -> None:
    page = PAGE.read_text(encoding="utf-8").partition("## What is removed")[2]
    listed = {name for name in re.findall(r"`([\w/.]+)`", page) if "/" in name}
    shells = [ROOT / "scripts" / name for name in ("setup", "test", "lock", "demo")]
    for path in (*sources(), *shells):
        name = str(path.relative_to(ROOT))
        lines = path.read_text(encoding="utf-8").splitlines()
        removing = [line for line in lines if REMOVES.search(line)]
        known = name in TRUNCATES or any(name.endswith(each) for each in listed)
        assert known or not removing, f"{name}: {removing}"


def check(*arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, str(CHECK), *arguments], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_table_of_the_documentation_is_that_of_the_check() -> None:
    assert check("--print") == PAGE.read_text(encoding="utf-8"), "run it with --write"


@pytest.mark.parametrize(
    "row",
    [
        "path_that_cannot_work",
        "somebody_elses_venv",
        "no_hard_links",
        "unwritable_folder",
        "signal_while_importing",
        "signals_to_a_live_view",
        "hostile_weights_described",
    ],
)
def test_a_row_that_no_other_test_states_happens(row: str) -> None:
    assert row in check("--only", row)
