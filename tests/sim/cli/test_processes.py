"""Processes that are started, watched and ended together."""

import os
import subprocess
import sys
import time

import psutil  # type: ignore[import-untyped]
import pytest

from keepaway_sim.cli.processes import Ended, Processes

SLEEPER = [sys.executable, "-c", "import time; time.sleep(60)"]
STUBBORN = (
    "import pathlib, signal, sys, time; signal.signal(signal.SIGTERM, signal.SIG_IGN);"
    "pathlib.Path(sys.argv[1]).touch(); time.sleep(60)"
)


def is_alive(pid):
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE  # which nobody may wait for
    except psutil.NoSuchProcess:
        return False


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


def in_a_process_without_threads(body, *arguments):
    """What `body` prints; it has `Processes`, and `wait` for something that it is given."""
    code = "\n".join(
        [
            "import os, pathlib, signal, sys, threading, time, psutil",
            "from keepaway_sim.cli.processes import Processes",
            "from keepaway_sim.errors import KeepawayError",
            "path = pathlib.Path(sys.argv[1])",
            "def wait(is_so):",
            "    while not is_so():",
            "        time.sleep(0.01)",
            body,
        ]
    )
    command = [sys.executable, "-c", code, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.stderr == ""
    return done.stdout


def test_one_that_was_split_off_is_known_by_its_command_and_ends_with_its_code(tmp_path):
    said = in_a_process_without_threads(
        """
def run():
    path.write_text(f"{sys.argv} {os.environ['WHO']} {os.getsid(0) == os.getpid()}")
    wait(lambda: not path.exists())
    raise SystemExit(4)
with Processes({**os.environ, "WHO": "me"}) as processes:
    processes.split_off("a", [sys.executable, "script.py", "--loud"], run)
    wait(lambda: path.exists() and path.read_text())
    print(path.read_text())
    print("script.py --loud" in " ".join(psutil.Process(processes.pid("a")).cmdline()))
    path.unlink()
    wait(lambda: not processes.is_running("a"))
    print(processes.ended()[0].code)
""",
        tmp_path / "said.txt",
    )
    assert said.splitlines() == ["['script.py', '--loud'] me True", "True", "4"]


def test_one_that_was_split_off_does_not_have_its_starters_handlers(tmp_path):
    said = in_a_process_without_threads(
        """
signal.signal(signal.SIGTERM, lambda *_: print("the starter's"))
with Processes(os.environ) as processes:
    processes.split_off("a", [sys.executable], lambda: (path.touch(), time.sleep(60)))
    wait(path.exists)
    print(processes.end("a", patience=60) == -signal.SIGTERM)
""",
        tmp_path / "begun",
    )
    assert said == "True\n"


def test_one_that_was_split_off_ends_with_its_starter(tmp_path):
    said = in_a_process_without_threads(
        """
processes = Processes(os.environ)
processes.split_off("a", [sys.executable], lambda: (path.touch(), time.sleep(60)))
wait(path.exists)
print(processes.pid("a"), flush=True)
os._exit(0)
""",
        tmp_path / "begun",
    )
    wait_until(lambda: not is_alive(int(said)))


def test_a_process_with_threads_is_not_split(tmp_path):
    said = in_a_process_without_threads(
        """
done = threading.Event()
threading.Thread(target=done.wait).start()
try:
    Processes(os.environ).split_off("a", [sys.executable], print)
except KeepawayError as error:
    print(error)
done.set()
""",
        tmp_path,
    )
    assert said == "a: a process with threads cannot be split\n"
