"""The soccer server's keepaway log (.kwy): one line an episode.

Comment lines start with `#`. The columns, separated by tabs, are: episode number (from 1), start
and end and duration in cycles of 0.1 s, and how it ended: `o` out of bounds, `t` taken away.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from keepaway_sim.world.config import CYCLE_TIME
from keepaway_transfer.errors import LogError

_HEADER = """\
# Keepers: {num_keepers}
# Takers:  {num_takers}
# Region:  {length:g} x {width:g}
#
# Description of Fields:
# 1) Episode number
# 2) Start time in simulator steps (100ms)
# 3) End time in simulator steps (100ms)
# 4) Duration in simulator steps (100ms)
# 5) (o)ut of bounds / (t)aken away
#
"""


@dataclass(frozen=True)
class KeepawayLog:
    """The episodes of a log in order; one array entry an episode."""

    num_keepers: int
    num_takers: int
    field_size: tuple[float, float]  # length, width [m]
    cycles: NDArray[np.int64]  # (num_episodes,) duration [cycles of 0.1 s]
    out_of_bounds: NDArray[np.bool_]  # (num_episodes,) False: taken away

    @property
    def durations(self) -> NDArray[np.float64]:
        """How long each episode lasted, (num_episodes,) [s]."""
        return self.cycles.astype(np.float64) * CYCLE_TIME


def read_kwy(path: Path | str) -> KeepawayLog:
    """Read a log; LogError names the line that cannot be read."""
    header: dict[str, str] = {}
    cycles, out_of_bounds = [], []
    with open(path, encoding="ascii", errors="replace") as lines:
        for number, line in enumerate(lines, start=1):
            if line.startswith("#"):
                key, _, value = line[1:].partition(":")
                header[key.strip()] = value.strip()
            elif line.strip():
                duration, out = _episode(line, f"{path}, line {number}")
                cycles.append(duration)
                out_of_bounds.append(out)
    num_keepers, num_takers, field_size = _match(header, str(path))
    return KeepawayLog(
        num_keepers,
        num_takers,
        field_size,
        np.array(cycles, np.int64),
        np.array(out_of_bounds, bool),
    )


def write_kwy(
    path: Path | str,
    cycles: ArrayLike,
    out_of_bounds: Iterable[bool],
    *,
    num_keepers: int,
    num_takers: int,
    field_size: tuple[float, float],
) -> None:
    """Write episodes of these durations [cycles], played one after the other.

    Raises FileExistsError rather than overwrite a file.
    """
    ends = np.cumsum(cycles)
    with open(path, "x", encoding="ascii") as log:
        log.write(
            _HEADER.format(
                num_keepers=num_keepers,
                num_takers=num_takers,
                length=field_size[0],
                width=field_size[1],
            )
        )
        for number, (end, duration, out) in enumerate(
            zip(ends, np.asarray(cycles), out_of_bounds, strict=True), start=1
        ):
            log.write(f"{number}\t{end - duration}\t{end}\t{duration}\t{'o' if out else 't'}\n")


def _episode(line: str, where: str) -> tuple[int, bool]:
    try:
        _, start, end, duration, outcome = line.split()
        if int(end) - int(start) != int(duration) or int(duration) < 0 or outcome not in ("o", "t"):
            raise ValueError
    except ValueError:
        raise LogError(f"{where}: not an episode: {line.strip()!r}") from None
    return int(duration), outcome == "o"


def _match(header: dict[str, str], path: str) -> tuple[int, int, tuple[float, float]]:
    try:
        length, width = header["Region"].split(" x ")
        return int(header["Keepers"]), int(header["Takers"]), (float(length), float(width))
    except (KeyError, ValueError) as error:
        raise LogError(f"{path}: no header with Keepers, Takers and Region: {error}") from error
