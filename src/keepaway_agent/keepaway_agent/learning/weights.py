"""Weights files: what one player learned, with everything one must know to use it.

A weights file is an ordinary `.npz`, that is a zip archive, with two members: `weights.npy`, the
array (num_actions, num_features, num_tiles, num_tilings) of float64, and `metadata.json`, what
`LearnedWeights` says beside it. Any program reads it, `numpy.load` and `unzip -p` among them; no
member is a pickle, and none is read as one.

A file is written beside its place and then moved there in one step, so that whoever is killed
while writing leaves the old file or the new one, never half of one.
"""

import contextlib
import io
import json
import math
import os
import secrets
import zipfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np

from keepaway_agent.actions import Role, action_names
from keepaway_agent.errors import WeightsError
from keepaway_agent.learning.cmac import NUM_TILINGS, Tiling
from keepaway_agent.learning.features import ORDERINGS, feature_names
from keepaway_agent.learning.sarsa import SarsaConfig

FORMAT: Final = "keepaway-weights"
FORMAT_VERSION: Final = 1
HOURS_PER_CYCLE: Final = 0.1 / 3600
"""Simulated time is counted in cycles of 0.1 s and told in hours."""
MAX_BYTES: Final = 2**28
"""The largest member that is read; eleven against eleven on 100 m x 100 m takes a tenth of it."""


@dataclass(frozen=True, eq=False)
class LearnedWeights:
    """The weights of one player and what they mean.

    Raises:
        WeightsError: weights that do not fit what is said about them, or are not finite.
    """

    values: np.ndarray  # (num_actions, num_features, num_tiles, num_tilings) float64
    role: Role
    num_keepers: int
    num_takers: int
    field_length: float  # [m]
    field_width: float  # [m]
    tiling: Tiling
    ordering: str = "ball"  # of the players in the state variables, a name in features.ORDERINGS
    sarsa: SarsaConfig = field(default_factory=SarsaConfig)
    episodes: int = 0  # that the player learned from, in all tasks if weights were transferred
    hours: float = 0.0  # ditto, simulated
    seed: int = 0  # of the run
    player: str = ""  # whose they were, "keeper_1"
    code_version: str = ""
    created_by: str = ""  # the command or node that made them

    def __post_init__(self) -> None:
        _check_plain_values(self)
        names = feature_names(self.role, self.num_keepers, self.num_takers)
        if self.tiling.feature_names != names:
            raise WeightsError(
                f"state variables {', '.join(self.tiling.feature_names)}:"
                f" a {self.role.name.lower()} in {self.task} has {', '.join(names)}"
            )
        expected = self.tiling.weights_shape(len(self.action_names))
        if self.values.shape != expected:
            raise WeightsError(
                f"weights of shape {self.values.shape}: {self.task} with these tiles has {expected}"
            )
        if self.values.dtype != np.float64 or not np.isfinite(self.values).all():
            raise WeightsError(f"weights of type {self.values.dtype} that are not all finite")

    @property
    def task(self) -> str:
        """For example "3v2"."""
        return f"{self.num_keepers}v{self.num_takers}"

    @property
    def action_names(self) -> tuple[str, ...]:
        """What the player chooses from, in the order of `values`."""
        return action_names(self.role, self.num_keepers)


def check_fits(
    weights: LearnedWeights,
    role: Role,
    num_keepers: int,
    num_takers: int,
    tiling: Tiling,
    ordering: str,
) -> None:
    """Refuse weights that were learned for something else than they are to be used for.

    Raises:
        WeightsError: another role, task, tiling or order of players.
    """
    task = f"{num_keepers}v{num_takers}"
    if (weights.role, weights.task) != (role, task):
        raise WeightsError(
            f"weights of a {weights.role.name.lower()} in {weights.task}, not of a"
            f" {role.name.lower()} in {task}: transfer them first (scripts/transfer.py)"
        )
    if weights.ordering != ordering:
        raise WeightsError(
            f"weights learned with players ordered by {weights.ordering!r}, not by {ordering!r}:"
            " use the same ordering"
        )
    if weights.tiling != tiling:
        raise WeightsError(
            f"weights with other tiles: widths {weights.tiling.widths} up to"
            f" {weights.tiling.highs}, not {tiling.widths} up to {tiling.highs}:"
            " use the same field and profile of widths"
        )


def save_weights(path: Path, weights: LearnedWeights, overwrite: bool = False) -> None:
    """Write a weights file, whole or not at all.

    Args:
        path: where; the folder is made if it is missing.
        weights: what to write.
        overwrite: may a file that is there be replaced?

    Raises:
        WeightsError: a file that is there and must not be replaced, or that cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with _moved_into_place(path, overwrite) as file:
            write_weights(file, weights)
    except OSError as error:
        raise WeightsError(f"{path} cannot be written: {error}") from error


def write_weights(file: BinaryIO, weights: LearnedWeights) -> None:
    """Write a weights file's bytes; equal weights give equal bytes."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        array = io.BytesIO()
        np.lib.format.write_array(array, weights.values, allow_pickle=False)
        metadata = json.dumps(to_metadata(weights), indent=1, allow_nan=False)
        for name, data in (("weights.npy", array.getvalue()), ("metadata.json", metadata)):
            member = zipfile.ZipInfo(name)  # without the time of writing
            member.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(member, data)


def load_weights(path: Path) -> LearnedWeights:
    """Read a weights file.

    Raises:
        WeightsError: no such file, not a whole weights file, one of a newer version, or one whose
            parts do not fit together.
    """
    try:
        with path.open("rb") as file:
            return read_weights(file)
    except WeightsError as error:
        raise WeightsError(f"{path}: {error}") from error
    except OSError as error:
        raise WeightsError(f"{path} cannot be read: {error}") from error


def read_weights(file: BinaryIO) -> LearnedWeights:
    """Read a weights file from an open one; errors as in `load_weights`."""
    try:
        with zipfile.ZipFile(file) as archive:
            metadata = json.loads(_member(archive, "metadata.json"), parse_constant=_no_constant)
            _check_version(metadata)
            values = _read_array(_member(archive, "weights.npy"))
            return from_metadata(metadata, values)
    except (WeightsError, MemoryError):
        raise
    except Exception as error:  # a stranger's bytes may break a reader in any way
        raise WeightsError(f"not a whole weights file ({error!r})") from error


def to_metadata(weights: LearnedWeights) -> dict[str, Any]:
    """What a file says beside the array, as plain data."""
    plain = asdict(weights)
    del plain["values"]
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        **plain,
        "role": weights.role.name.lower(),
        "action_names": weights.action_names,
        "num_tilings": NUM_TILINGS,
    }


def from_metadata(metadata: dict[str, Any], values: np.ndarray) -> LearnedWeights:
    """The weights that `to_metadata` described.

    Raises:
        WeightsError: entries that do not fit together; KeyError, TypeError, ValueError: others.
    """
    implied = {"format", "format_version", "num_tilings", "action_names"}
    rest = {name: entry for name, entry in metadata.items() if name not in implied}
    weights = LearnedWeights(
        values=values,
        role=Role[str(rest.pop("role")).upper()],
        tiling=Tiling(**{name: tuple(each) for name, each in rest.pop("tiling").items()}),
        sarsa=SarsaConfig(**rest.pop("sarsa")),
        **rest,
    )
    expected = json.loads(json.dumps(to_metadata(weights)))
    for name in expected:
        if metadata[name] != expected[name]:
            raise WeightsError(
                f"{name}={metadata[name]}: with the rest of it goes {expected[name]}"
            )
    return weights


def _check_plain_values(weights: LearnedWeights) -> None:
    for name, least in (("num_keepers", 2), ("num_takers", 1), ("episodes", 0), ("seed", 0)):
        value = getattr(weights, name)
        if type(value) is not int or value < least:
            raise WeightsError(f"{name}={value!r}: a whole number from {least} on is needed")
    for name in ("field_length", "field_width", "hours"):
        value = getattr(weights, name)
        if type(value) not in (int, float) or not (math.isfinite(value) and value >= 0):
            raise WeightsError(f"{name}={value!r}: a finite number is needed")
    for name in ("player", "code_version", "created_by"):
        if not isinstance(getattr(weights, name), str):
            raise WeightsError(f"{name}={getattr(weights, name)!r}: a text is needed")
    if weights.ordering not in ORDERINGS:
        raise WeightsError(f"ordering={weights.ordering!r}: one of {', '.join(ORDERINGS)}")


def _check_version(metadata: Any) -> None:
    if not isinstance(metadata, dict) or metadata.get("format") != FORMAT:
        raise WeightsError("not a weights file: its metadata do not say so")
    version = metadata.get("format_version")
    if type(version) is not int or version < 1:
        raise WeightsError(f"format_version={version!r}: there is no such version")
    if version > FORMAT_VERSION:
        raise WeightsError(
            f"format version {version}, but this program reads up to {FORMAT_VERSION}: update it"
        )


def _member(archive: zipfile.ZipFile, name: str) -> bytes:
    size = archive.getinfo(name).file_size
    if size > MAX_BYTES:
        raise WeightsError(f"{name} has {size} bytes: more than {MAX_BYTES} are not read")
    return archive.read(name)


def _read_array(data: bytes) -> np.ndarray:
    """The array of a `.npy` file's bytes, believing its header only as far as there are bytes."""
    file = io.BytesIO(data)
    if np.lib.format.read_magic(file) != (1, 0):
        raise WeightsError("weights.npy is not of npy format 1.0")
    shape, in_columns, dtype = np.lib.format.read_array_header_1_0(file)
    rest = data[file.tell() :]
    if in_columns or dtype != np.dtype("<f8") or len(rest) != 8 * math.prod(shape):
        raise WeightsError(f"weights.npy holds {dtype} of shape {shape} in {len(rest)} bytes")
    return np.frombuffer(rest, dtype="<f8").astype(np.float64).reshape(shape)


def _no_constant(name: str) -> None:
    raise WeightsError(f"{name} in the metadata")


@contextlib.contextmanager
def _moved_into_place(path: Path, overwrite: bool) -> Iterator[BinaryIO]:
    """A file to write that appears at `path` once it is whole and on the disk."""
    beside = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.tmp")
    try:
        with beside.open("xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        if overwrite:
            beside.replace(path)
        else:
            path.hardlink_to(beside)  # unlike a move this fails if there is a file
    except FileExistsError as error:
        raise WeightsError(f"{path} is there already: overwrite it or name another") from error
    finally:
        beside.unlink(missing_ok=True)
