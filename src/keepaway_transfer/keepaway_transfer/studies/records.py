"""What is kept of a study's trials: a record each, all of them in one Parquet file.

A trial of Table 2 plays 12,000 episodes and more. Its record keeps the first and the last episodes
as they were, of those between the sum of every 50 (of every 20th part of the study's window), and
exactly when the study's own threshold was passed. A thousand trials take less than a megabyte, and
every table and figure is made from them alone. Another threshold is looked for at the ends of
blocks; learning curves are read there as well.
"""

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from keepaway_agent.files import moved_into_place
from keepaway_agent.texts import shown
from keepaway_sim.world.config import CYCLE_TIME
from keepaway_transfer import metrics
from keepaway_transfer.errors import StudyError

RECORDS_FILE = "trials.parquet"
TRIALS_FORMAT = {"format": "keepaway trials", "version": "1"}
BLOCKS_A_WINDOW = 20

_CYCLES = pa.list_(pa.uint32())
TRIALS_SCHEMA = pa.schema(
    [
        ("row", pa.string()),
        ("number", pa.uint32()),
        ("source_episodes", pa.uint32()),
        ("source_hours", pa.float64()),
        ("start_level", pa.float64()),
        ("crossed", pa.bool_()),
        ("crossing_episodes", pa.uint32()),
        ("crossing_hours", pa.float64()),
        ("episodes", pa.uint32()),
        ("hours", pa.float64()),
        ("initial", pa.float64()),
        ("final", pa.float64()),
        ("greedy", pa.float64()),
        ("block", pa.uint32()),
        ("blocks", _CYCLES),
        ("first", _CYCLES),
        ("last", _CYCLES),
        ("code_version", pa.string()),
    ],
    metadata=TRIALS_FORMAT,
)


@dataclass(frozen=True)
class Record:
    """What is kept of one trial. Hours are simulated; None is what is not known."""

    row: str
    number: int  # within the row
    source_episodes: int
    source_hours: float
    start_level: float | None  # [s] of the values that the target task began with (`parts`)
    crossed: bool  # did the windowed mean pass the study's threshold?
    crossing_episodes: int  # of the target task until then, or all of them
    crossing_hours: float
    episodes: int  # of the target task in all
    hours: float
    initial: float  # [s] mean duration of the first episodes
    final: float  # [s] mean duration of the last window of episodes
    greedy: float | None  # [s] mean duration without learning and exploring
    block: int  # episodes in a block
    blocks: tuple[int, ...]  # duration of each whole block of episodes [cycles of 0.1 s]
    first: tuple[int, ...]  # durations of the first episodes [cycles]
    last: tuple[int, ...]  # and of the last ones
    code_version: str

    @property
    def key(self) -> tuple[str, int]:
        """Identifies this trial among all of its study."""
        return self.row, self.number

    @property
    def has_episodes(self) -> bool:
        """Are there episodes to draw curves of? Records of an old table have only its numbers."""
        return bool(self.blocks)


def block_of(window: int) -> int:
    """Episodes in a block where the mean is over this many.

    >>> block_of(1000), block_of(200), block_of(5)
    (50, 10, 1)
    """
    return window // BLOCKS_A_WINDOW if window % BLOCKS_A_WINDOW == 0 else 1


def durations_record(
    cycles: Sequence[int], greedy_cycles: Sequence[int], threshold: float, window: int
) -> dict[str, Any]:
    """The entries of a record that follow from durations [cycles] of episodes in playing order."""
    seconds = np.asarray(cycles, dtype=np.float64) * CYCLE_TIME
    crossing = metrics.time_to_threshold(seconds, threshold, window)
    block = block_of(window)
    whole = np.asarray(cycles[: len(cycles) // block * block], dtype=np.int64)
    return {
        "crossed": crossing.reached,
        "crossing_episodes": crossing.episodes,
        "crossing_hours": crossing.hours,
        "episodes": len(cycles),
        "hours": metrics.hours(seconds),
        "initial": metrics.initial_performance(seconds),
        "final": metrics.asymptotic_performance(seconds, window),
        "greedy": float(np.mean(greedy_cycles)) * CYCLE_TIME if len(greedy_cycles) else None,
        "block": block,
        "blocks": tuple(whole.reshape(-1, block).sum(axis=1).tolist()),
        "first": tuple(cycles[: metrics.FIRST_EPISODES]),
        "last": tuple(cycles[-metrics.FIRST_EPISODES :]),
    }


def write_records(path: Path, records: Iterable[Record]) -> None:
    """Write records, all of a study, as a Parquet file that appears once it is whole.

    The same records give the same bytes.
    """
    rows = [dataclasses.asdict(one) for one in sorted(records, key=lambda one: one.key)]
    table = pa.Table.from_pylist(rows, schema=TRIALS_SCHEMA)
    with moved_into_place(path, overwrite=True) as file:
        pq.write_table(
            table, file, compression="zstd", compression_level=19,
            use_dictionary=["row", "code_version"],
            column_encoding=dict.fromkeys(
                [f"{name}.list.element" for name in ("blocks", "first", "last")],
                "DELTA_BINARY_PACKED",
            ),
        )  # fmt: skip


def read_records(path: Path) -> tuple[Record, ...]:
    """Read what `write_records` wrote.

    Raises:
        StudyError: no such file, or one that holds something else; the message has the path.
    """
    try:
        table = pq.read_table(path)
    except FileNotFoundError:
        raise StudyError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise StudyError(f"{path}: not a Parquet file: {error}") from error
    found = {k.decode(): v.decode() for k, v in (table.schema.metadata or {}).items()}
    if not TRIALS_FORMAT.items() <= found.items():
        raise StudyError(f"{path}: not trials of a study: its metadata are {shown(found)}")
    names = [field.name for field in dataclasses.fields(Record)]
    if missing := set(names) - set(table.column_names):
        raise StudyError(f"{path}: without the columns {', '.join(sorted(missing))}")
    return tuple(Record(**{name: _plain(row[name]) for name in names}) for row in table.to_pylist())


def _plain(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
