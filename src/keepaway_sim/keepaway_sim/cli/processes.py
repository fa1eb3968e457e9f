"""Processes that belong together, as a match's nodes do: started, watched, ended as one. No ROS.

Only processes that were started here are ever ended, by their ids. They do not receive the
terminal's Ctrl-C, so their starter decides in which order they end; and if the starter itself dies,
the kernel ends them (SIGTERM).
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

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
        self._running: dict[str, subprocess.Popen[bytes]] = {}

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


def script_command(words: Sequence[str]) -> list[str]:
    """A command as it is started: a Python script by the Python that runs this.

    >>> script_command(["./my_agent", "--brave"])
    ['./my_agent', '--brave']
    """
    return [sys.executable, *words] if words[0].endswith(".py") else list(words)
