"""Where the machine code of compiled functions is kept, so that it is never stale.

Machine code is kept on disk in a folder named by everything that it was made from: the sources of
both packages that hold compiled functions, numba, numpy, Python and the processor. So it is never
stale, whatever time stamps say, and checkouts of the same sources share it. Numba's own cache looks
at one source file alone, and would keep using code into which an older callee was compiled.
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
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import llvmlite.binding
import numba
import numpy as np
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator

SOURCES: Final = (
    "actions.py",
    "bags/chunk_records.py",
    "compiled.py",
    "environments/compiled_fields.py",
    "learning",
    "machine_code.py",
    "passing.py",
    "playing",
    "task.py",
    "training/deciding.py",
    "trigonometry.py",
    "world",
)
"""Files and folders of both packages from which machine code is made."""
KEPT_FOLDERS: Final = 8
"""Folders of machine code that stay on disk; the least recently used ones go."""

_LOG = logging.getLogger(__name__)


@functools.cache
def cache_folder() -> Path | None:
    """Where machine code of these sources is kept; None (said once) where nothing can be written.

    In `NUMBA_CACHE_DIR` if it is set, else in the user's cache folder.
    """
    for base in _places():
        folder = base / "keepaway" / f"machine_code-{fingerprint()[:24]}"
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
def fingerprint() -> str:
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
        return fingerprint()

    def get_disambiguator(self) -> str:
        return str(self._name)

    @classmethod
    def from_function(cls, py_func: Any, _py_file: str) -> _Locator:
        return cls(py_func)


class _SharedCacheImpl(CompileResultCacheImpl):
    _locator_classes: list[Any] = [_Locator]  # noqa: RUF012 - as numba declares it


class SharedCache(FunctionCache):
    """Keeps a function's machine code in the folder of these sources.

    Before it loads machine code numba loads all that it may compile with, half of scipy among it,
    which takes longer. Our functions need nothing of numba to run, so none of that is loaded here.
    """

    _impl_class = _SharedCacheImpl

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What is kept for these types; None: nothing is."""
        return self._load_overload(sig, target_context)
