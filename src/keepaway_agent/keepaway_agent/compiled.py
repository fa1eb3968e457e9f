"""How compiled functions of arrays are made, and where their machine code is kept.

`compiled` is numba's `njit` with settings that fit small functions called millions of times a
second on rows of arrays that others own: functions are compiled into their callers, because passing
their arguments on takes longer than a player's decision; division follows IEEE, without a branch
for dividing by zero; arrays are not reference-counted, so such a function allocates none and writes
into what it is given. Floating-point rules stay strict (no `fastmath`): the same bits from every
caller.

Machine code is kept on disk in a folder named by everything that it was made from: the sources of
both packages that hold compiled functions, numba, numpy, Python and the processor. So it is never
stale, whatever time stamps say, and checkouts of the same sources share it. Numba's own cache looks
at one source file alone, and would go on using code into which an older callee was compiled.

The packages of the world and of the agents share no code, so each has this same file; a contract
test holds the two together.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import logging
import os
import platform
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import llvmlite.binding
import numba
import numpy as np
from numba import config, njit, typeof
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher

SOURCES: Final = (
    "actions.py",
    "compiled.py",
    "learning",
    "playing",
    "task.py",
    "training/deciding.py",
    "world",
)
"""Files and folders of both packages from which machine code is made."""
KEPT_FOLDERS: Final = 8
"""Folders of machine code that stay on disk; the least recently used ones go."""

_SETTINGS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
_UNWRAPPED: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_DISABLED: Final = bool(vars(config)["DISABLE_JIT"])
_CHECKED: Final = os.environ.get("KEEPAWAY_CHECKED") == "1"
_LOG = logging.getLogger(__name__)


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
        if _DISABLED:
            self._code = self._function
            return
        types = tuple(typeof(value) for value in (*self._frozen, *arguments))
        code = self._function.compile(types)
        self._code = self._code or code

    def __call__(self, *arguments: Any) -> Any:
        """Call the function with the frozen arguments and these."""
        if self._code is None:
            self.compile_for(*arguments)
        return self._code(*self._frozen, *arguments)  # type: ignore[misc]


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
        dispatcher._cache = _SharedCache(dispatcher.py_func)
    return dispatcher


@functools.cache
def cache_folder() -> Path | None:
    """Where machine code of these sources is kept; None (said once) where nothing can be written.

    In `NUMBA_CACHE_DIR` if it is set, else in the user's cache folder.
    """
    for base in _places():
        folder = base / "keepaway" / f"machine_code-{_fingerprint()[:24]}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            os.utime(folder)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError:
            continue
        _drop_old(folder)
        return folder
    _LOG.warning(
        "machine code cannot be kept: no folder can be written (set NUMBA_CACHE_DIR to one);"
        " each process compiles anew"
    )
    return None


def _places() -> Iterator[Path]:
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(chosen)
    if chosen := os.environ.get("XDG_CACHE_HOME"):
        yield Path(chosen)
    home = os.path.expanduser("~")  # noqa: PTH111 - Path.home() fails where there is none
    if Path(home).is_absolute():
        yield Path(home) / ".cache"


@functools.cache
def _fingerprint() -> str:
    """A hash of all that machine code depends on."""
    digest = hashlib.sha256()
    versions = numba.__version__, llvmlite.__version__, np.__version__
    processor = llvmlite.binding.get_host_cpu_name(), os.environ.get("NUMBA_CPU_NAME")
    features = (
        llvmlite.binding.get_host_cpu_features().flatten(),
        os.environ.get("NUMBA_CPU_FEATURES"),
    )
    digest.update(repr((platform.python_version(), versions, processor, features)).encode())
    for source in sources():
        text = source.read_bytes()
        digest.update(f"{source.name} {len(text)} ".encode() + text)
    return digest.hexdigest()


def sources() -> list[Path]:
    """Every source file of both packages from which machine code is made."""
    found: list[Path] = []
    for package in ("keepaway_agent", "keepaway_sim"):
        spec = importlib.util.find_spec(package)
        if spec is None or spec.origin is None:
            continue  # agents run without the simulator's package
        for name in SOURCES:
            place = Path(spec.origin).parent / name
            found += sorted(place.rglob("*.py")) if place.is_dir() else [place][: place.is_file()]
    return found


def _drop_old(folder: Path) -> None:
    """Remove folders of other sources but for those used last; others may do so at once."""
    try:
        known = sorted(folder.parent.glob("machine_code-*"), key=lambda path: path.stat().st_mtime)
    except OSError:
        return
    for old in known[:-KEPT_FOLDERS]:
        if old != folder:
            shutil.rmtree(old, ignore_errors=True)


class _Locator(_CacheLocator):
    """Names numba the folder; its name says all that a source's time stamp would."""

    def __init__(self, py_func: Any) -> None:
        self._name = f"{py_func.__module__}-{py_func.__code__.co_firstlineno}"

    def get_cache_path(self) -> str:
        return str(cache_folder())

    def get_source_stamp(self) -> str:
        return _fingerprint()

    def get_disambiguator(self) -> str:
        return str(self._name)

    @classmethod
    def from_function(cls, py_func: Any, _py_file: str) -> _Locator:
        return cls(py_func)


class _SharedCacheImpl(CompileResultCacheImpl):
    _locator_classes: list[Any] = [_Locator]  # noqa: RUF012 - as numba declares it


class _SharedCache(FunctionCache):
    _impl_class = _SharedCacheImpl
