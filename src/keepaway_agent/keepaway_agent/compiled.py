"""How this package compiles its functions of arrays.

`compiled` is numba's `njit` with four settings that fit functions which are called a million times
a second on rows of arrays that others own:

- the machine code is kept on disk (`cache`), so only a machine's first call pays for compiling;
- functions are compiled into their callers (`forceinline`): what a learner is goes through half a
  dozen calls per decision, and handing on its twenty arrays would take longer than deciding;
- division follows IEEE (`error_model`), without a branch for dividing by zero;
- arrays are not reference-counted (`_nrt`), which would take as long as deciding, too. Such a
  function cannot allocate an array; numba says so when compiling. It writes into what it is given.

Floating-point rules stay strict (no `fastmath`): sums have one order, and every caller gets the
same bits.
"""

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit, typeof


def drop_stale_cache(package: Path) -> None:
    """Remove a package's cached machine code that is older than its newest source file.

    Numba looks at the source of the cached function alone, and would go on using machine code into
    which an older version of another file was compiled. (Several processes may do this at once.
    The nodes below the package compile nothing.)
    """
    newest = max(source.stat().st_mtime_ns for source in package.rglob("*.py"))
    for cached in package.rglob("__pycache__/*.nb[ic]"):
        with contextlib.suppress(FileNotFoundError):
            if cached.stat().st_mtime_ns < newest:
                cached.unlink()


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function of arrays that allocates nothing; see the module's text."""
    settings: dict[str, Any] = {
        "cache": True,
        "forceinline": True,
        "error_model": "numpy",
        "_nrt": False,
    }
    return njit(**settings)(function)


def entry_point(function: Any, *arguments: Any) -> Callable[..., Any]:
    """The machine code of a compiled function, for arguments of the types of these.

    A call of the function itself looks up the type of every array first, which takes longer than
    a decision. This does not, so it must only get arguments of the same types: an array is checked
    no further than by its number of axes and the size of its numbers.
    """
    code: Callable[..., Any] = function.compile(tuple(typeof(value) for value in arguments))
    return code


drop_stale_cache(Path(__file__).parent)
