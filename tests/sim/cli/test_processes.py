"""Processes that are started, watched and ended together."""

import os
import sys
import time

from keepaway_sim.cli.processes import Ended, Processes

SLEEPER = [sys.executable, "-c", "import time; time.sleep(60)"]
STUBBORN = [
    sys.executable,
    "-uc",
    "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print(1); time.sleep(60)",
]


def is_alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def wait_for_end(processes):
    until = time.monotonic() + 30
    while time.monotonic() < until:
        if ended := processes.ended():
            return ended
        time.sleep(0.01)
    raise AssertionError("nothing ended")


def test_all_have_ended_when_the_block_is_left():
    with Processes(os.environ) as processes:
        for name in ("a", "b"):
            processes.start(name, SLEEPER)
        pids = [processes.pid(name) for name in processes.names]
        assert all(map(is_alive, pids))
    assert not any(map(is_alive, pids))


def test_one_that_ended_by_itself_is_told_once_with_its_code():
    with Processes(os.environ) as processes:
        processes.start("short", [sys.executable, "-c", "raise SystemExit(3)"])
        processes.start("long", SLEEPER)
        assert wait_for_end(processes) == [Ended("short", 3)]
        assert processes.ended() == []
        assert processes.names == ["long"]


def test_who_does_not_end_when_asked_is_killed_and_named():
    with Processes(os.environ) as processes:
        processes.start("stubborn", STUBBORN)
        processes.start("sleeper", SLEEPER)
        time.sleep(1.0)  # until it ignores the signal
        assert processes.stop(processes.names, patience=1.0) == ["stubborn"]


def test_children_end_with_a_parent_that_is_killed(tmp_path):
    parent = (
        "import os, sys, time\n"
        "from keepaway_sim.cli.processes import Processes\n"
        "processes = Processes(os.environ)\n"
        "processes.start('child', [sys.executable, '-c', 'import time; time.sleep(60)'])\n"
        f"open({str(tmp_path / 'pid')!r}, 'w').write(str(processes.pid('child')))\n"
        "time.sleep(1)\n"
        "os.kill(os.getpid(), 9)\n"
    )
    with Processes(os.environ) as processes:
        processes.start("parent", [sys.executable, "-c", parent])
        assert wait_for_end(processes) == [Ended("parent", -9)]
        child = int((tmp_path / "pid").read_text())
        until = time.monotonic() + 10
        while is_alive(child) and time.monotonic() < until:
            time.sleep(0.02)
        assert not is_alive(child)
