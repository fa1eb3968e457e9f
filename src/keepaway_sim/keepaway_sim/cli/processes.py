"""Processes that belong together, as a match's nodes do: started, watched, ended as one. No ROS.

Only processes that were started here are ever ended, by their ids. They do not receive the
terminal's Ctrl-C, so their starter decides in which order they end; and if the starter itself dies,
the kernel ends them (SIGTERM).

A process is started from a command, or split off this one (`Processes.split_off`): what was
imported and loaded before is there at once.
"""

from __future__ import annotations

import ctypes
import multiprocessing.process
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Self

from setproctitle import setproctitle

from keepaway_sim.errors import KeepawayError

_LIBC = ctypes.CDLL(None)
_PROGRAM = os.fsencode(sys.executable)
_PR_SET_PDEATHSIG = 1  # prctl(2): the signal that a process gets when its parent dies

_LAUNCHER = """
import ctypes, os, signal, sys
PR_SET_PDEATHSIG = 1
ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
if os.getppid() != int(sys.argv[1]):
    sys.exit("its starter has ended")
os.execvp(sys.argv[2], sys.argv[2:])
"""
"""Becomes the program that it is given, which the kernel ends (SIGTERM) when the starter dies.

A program of its own, as Python must not run between fork and exec where there are threads.
"""


class Ended(NamedTuple):
    """A process that ended by itself."""

    name: str
    code: int  # its exit code, or minus the signal that ended it


class Processes:
    """Named processes. Use it in a `with`: when it is left, all of them have ended."""

    def __init__(self, env: Mapping[str, str]) -> None:
        """None yet; `env` is the environment of those to come."""
        self._env = dict(env)
        self._running: dict[str, subprocess.Popen[bytes] | _Split] = {}

    @property
    def names(self) -> list[str]:
        """Those that have not been seen to end."""
        return list(self._running)

    def start(self, name: str, command: Sequence[str]) -> None:
        """Start one.

        Raises:
            OSError: there is no such program.
        """
        if shutil.which(command[0], path=self._env.get("PATH")) is None:
            raise FileNotFoundError(f"{command[0]}: no such program")
        self._running[name] = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", _LAUNCHER, str(os.getpid()), *command],
            env=self._env,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )

    def split_off(self, name: str, command: Sequence[str], run: Callable[[], object]) -> None:
        """Start one as a copy of this process, in which `run` is called.

        To other processes it is as if `command` had been started: its arguments, its name in the
        list of processes, its exit code.

        Args:
            command: the Python, the script and its arguments that `run` stands for.

        Raises:
            KeepawayError: there are threads, whose locks the copy could wait for in vain.
        """
        if threading.active_count() > 1:
            raise KeepawayError(f"{name}: a process with threads cannot be split")
        process = multiprocessing.get_context("fork").Process(
            target=_become, args=(os.getpid(), self._env, list(command), run), name=name
        )
        process.start()
        self._running[name] = _Split(process)

    def pid(self, name: str) -> int:
        """The id of a running one."""
        return self._running[name].pid

    def is_running(self, name: str) -> bool:
        """Whether one that was started has not ended."""
        return self._running[name].poll() is None

    def ended(self) -> list[Ended]:
        """Those that have ended since they were asked for last."""
        codes = {name: process.poll() for name, process in self._running.items()}
        done = [Ended(name, code) for name, code in codes.items() if code is not None]
        for name, _ in done:
            del self._running[name]
        return done

    def stop(self, names: Sequence[str], patience: float) -> list[str]:
        """End some: ask (SIGTERM), wait `patience` seconds for all together, then kill.

        Returns:
            the names of those that had to be killed.
        """
        chosen = {name: self._running.pop(name) for name in names if name in self._running}
        for process in chosen.values():
            process.terminate()
        until = time.monotonic() + patience
        killed = []
        for name, process in chosen.items():
            try:
                process.wait(max(0.0, until - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                killed.append(name)
        return killed

    def end(self, name: str, patience: float) -> int | None:
        """End one like `stop`; its exit code, or None if it had to be killed."""
        process = self._running[name]
        return None if self.stop([name], patience) else process.returncode

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop(self.names, patience=5.0)


class _Split:
    """A process that was split off, used like a `subprocess.Popen`."""

    def __init__(self, process: multiprocessing.process.BaseProcess) -> None:
        self._process = process
        self.terminate, self.kill = process.terminate, process.kill

    @property
    def pid(self) -> int:
        assert self._process.pid
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        return self._process.exitcode

    def poll(self) -> int | None:
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        self._process.join(timeout)
        code = self._process.exitcode
        if code is None:
            raise subprocess.TimeoutExpired(self._process.name, timeout or 0.0)
        return code


def _become(
    starter: int, env: Mapping[str, str], command: list[str], run: Callable[[], object]
) -> None:
    """Make a copy of this process what `_LAUNCHER` makes of a new one, and run it."""
    os.setsid()
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != starter:
        sys.exit("its starter has ended")
    for number in signal.valid_signals():
        if callable(signal.getsignal(number)):  # what was ignored stays ignored
            by_default = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
            signal.signal(number, by_default)
    # ROS names its log file by this; it lies where the title will be.
    ctypes.c_char_p.in_dll(_LIBC, "program_invocation_name").value = _PROGRAM
    setproctitle(" ".join(command))  # before the environment changes: it finds its room by that
    os.environ.clear()
    os.environ.update(env)
    sys.argv = command[1:]
    run()


def script_command(words: Sequence[str]) -> list[str]:
    """A command as it is started: a Python script by the Python that runs this.

    >>> script_command(["./my_agent", "--brave"])
    ['./my_agent', '--brave']
    """
    return [sys.executable, *words] if words[0].endswith(".py") else list(words)
