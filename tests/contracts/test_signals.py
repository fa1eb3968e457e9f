"""A signal's handler may interrupt whoever holds a lock, so it never takes one.

`Event.set` in a handler waits for the lock that `Event.wait` holds for some microseconds: a signal
that comes just then is waited for by nobody who could go on. A list takes no lock.
"""

import ast
from pathlib import Path

import pytest
from modules import SRC

LOCKING = {"acquire", "notify", "notify_all", "put", "release", "set"}
HANDLING = [
    path
    for path in sorted([*SRC.rglob("*.py"), *(SRC.parent / "scripts").rglob("*.py")])
    if "signal.signal(" in path.read_text()
]


@pytest.mark.parametrize("path", HANDLING, ids=lambda path: path.stem)
def test_a_module_that_handles_signals_uses_nothing_that_takes_a_lock(path: Path) -> None:
    nodes = ast.walk(ast.parse(path.read_text()))
    assert not {node.attr for node in nodes if isinstance(node, ast.Attribute)} & LOCKING


def test_there_are_modules_that_handle_signals() -> None:
    assert "running" in {path.stem for path in HANDLING}
