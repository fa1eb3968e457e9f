"""Weights files: what one player learned, with everything one must know to use it.

A weights file is an ordinary `.npz`, that is a zip archive, with two members: `weights.npy`, the
array (num_actions, num_features, num_tiles, num_tilings) of float64, and `metadata.json`, what
`LearnedWeights` says beside it. Any program reads it, `numpy.load` and `unzip -p` among them; no
member is a pickle, and none is read as one.

Files come from anywhere, so reading one believes nothing: the bytes that are read and unpacked are
bounded, numbers are checked before anything is sized by them, texts are one printable line.
"""

import io
import json
import math
import zipfile
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np

from keepaway_agent.actions import Role, action_names
from keepaway_agent.errors import WeightsError
from keepaway_agent.files import moved_into_place
from keepaway_agent.learning.cmac import NUM_TILINGS, Tiling
from keepaway_agent.learning.config import SarsaConfig
from keepaway_agent.learning.features import ORDERINGS, feature_names
from keepaway_agent.settings import build, flat
from keepaway_agent.texts import one_line, shown

FORMAT: Final = "keepaway-weights"
FORMAT_VERSION: Final = 1
HOURS_PER_CYCLE: Final = 0.1 / 3600
"""Simulated time is counted in cycles of 0.1 s and reported in hours."""
MAX_BYTES: Final = 2**26
"""The largest array that is read; eleven against eleven on 100 m x 100 m takes a fifth of it."""
MAX_METADATA_BYTES: Final = 2**20
MAX_MEMBERS: Final = 16
"""Members that an archive may have; what others than the two say is not read."""
MAX_TEAM_SIZE: Final = 11
"""Players of a team; the simulator knows no larger one."""
MAX_FIELD_SIDE: Final = 100.0
"""Length and width of a field [m]; the simulator knows no larger one."""
MAX_WEIGHT: Final = 1e9
"""Greatest size of a weight [cycles]; learned ones are smaller than the longest episode."""
MAX_COUNT: Final = 2**63 - 1
"""Greatest number of episodes, and greatest seed: those of a ROS parameter."""


@dataclass(frozen=True, eq=False)
class LearnedWeights:
    """The weights of one player and what they mean.

    Raises:
        WeightsError: weights that do not fit their description, or of a size that no player
            learns; a number or text outside its range.
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
                f"state variables {shown(', '.join(self.tiling.feature_names))}:"
                f" a {self.role.name.lower()} in {self.task} has {', '.join(names)}"
            )
        expected = self.tiling.weights_shape(len(self.action_names))
        if self.values.shape != expected:
            raise WeightsError(
                f"weights of shape {self.values.shape}: {self.task} with these tiles has {expected}"
            )
        if self.values.dtype != np.float64:
            raise WeightsError(f"weights of type {self.values.dtype}, not of float64")
        if not np.abs(self.values).max() <= MAX_WEIGHT:  # nor is NaN
            raise WeightsError(f"weights that are not all finite and within +-{MAX_WEIGHT:g}")

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
        with moved_into_place(path, overwrite) as file:
            write_weights(file, weights)
    except OSError as error:
        if isinstance(error, FileExistsError) and path.exists():  # and not a folder's in the way
            raise WeightsError(f"{path} is there already: overwrite it or name another") from error
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
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise WeightsError("no ordinary file")  # a pipe may never end
        with path.open("rb") as file:
            return read_weights(file)
    except WeightsError as error:
        raise WeightsError(f"{path}: {error}") from error
    except OSError as error:
        raise WeightsError(f"{path} cannot be read: {error}") from error


def read_weights(file: BinaryIO) -> LearnedWeights:
    """Read a weights file from an open one; errors as in `load_weights`."""
    try:
        with zipfile.ZipFile(_bounded(file)) as archive:
            packed = _member(archive, "metadata.json", MAX_METADATA_BYTES)
            metadata = json.loads(packed, parse_constant=_no_constant)
            _check_version(metadata)
            values = _read_array(_member(archive, "weights.npy", MAX_BYTES))
            return from_metadata(metadata, values)
    except (WeightsError, MemoryError):
        raise
    except Exception as error:  # untrusted bytes may break a reader in any way
        raise WeightsError(f"not a whole weights file ({shown(error)})") from error


def to_metadata(weights: LearnedWeights) -> dict[str, Any]:
    """What a file says beside the array, as plain data."""
    plain = asdict(weights)
    del plain["values"]
    plain["sarsa"] = flat(weights.sarsa)
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
        sarsa=build(SarsaConfig, rest.pop("sarsa")),
        **rest,
    )
    expected = json.loads(json.dumps(to_metadata(weights), allow_nan=False))
    for name in expected:
        if metadata[name] != expected[name]:
            raise WeightsError(
                f"{name}={shown(metadata[name])}: with the rest of it goes {shown(expected[name])}"
            )
    return weights


def _check_plain_values(weights: LearnedWeights) -> None:
    for name, least, most in (
        ("num_keepers", 2, MAX_TEAM_SIZE),
        ("num_takers", 1, MAX_TEAM_SIZE),
        ("episodes", 0, MAX_COUNT),
        ("seed", 0, MAX_COUNT),
    ):
        value = getattr(weights, name)
        if type(value) is not int or not least <= value <= most:
            raise WeightsError(f"{name}={shown(value)}: a whole number from {least} to {most}")
    for name, greatest in (
        ("field_length", MAX_FIELD_SIDE),
        ("field_width", MAX_FIELD_SIDE),
        ("hours", MAX_COUNT * HOURS_PER_CYCLE),
    ):
        _check_number(name, getattr(weights, name), 0.0, greatest)
    for name in ("lows", "highs", "widths"):
        for value in getattr(weights.tiling, name):
            _check_number(name, value, 1e-3 if name == "widths" else 0.0, MAX_FIELD_SIDE * 2)
    for name in ("player", "code_version", "created_by"):
        _check_text(name, getattr(weights, name))
    if {"/", "\\"} & set(weights.player):
        raise WeightsError(f"player={shown(weights.player)}: a name without path separators")
    if not isinstance(weights.ordering, str) or weights.ordering not in ORDERINGS:
        raise WeightsError(f"ordering={shown(weights.ordering)}: one of {', '.join(ORDERINGS)}")


def _check_number(name: str, value: Any, least: float, most: float) -> None:
    if type(value) not in (int, float) or not least <= value <= most:
        raise WeightsError(f"{name}={shown(value)}: a number from {least:g} to {most:g}")


def _check_text(name: str, value: object) -> None:
    if not isinstance(value, str) or value != one_line(value):
        raise WeightsError(f"{name}={shown(value)}: a printable text of one line")


def _check_version(metadata: Any) -> None:
    if not isinstance(metadata, dict) or metadata.get("format") != FORMAT:
        raise WeightsError("not a weights file: its metadata do not say so")
    version = metadata.get("format_version")
    if type(version) is not int or version < 1:
        raise WeightsError(f"format_version={shown(version)}: there is no such version")
    if version > FORMAT_VERSION:
        raise WeightsError(
            f"format version {shown(version)}, but this program reads up to {FORMAT_VERSION}:"
            " update it"
        )


def _bounded(file: BinaryIO) -> BinaryIO:
    """A file's bytes, if they are no more than a weights file's can be."""
    file.seek(0)
    data = file.read(MAX_BYTES + MAX_METADATA_BYTES)
    if file.read(1):
        raise WeightsError(f"more than {len(data)} bytes, which no weights file has")
    if data.count(b"PK\1\2") > MAX_MEMBERS:  # so begins an entry of an archive's list of members
        raise WeightsError(f"an archive of more than {MAX_MEMBERS} members")
    return io.BytesIO(data)


def _member(archive: zipfile.ZipFile, name: str, most: int) -> bytes:
    """A member's bytes, if they are no more than `most`, whatever they would unpack to."""
    entry = archive.getinfo(name)
    if entry.file_size > most:
        raise WeightsError(f"{name} has {entry.file_size} bytes: more than {most} are not read")
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise WeightsError(f"{name} is packed by method {entry.compress_type}: use deflate")
    with archive.open(entry) as member:
        return member.read(entry.file_size)  # and unpacks no more, where `read()` unpacks it all


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
