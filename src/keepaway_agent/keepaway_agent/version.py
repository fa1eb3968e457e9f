"""The version of the code that made a result, with the git commit where there is one.

The packages of the world and of the agents share no code, so each has this same file; a contract
test holds the two together.
"""

from __future__ import annotations

import functools
import subprocess
from pathlib import Path

__version__ = "0.1.0"


@functools.cache
def code_version() -> str:
    """For example "0.1.0+g1a2b3c4" in a checkout, "0.1.0+g1a2b3c4.dirty" with changes in src.

    An installed package has no commit, not even that of a repository it is installed below.
    """
    try:
        _git("ls-files", "--error-unmatch", "--", Path(__file__).name)
        commit = _git("rev-parse", "--short", "HEAD")
        dirty = _git("status", "--porcelain", "--untracked-files=no", "--", "../..")
    except (OSError, subprocess.CalledProcessError, subprocess.TimeoutExpired):
        return __version__
    return f"{__version__}+g{commit}{'.dirty' if dirty else ''}"


def _git(*arguments: str) -> str:
    done = subprocess.run(
        ["git", "-C", str(Path(__file__).resolve().parent), *arguments],
        capture_output=True,
        text=True,
        check=True,
        timeout=10,
    )
    return done.stdout.strip()
