"""Signals to a node's program before it plays: while it imports, while it compiles."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil  # type: ignore[import-untyped]
import pytest

PATIENCE = 60.0  # [s] for a loaded machine; compiling itself takes as long there


@contextmanager
def node(module: str, *arguments: str, **environment: str) -> Iterator[subprocess.Popen[str]]:
    """A node's module as a program."""
    with subprocess.Popen(
        [sys.executable, "-m", module, *arguments],
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_simulator_that_compiles(
    number: signal.Signals, tmp_path: Path, ros_domain: int
) -> None:
    with node("keepaway_sim.nodes.simulator", NUMBA_CACHE_DIR=str(tmp_path)) as process:
        assert process.stderr
        assert "compiles" in process.stderr.readline()
        while not (compilers := psutil.Process(process.pid).children()):
            time.sleep(0.05)
        process.send_signal(number)
        process.send_signal(number)  # a second one does no harm
        assert process.wait(PATIENCE) == 0
        assert process.stderr.read() == "simulator: stopped while it compiled\n"
    assert psutil.wait_procs(compilers, timeout=10)[1] == []  # killed: compiling takes longer


@pytest.mark.parametrize("module", ["keepaway_sim.nodes.recorder", "keepaway_agent.nodes.keeper"])
def test_a_signal_while_it_imports_is_one_line(module: str) -> None:
    with node(module) as process:
        while "multiarray" not in Path(f"/proc/{process.pid}/maps").read_text():
            time.sleep(0.01)  # numpy comes first, much more after it
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 130
        assert process.stderr
        assert process.stderr.read() == f"{module.rpartition('.')[2]}: stopped\n"


@pytest.mark.parametrize(
    "module",
    [
        "sim.nodes.recorder",
        "sim.nodes.replayer",
        "sim.nodes.simulator",
        "agent.nodes.taker",
        "transfer.nodes.transfer",
    ],
)
def test_a_nodes_module_is_a_program(module: str) -> None:
    with node(f"keepaway_{module}", "--help") as process:
        assert process.stdout
        assert process.stdout.read().startswith(f"usage: {module.rpartition('.')[2]}")
        assert process.wait(PATIENCE) == 0
