"""Processes that are started, watched and ended together."""

import os
import sys
import time

import pytest

from keepaway_sim.cli.processes import Ended, Processes

SLEEPER = [sys.executable, "-c", "import time; time.sleep(60)"]
STUBBORN = (
    "import pathlib, signal, sys, time; signal.signal(signal.SIGTERM, signal.SIG_IGN);"
    "pathlib.Path(sys.argv[1]).touch(); time.sleep(60)"
)


def is_alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def wait_until(is_so):
    until = time.monotonic() + 120
    while not is_so():
        assert time.monotonic() < until, "it never came"
        time.sleep(0.01)


def wait_for_end(processes):
    ended = []

    def has_ended():
        ended.extend(processes.ended())
        return bool(ended)

    wait_until(has_ended)
    return ended


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


def test_who_does_not_end_when_asked_is_killed_and_named(tmp_path):
    with Processes(os.environ) as processes:
        processes.start("stubborn", [sys.executable, "-c", STUBBORN, str(tmp_path / "deaf")])
        processes.start("sleeper", SLEEPER)
        wait_until((tmp_path / "deaf").exists)
        assert processes.stop(processes.names, patience=1.0) == ["stubborn"]


def test_a_program_that_is_none_is_refused_at_once():
    with Processes(os.environ) as processes, pytest.raises(OSError, match="no_such: no such"):
        processes.start("none", ["no_such"])


def test_a_program_gets_its_environment_and_its_words(tmp_path):
    code = (
        f"import os, sys; open({str(tmp_path / 'a')!r}, 'w').write(os.environ['A'] + sys.argv[1])"
    )
    with Processes({"A": "b ", "PATH": os.environ["PATH"]}) as processes:
        processes.start("short", [sys.executable, "-c", code, "c d"])
        assert wait_for_end(processes) == [Ended("short", 0)]
    assert (tmp_path / "a").read_text() == "b c d"


def test_children_end_with_a_parent_that_is_killed(tmp_path):
    parent = (
        "import os, sys, time\n"
        "from keepaway_sim.cli.processes import Processes\n"
        "processes = Processes(os.environ)\n"
        "code = 'import pathlib, sys, time; pathlib.Path(sys.argv[1]).touch(); time.sleep(60)'\n"
        f"words = [sys.executable, '-c', code, {str(tmp_path / 'runs')!r}]\n"
        "processes.start('child', words)\n"
        f"open({str(tmp_path / 'pid')!r}, 'w').write(str(processes.pid('child')))\n"
        f"while not os.path.exists({str(tmp_path / 'runs')!r}): time.sleep(0.01)\n"
        "os.kill(os.getpid(), 9)\n"
    )
    with Processes(os.environ) as processes:
        processes.start("parent", [sys.executable, "-c", parent])
        assert wait_for_end(processes) == [Ended("parent", -9)]
        child = int((tmp_path / "pid").read_text())
        wait_until(lambda: not is_alive(child))
