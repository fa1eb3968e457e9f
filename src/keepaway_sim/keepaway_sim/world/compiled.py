"""How compiled functions of arrays are made and called.

`compiled` is numba's `njit` with settings that fit small functions called millions of times a
second on rows of arrays that others own: functions are compiled into their callers, because passing
their arguments on takes longer than a player's decision; division follows IEEE, without a branch
for dividing by zero; arrays are not reference-counted, so such a function allocates none and writes
into what it is given. Floating-point rules stay strict (no `fastmath`): the same bits from every
caller.

The packages of the world and of the agents share no code, so each has this same file and
`machine_code.py`; a contract test holds the two together.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import gc
import importlib
import logging
import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

if "coverage" not in sys.modules:  # numba imports it unused: a seventh of a node's imports
    sys.modules["coverage"] = None  # type: ignore[assignment]
    import numba  # noqa: F401

    del sys.modules["coverage"]
from numba import config, njit, typeof
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher

from .machine_code import SharedCache, cache_folder

_SETTINGS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
_UNWRAPPED: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_DISABLED: Final = bool(vars(config)["DISABLE_JIT"])
_CHECKED: Final = os.environ.get("KEEPAWAY_CHECKED") == "1"
_PATIENCE: Final = 0.05  # [s] between two looks at what is waited for
_PROGRESS_PERIOD: Final = 5.0  # [s] between two reports
_LOG = logging.getLogger(__name__)
_POSTPONED: list[list[Job]] = []  # what `prepare` did not compile, while it is postponed


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function of arrays into its callers.

    Called from Python, as tests do, it is compiled once more, as an entry point.
    """
    if _DISABLED:
        return function
    settings = {"nopython": True, "forceinline": True, **_UNWRAPPED, **_SETTINGS}
    return _Inner(function, targetoptions=settings, pipeline_class=_InnerCompiler)


def compiled_apart(function: Callable[..., Any]) -> Any:
    """Compile a function of its own: an entry point."""
    settings: dict[str, Any] = {"pipeline_class": _EntryCompiler, "no_cfunc_wrapper": True}
    return _kept(njit(**settings, **_SETTINGS)(function))


class Kernel:
    """The machine code of a compiled function, called with some of its arguments fixed.

    A call of the function itself looks up the type of every array, which takes 10 us for some
    forty of them; this takes a tenth of that. Later calls must bring arguments of the same types
    as the first: an array is checked no further than by its number of axes and the size of its
    numbers. With KEEPAWAY_CHECKED=1 every call goes the long way, which checks them.
    """

    def __init__(self, function: Any, *frozen: Any) -> None:
        """Take the first arguments, which no call repeats; nothing is compiled yet."""
        self._function, self._frozen = getattr(function, "entry", function), frozen
        self._code: Callable[..., Any] | None = self._function if _CHECKED else None

    def compile_for(self, *arguments: Any) -> None:
        """Compile for arguments of the types of these, so that the first call does not wait."""
        prepare((self, arguments))

    def __call__(self, *arguments: Any) -> Any:
        """Call the function with the frozen arguments and these."""
        if self._code is None:
            self.compile_for(*arguments)
        return self._code(*self._frozen, *arguments)  # type: ignore[misc]

    def _job(self, arguments: tuple[Any, ...]) -> Job:
        types = tuple(typeof(value) for value in (*self._frozen, *arguments))
        return Job(self._function, types)

    def _load(self, job: Job) -> None:
        code = self._function.compile(job.types)
        self._code = self._code or code


def prepare(*calls: tuple[Kernel, tuple[Any, ...]]) -> None:
    """Compile kernels for arguments of the types of these, those that are not compiled yet.

    What no process has compiled before is compiled by child processes, as many at once as there
    are processors; it says so on standard error, and then how far it is. The children end
    with this process's wait, so that an interrupt ends it at once. Of several processes that want
    the same code one compiles it, and the others wait.

    Raises:
        RuntimeError: a function cannot be compiled.
    """
    if _DISABLED:
        for kernel, _ in calls:
            kernel._code = kernel._function
        return
    jobs = [(kernel, kernel._job(arguments)) for kernel, arguments in calls]
    if _POSTPONED:
        _POSTPONED[-1].extend(job for _, job in jobs)
        return
    make([job for _, job in jobs])
    for kernel, job in jobs:
        kernel._load(job)


@contextlib.contextmanager
def postponed() -> Iterator[list[Job]]:
    """Let `prepare` only list what it would compile, so that `make` can do it side by side."""
    _POSTPONED.append([])
    try:
        yield _POSTPONED[-1]
    finally:
        _POSTPONED.pop()


class Job(NamedTuple):
    """A function to compile for arguments of some types."""

    function: Any  # a dispatcher
    types: tuple[Any, ...]

    def is_made(self) -> bool:
        """Is it compiled, here or on disk?"""
        if self.types in self.function.overloads:
            return True
        cache = self.function._cache
        if not isinstance(cache, SharedCache):
            return False
        kept = cache._cache_file
        name = kept._load_index().get(
            cache._index_key(self.types, self.function.targetctx.codegen())
        )
        return name is not None and Path(kept._data_path(name)).exists()

    def begin(self) -> subprocess.Popen[bytes]:
        """Begin to compile it in a child process, which keeps it on disk."""
        code = (
            "import pickle, sys\n"
            "try:\n    sys.path = pickle.load(sys.stdin.buffer)\n"
            "except EOFError:\n    sys.exit()  # the parent has ended\n"
            f"from {__name__} import _child; _child()"
        )
        child = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE)
        name = self.function.py_func.__module__, self.function.py_func.__name__
        assert child.stdin
        with contextlib.suppress(BrokenPipeError), child.stdin:
            child.stdin.write(pickle.dumps(sys.path) + pickle.dumps((*name, self.types)))
        return child


def _child() -> None:
    """Compile what the parent asks for; it ends as soon as it is interrupted."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    gc.disable()  # a seventh of the time, in a process that soon ends
    sys.modules["scipy"] = None  # type: ignore[assignment] # numba would load it; no function needs it
    module, name, types = pickle.load(sys.stdin.buffer)
    function = getattr(importlib.import_module(module), name)
    getattr(function, "entry", function).compile(types)


def make(wanted: Iterable[Job]) -> None:
    """Compile what is on no disk yet; it is compiled here where there is no place to keep it.

    Raises:
        RuntimeError: a function cannot be compiled.
    """
    jobs = [job for job in dict.fromkeys(wanted) if not job.is_made()]
    if not jobs:
        return
    names = ", ".join(job.function.py_func.__name__ for job in jobs)
    folder, start = cache_folder(), time.monotonic()
    _LOG.warning("compiles %s: once for these sources, up to a minute", names)
    if folder is None:
        for job in jobs:
            job.function.compile(job.types)
    else:
        with _only_one(folder, start):
            waiting = [job for job in jobs if not job.is_made()]
            _run_children(waiting, start)
    _LOG.warning("compiled %s in %.0f s", names, time.monotonic() - start)


def _run_children(waiting: list[Job], start: float) -> None:
    """Compile in child processes; none of them outlives this."""
    running: list[subprocess.Popen[bytes]] = []
    num, said = len(waiting), time.monotonic()
    try:
        while waiting or running:
            while waiting and len(running) < (os.cpu_count() or 1):
                running.append(waiting.pop(0).begin())
            time.sleep(_PATIENCE)
            for child in [child for child in running if child.poll() is not None]:
                running.remove(child)
                if child.returncode == -signal.SIGINT:
                    raise KeyboardInterrupt
                if child.returncode != 0:
                    raise RuntimeError("a function cannot be compiled: see above")
            if time.monotonic() - said > _PROGRESS_PERIOD:
                said, done = time.monotonic(), num - len(waiting) - len(running)
                _LOG.warning("compiling: %d of %d done after %.0f s", done, num, said - start)
    finally:
        for child in running:
            child.kill()
            child.wait()


@contextlib.contextmanager
def _only_one(folder: Path, start: float) -> Iterator[None]:
    """Hold the folder's lock; the processes that want it wait, and say so."""
    with (folder / "lock").open("w") as lock:
        said = start
        while True:
            with contextlib.suppress(BlockingIOError):
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            time.sleep(_PATIENCE)
            if time.monotonic() - said > _PROGRESS_PERIOD:
                said = time.monotonic()
                _LOG.warning("waits for another process that compiles, %.0f s so far", said - start)
        yield


class _Inner(CPUDispatcher):
    """A function that is compiled into its callers."""

    @functools.cached_property
    def entry(self) -> Any:
        """The same function, compiled of its own."""
        return compiled_apart(self.py_func)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self.entry(*arguments, **named)


class _InnerLibrary(JITCodeLibrary):
    """Code that is linked into its callers'; it is neither optimized nor loaded by itself."""

    is_inner = True

    @property
    def codegen(self) -> Any:
        return _Unloaded()

    def finalize(self) -> None:
        self._finalized = True

    def get_pointer_to_function(self, _name: str) -> int:
        return 0


class _Unloaded:
    """Stands for the loader of code that is not loaded."""

    def set_env(self, _name: str, _environment: Any) -> None:
        pass


class _EntryLibrary(JITCodeLibrary):
    """Code of an entry point: all that it calls, directly or not, is linked in and optimized."""

    def finalize(self) -> None:
        found = dict.fromkeys(self._linking_libraries)
        waiting = list(found)
        while waiting:
            library = waiting.pop()
            callees = library._linking_libraries if hasattr(library, "is_inner") else ()
            waiting += [callee for callee in callees if callee not in found]
            found |= dict.fromkeys(callees)
        self._linking_libraries = list(found)
        super().finalize()


class _InnerCompiler(Compiler):
    library_class: Any = _InnerLibrary

    def _compile_bytecode(self) -> Any:
        state = self.state
        state.library = self.library_class(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super()._compile_bytecode()


class _EntryCompiler(_InnerCompiler):
    library_class = _EntryLibrary


def _kept(dispatcher: Any) -> Any:
    """Let a compiled function keep its machine code on disk, if there is a place for it."""
    if hasattr(dispatcher, "py_func") and cache_folder() is not None:  # not with DISABLE_JIT
        dispatcher._cache = SharedCache(dispatcher.py_func)
    return dispatcher
