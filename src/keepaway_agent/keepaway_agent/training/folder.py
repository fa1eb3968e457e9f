"""The folder of a training's results: a trial appears in it whole or not at all."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import logging
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from keepaway_agent.actions import Outcome, Role
from keepaway_agent.errors import AgentError, WeightsError
from keepaway_agent.files import check_writable, name_beside, write_whole
from keepaway_agent.learning.weights import LearnedWeights, load_weights, save_weights
from keepaway_agent.settings import build, flat
from keepaway_agent.texts import one_line
from keepaway_agent.training.training import Training
from keepaway_agent.training.trial import TrialResult
from keepaway_sim.version import code_version

TRAINING_FORMAT: Final = "keepaway-training"
TRAINING_VERSION: Final = 1

log = logging.getLogger(__name__)


class TrainingFolder:
    """A training's results on the disk.

    Attributes:
        path: the folder.
        done: numbers of the trials that are there.
    """

    def __init__(
        self, path: Path, training: Training, command: str = "", any_code: bool = False
    ) -> None:
        """Begin a folder, or resume the existing one.

        Args:
            path: where; made if it is missing.
            training: whose results it holds.
            command: that makes them, for the record.
            any_code: resume also if another version of the code began it.

        Raises:
            AgentError: a folder of something else, or of other settings or another version.
        """
        self.path, self._training, self._command = path, training, command
        settings = flat(training)
        self._record = {
            "format": TRAINING_FORMAT,
            "format_version": TRAINING_VERSION,
            "settings": settings,
            "code_version": code_version(),
            "command": command,
        }
        try:
            path.mkdir(parents=True, exist_ok=True)
            if (path / "training.json").exists():
                _check_same(path, self._record, any_code)
            elif any(path.iterdir()):
                raise AgentError(f"{path} holds something else: name another folder")
            check_writable(path)
            if not (path / "training.json").exists():
                text = json.dumps(self._record, indent=1, allow_nan=False)
                write_whole(path / "training.json", text)
        except OSError as error:
            raise AgentError(f"{path} cannot be used: {error}") from error
        self.done = sorted(int(trial.name[6:]) for trial in path.glob("trial_[0-9]*"))

    @contextlib.contextmanager
    def lock(self) -> Iterator[None]:
        """Keep other processes from training into the folder, while the block lasts.

        Raises:
            AgentError: another one does.
        """
        with (self.path / "training.json").open("rb") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise AgentError(
                    f"{self.path}: another process trains into it; name another folder"
                ) from None
            except OSError as error:  # some network file systems know no locks
                log.warning("%s cannot be locked (%s): train there once at a time", file, error)
            yield

    def save(self, result: TrialResult) -> None:
        """Put a finished trial into the folder, whole or not at all.

        Raises:
            AgentError: it cannot be written; the message says where what was written of it is.
        """
        number = int(result.trial.label)
        beside = name_beside(self._folder(number))
        try:
            beside.mkdir()
            write_whole(beside / "episodes.csv", _episodes_text(result))
            for weights in self._learned(result):
                save_weights(beside / f"{weights.player}.npz", weights)
                if number == 0:
                    save_weights(self.path / f"{weights.player}.npz", weights, overwrite=True)
            beside.rename(self._folder(number))
        except (OSError, WeightsError) as error:
            raise AgentError(
                f"trial {number} cannot be written: {error}; what was written of it is in {beside}"
            ) from error
        self.done = sorted([*self.done, number])
        for cut in self.path.glob(f".{self._folder(number).name}.*.tmp"):
            shutil.rmtree(cut, ignore_errors=True)  # of earlier attempts; the trial is whole now

    def episodes(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Durations [cycles] and outcomes of a trial's episodes, (num_episodes,) each.

        Raises:
            AgentError: the file was changed by something else.
        """
        return _read_episodes(self._folder(number) / "episodes.csv")

    def weights_hash(self, numbers: Iterable[int]) -> str:
        """SHA-256 of every weight that the players of these trials have learned, in order.

        It depends on the settings, the seed and the code alone: not on the run, on how many
        processes played, nor on the version of Python.
        """
        digest = hashlib.sha256()
        for number in numbers:
            for path in sorted(self._folder(number).glob("*.npz")):
                digest.update(load_weights(path).values.tobytes())
        return digest.hexdigest()

    def _folder(self, number: int) -> Path:
        return self.path / f"trial_{number:04}"

    def _learned(self, result: TrialResult) -> Iterator[LearnedWeights]:
        """A weights file's content for every player that learned."""
        config, training = self._training.trainer, self._training
        task, before = config.task, training.start()
        for own, name in enumerate(task.player_names):
            role = Role.KEEPER if own < task.num_keepers else Role.TAKER
            team = result.keeper_weights if role == Role.KEEPER else result.taker_weights
            if team is None:
                continue
            earlier = before[own] if before and role == Role.KEEPER else None
            yield LearnedWeights(
                values=team[own if role == Role.KEEPER else own - task.num_keepers],
                role=role,
                num_keepers=task.num_keepers,
                num_takers=task.num_takers,
                field_length=task.field_length,
                field_width=task.field_width,
                tiling=config.tiling(role),
                ordering=config.learner.ordering,
                sarsa=config.learner.sarsa,
                episodes=len(result.durations) + (earlier.episodes if earlier else 0),
                hours=result.hours + (earlier.hours if earlier else 0.0),
                seed=training.seed,
                player=name,
                code_version=code_version(),
                created_by=one_line(self._command),
            )


class TrainingRecord(NamedTuple):
    """A training's folder that was read."""

    settings: Training
    code_version: str  # that it was begun with
    command: str
    episodes: dict[int, tuple[np.ndarray, np.ndarray]]  # durations [cycles], outcomes by trial


def read_training(path: Path) -> TrainingRecord:
    """Read a training's settings and the episodes of all its finished trials.

    Raises:
        AgentError: no training's folder, or one that something else has changed.
    """
    settings, record = _read_record(path)
    trials = sorted(path.glob("trial_[0-9]*"))
    episodes = {int(trial.name[6:]): _read_episodes(trial / "episodes.csv") for trial in trials}
    return TrainingRecord(settings, record["code_version"], record.get("command", ""), episodes)


def _read_episodes(path: Path) -> tuple[np.ndarray, np.ndarray]:
    try:
        rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()[1:]]
        durations = np.array([int(cycles) for _, cycles, _ in rows], dtype=np.int32)
        outcomes = np.array([Outcome[name.upper()] for *_, name in rows], dtype=np.int8)
    except (OSError, ValueError, KeyError, OverflowError) as error:
        raise AgentError(f"{path}: not a trial's episodes: {error!r}") from error
    return durations, outcomes


def _read_record(path: Path) -> tuple[Training, dict[str, Any]]:
    """What `training.json` says."""
    file = path / "training.json"
    try:
        record: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        settings = build(Training, record["settings"])
        record["code_version"] = str(record["code_version"])
    except OSError as error:
        raise AgentError(f"{file} cannot be read: {error}") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise AgentError(f"{file} is no training's: {error!r}") from error
    return settings, record


def _episodes_text(result: TrialResult) -> str:
    names = [Outcome(code).name.lower() for code in result.outcomes]
    rows = zip(result.durations, names, strict=True)
    lines = [f"{number},{cycles},{name}" for number, (cycles, name) in enumerate(rows)]
    return "\n".join(["episode,cycles,outcome", *lines, ""])


def _check_same(path: Path, record: dict[str, Any], any_code: bool) -> None:
    """Refuse to mix results of different settings or versions."""
    settings, there = _read_record(path)
    before = flat(settings)
    for name, value in record["settings"].items():
        if before.get(name) != value:
            raise AgentError(
                f"{path} holds a training with {name}={before.get(name)!r}, not {value!r}:"
                " use the same settings, or name another folder"
            )
    version = there["code_version"]
    if version != record["code_version"] and not any_code:
        raise AgentError(
            f"{path} was begun by version {version}, this is {record['code_version']}:"
            " name another folder, or allow it (--any-code)"
        )
