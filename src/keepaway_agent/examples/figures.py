"""What an example has measured, kept as JSON beside its picture with the command that made it."""

import json
import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from keepaway_sim.version import code_version


def made_here() -> dict[str, str]:
    """This command, and the version of the code that it runs."""
    return {"command": shlex.join([".venv/bin/python", *sys.argv]), "code_version": code_version()}


def keep(folder: Path, name: str, **data: Any) -> None:
    """Write `figures.json`; arrays become lists with three decimals."""
    text = json.dumps({name: made_here() | _plain(data)}, indent=1, allow_nan=False)
    (folder / "figures.json").write_text(text + "\n")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    return np.round(value, 3).tolist() if isinstance(value, np.ndarray) else value
