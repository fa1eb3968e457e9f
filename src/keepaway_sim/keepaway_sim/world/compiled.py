"""How this package compiles its functions of arrays.

`compiled` is numba's `njit` with settings that fit small functions called millions of times a
second on rows of arrays that others own: machine code is kept on disk; functions are compiled into
their callers, because handing on some thirty arrays takes longer than a player's decision; division
follows IEEE; arrays are not reference-counted, so such a function allocates none and writes into
what it is given. Floating-point rules stay strict (no `fastmath`): the same bits from every caller.

The agents' package has the same few lines: agents share nothing with the simulator.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit, typeof

_SETTINGS: dict[str, Any] = {"cache": True, "error_model": "numpy", "_nrt": False}


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function of arrays into its callers."""
    return njit(forceinline=True, **_SETTINGS)(function)


def compiled_apart(function: Callable[..., Any]) -> Any:
    """Compile a function of its own: an entry point, or a long one called from many places."""
    return njit(**_SETTINGS)(function)


def entry_point(function: Any, *arguments: Any) -> Callable[..., Any]:
    """The machine code of a compiled function, for arguments of the types of these.

    A call of the function itself looks up the type of every array, which takes 10 us for some
    forty of them; this takes a tenth of that. It must only get arguments of the same types: an
    array is checked no further than by its number of axes and the size of its numbers.
    """
    code: Callable[..., Any] = function.compile(tuple(typeof(value) for value in arguments))
    return code


def drop_stale_cache(package: Path) -> None:
    """Remove a package's cached machine code that is older than its newest source file.

    Numba looks at the source of the cached function alone and would go on using machine code into
    which an older version of another file was compiled. Several processes may do this at once.
    """
    newest = max(source.stat().st_mtime_ns for source in package.rglob("*.py"))
    for cached in package.rglob("__pycache__/*.nb[ic]"):
        with contextlib.suppress(FileNotFoundError):
            if cached.stat().st_mtime_ns < newest:
                cached.unlink()


drop_stale_cache(Path(__file__).parents[1])
