"""A training as data: what is trained, played in any number of processes, kept in a folder.

A folder of results holds `training.json` (settings, command, code version) and a folder for each
finished trial: `trial_0003/` with `episodes.csv`, a line an episode, and a weights file for every
player that learned. A trial's folder appears in one step when it is whole, so a training can be
stopped at any moment, and the same training goes on with the trials that are missing. What the
players of the first trial learned lies in the folder itself too, for whoever needs just a team.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import io
import json
import math
import multiprocessing
import os
import queue
import shutil
import signal
import threading
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from keepaway_agent.actions import Outcome, Role
from keepaway_agent.errors import AgentError
from keepaway_agent.learning.sarsa import SarsaConfig
from keepaway_agent.learning.weights import (
    HOURS_PER_CYCLE,
    LearnedWeights,
    check_fits,
    load_weights,
    save_weights,
    write_weights,
)
from keepaway_agent.playing.agent import AgentConfig
from keepaway_agent.playing.policies import TAKER_DECISION_INTERVAL, make_player
from keepaway_agent.training.trainer import (
    Progress,
    StopRule,
    Trainer,
    TrainerConfig,
    Trial,
    TrialResult,
    trial_seed,
)
from keepaway_agent.training.trial_recorder import TrialRecorder
from keepaway_sim.task import Task
from keepaway_sim.version import code_version
from keepaway_sim.world import config as world_config

NUM_FIELDS: Final = 128
"""Fields played in lock-step by one process."""
RECORDED_TRIAL: Final = 0
"""The trial that can be recorded: it is the same as a match of ROS nodes with the seed."""
FORMAT: Final = "keepaway-training"
FORMAT_VERSION: Final = 1


@dataclass(frozen=True)
class Training:
    """Everything that decides what the trials of a training give.

    Raises:
        AgentError, KeepawayError: settings with which nothing can be trained, by name.
    """

    task: str = "3v2"  # keepers v takers
    field: str = "25x25"  # length x width [m]
    profile: str = "2005"  # of the world's constants; or v19
    visible_angle: float = 360.0  # [deg] of the players' view cone
    policy: str = "learn"  # of the keepers: random, hold, hand, learn or greedy
    taker_policy: str = "hand"  # random, hand, learn or greedy
    episodes: int = 1000  # of every trial
    hours: float = 0.0  # simulated, after which a trial stops anyway; 0 sets no limit
    seed: int = 0  # of all trials; each has its own random numbers
    load_weights: str = ""  # weights file for all keepers, or folder with keeper_1.npz, ...
    alpha: float = 0.125  # step size, shared out among the active tiles
    gamma: float = 1.0  # discount per cycle
    lambda_: float = 0.0  # decay of the traces per decision
    epsilon: float = 0.01  # share of decisions that are random
    min_trace: float = 0.01  # smaller traces count as 0
    ordering: str = "ball"  # what ranks players: their distance to the ball, or to K1 (k1)
    tile_widths: str = "default"  # or framework
    decision_interval: int = TAKER_DECISION_INTERVAL  # [cycles] between a taker's choices
    shared: bool = False  # all keepers of a trial learn one value function

    def __post_init__(self) -> None:
        if not self.hours >= 0:
            raise AgentError(f"hours={self.hours}: give simulated hours, or 0 for no limit")
        if self.seed < 0:
            raise AgentError(f"seed={self.seed}: give 0 or a positive number")
        config, _ = self.trainer, self.stop
        num_keepers = config.task.num_keepers
        make_player(0, num_keepers, self.policy, self.ordering)
        make_player(num_keepers, num_keepers, self.taker_policy, interval=self.decision_interval)
        config.tiling(Role.KEEPER)

    @property
    def trainer(self) -> TrainerConfig:
        """What the trainer must know of it."""
        sarsa = {entry.name: getattr(self, entry.name) for entry in dataclasses.fields(SarsaConfig)}
        return TrainerConfig(
            task=Task.parse(self.task, self.field),
            world=world_config.profile(self.profile, visible_angle=self.visible_angle),
            sarsa=SarsaConfig(**sarsa),
            ordering=self.ordering,
            tile_widths=self.tile_widths,
            decision_interval=self.decision_interval,
            shared=self.shared,
        )

    @property
    def stop(self) -> StopRule:
        """When a trial is over."""
        cycles = round(self.hours / HOURS_PER_CYCLE)
        return StopRule(max_episodes=self.episodes, max_cycles=cycles or None)

    def start(self) -> list[LearnedWeights]:
        """The weights that the keepers start from; none if they know nothing.

        Raises:
            WeightsError: files that cannot be read or belong to something else.
        """
        if not self.load_weights:
            return []
        path, config = Path(self.load_weights), self.trainer
        names = config.task.player_names[: config.task.num_keepers]
        files = [path / f"{name}.npz" for name in names] if path.is_dir() else [path] * len(names)
        weights = [load_weights(file) for file in files]
        tiling = config.tiling(Role.KEEPER)
        for each in weights:
            teams = config.task.num_keepers, config.task.num_takers
            check_fits(each, Role.KEEPER, *teams, tiling, self.ordering)
        return weights

    def trial(
        self, number: int, weights: np.ndarray | None, recorder: TrialRecorder | None = None
    ) -> Trial:
        """Trial `number`, its keepers starting from (num_keepers, ..) weights."""
        return Trial(
            seed=trial_seed(self.seed, number),
            stop=self.stop,
            keeper_policy=self.policy,
            taker_policy=self.taker_policy,
            keeper_weights=weights,
            label=number,
            watch=recorder if number == RECORDED_TRIAL else None,
        )

    def recorder(
        self, path: Path, episodes: Collection[int] | None = None, command: str = ""
    ) -> TrialRecorder:
        """What records RECORDED_TRIAL to `path`; only these episodes, or all.

        Raises:
            WeightsError: as in `start`.
        """
        names = self.trainer.task.player_names
        info = {"command": command}
        if not self.shared:  # no player that learns alone could be checked against those
            info["agents"] = json.dumps(dict(zip(names, self._agents(), strict=True)))
        starts = zip(names, self.start(), strict=False)
        files = {f"{name}.npz": _weights_bytes(weights) for name, weights in starts}
        wanted = None if episodes is None else frozenset(episodes).__contains__
        return TrialRecorder(path, self.seed, wanted, info, files)

    def _agents(self) -> list[dict[str, Any]]:
        """How each player plays, as the fields of AgentConfig."""
        own = [entry.name for entry in dataclasses.fields(AgentConfig) if hasattr(self, entry.name)]
        settings = {name: getattr(self, name) for name in own}
        task = self.trainer.task
        takers = settings | {"policy": self.taker_policy}
        return [settings] * task.num_keepers + [takers] * task.num_takers


def play(
    training: Training,
    numbers: Sequence[int],
    processes: int = 1,
    num_fields: int = NUM_FIELDS,
    watch: Callable[[Progress], None] | None = None,
    recorder: TrialRecorder | None = None,
) -> Generator[TrialResult, None, None]:
    """Play trials, and give each one's result as soon as it is over; `label` is its number.

    Args:
        training: what is trained.
        numbers: of the trials.
        processes: over how many processes they are spread; results do not depend on it.
        num_fields: trials that a process plays side by side.
        watch: is told of the progress several times a second.
        recorder: records RECORDED_TRIAL, if that is among the numbers; see `Training.recorder`.

    Raises:
        AgentError: a training that cannot be played, or a process that died.
        KeepawayError: something is in the place of the bag.
    """
    processes = max(1, min(processes, len(numbers)))
    num_fields = max(1, min(num_fields, math.ceil(len(numbers) / processes)))
    if processes == 1:
        yield from _play_here(training, iter(numbers), num_fields, watch, recorder)
        return
    context = multiprocessing.get_context("spawn")
    said: multiprocessing.Queue[Any] = context.Queue()
    taken = context.Value("q", 0)
    workers = [
        context.Process(
            target=_work,
            args=(training, numbers, taken, num_fields, said, place, recorder),
            daemon=True,
        )
        for place in range(processes)
    ]
    for worker in workers:
        worker.start()
    try:
        yield from _gather(workers, said, len(numbers), watch)
    finally:
        for worker in workers:
            worker.terminate()
        for worker in workers:
            worker.join()


def _play_here(
    training: Training,
    numbers: Iterator[int],
    num_fields: int,
    watch: Callable[[Progress], None] | None,
    recorder: TrialRecorder | None,
) -> Generator[TrialResult, None, None]:
    loaded = training.start()
    weights = np.stack([each.values for each in loaded]) if loaded else None
    trials = (training.trial(number, weights, recorder) for number in numbers)
    with contextlib.closing(recorder) if recorder else contextlib.nullcontext():
        for result in Trainer(training.trainer, num_fields).run(trials, watch):
            if recorder and result.trial.label == RECORDED_TRIAL:
                recorder.close()
            yield dataclasses.replace(result, trial=dataclasses.replace(result.trial, watch=None))


def _work(
    training: Training,
    numbers: Sequence[int],
    taken: Any,
    num_fields: int,
    said: Any,
    place: int,
    recorder: TrialRecorder | None,
) -> None:
    """A process: play one trial after the other of those that nobody has taken yet."""
    end_with_parent()

    def next_numbers() -> Iterator[int]:
        while True:
            with taken.get_lock():
                position, taken.value = taken.value, taken.value + 1
            if position >= len(numbers):
                return
            yield numbers[position]

    def tell(news: Any) -> None:
        said.put((place, dataclasses.replace(news)))  # a copy: it is sent a little later

    try:
        for result in _play_here(training, next_numbers(), num_fields, tell, recorder):
            tell(result)
    except ValueError as error:
        said.put((place, error))


def end_with_parent() -> None:
    """Let a worker process end when the process that started it does, however that ended.

    For worker processes, which would otherwise wait for ever when a run was killed.
    Ctrl-C in a terminal reaches workers too; it is left to the process that started them.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_wait_for_parent, daemon=True).start()


def _wait_for_parent() -> None:
    if (parent := multiprocessing.parent_process()) is not None:
        parent.join()
        os._exit(1)


def _gather(
    workers: Sequence[Any],
    said: Any,
    num_results: int,
    watch: Callable[[Progress], None] | None,
) -> Generator[TrialResult, None, None]:
    """Results of all workers as they come; `watch` is told of the progress of all together."""
    progress = [Progress() for _ in workers]
    while num_results:
        try:
            place, news = said.get(timeout=0.5)
        except queue.Empty:
            dead = [worker for worker in workers if worker.exitcode not in (None, 0)]
            if dead:
                raise AgentError(f"a process died (exit code {dead[0].exitcode})") from None
            continue
        if isinstance(news, ValueError):
            raise news
        if isinstance(news, TrialResult):
            num_results -= 1
            yield news
            continue
        progress[place] = news
        if watch:
            watch(Progress(*map(sum, zip(*map(dataclasses.astuple, progress), strict=True))))


class TrainingFolder:
    """A training's results on the disk.

    Attributes:
        path: the folder.
        done: numbers of the trials that are there.
    """

    def __init__(
        self, path: Path, training: Training, command: str = "", any_code: bool = False
    ) -> None:
        """Begin a folder, or go on with the one that is there.

        Args:
            path: where; made if it is missing.
            training: whose results it holds.
            command: that makes them, for the record.
            any_code: go on also if another version of the code began it.

        Raises:
            AgentError: a folder of something else, or of other settings or another version.
        """
        self.path, self._training, self._command = path, training, command
        settings = json.loads(json.dumps(dataclasses.asdict(training)))
        self._record = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
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
            else:
                _write_whole(path / "training.json", json.dumps(self._record, indent=1))
        except OSError as error:
            raise AgentError(f"{path} cannot be used: {error}") from error
        self.done = sorted(int(trial.name[6:]) for trial in path.glob("trial_[0-9]*"))

    def save(self, result: TrialResult) -> None:
        """Put a finished trial into the folder, whole or not at all.

        Raises:
            AgentError: it cannot be written.
        """
        number = int(result.trial.label)
        beside = self.path / f".trial_{number:04}.{os.getpid()}.tmp"
        try:
            shutil.rmtree(beside, ignore_errors=True)
            beside.mkdir()
            _write_whole(beside / "episodes.csv", _episodes_text(result))
            for weights in self._learned(result):
                save_weights(beside / f"{weights.player}.npz", weights)
                if number == 0:
                    save_weights(self.path / f"{weights.player}.npz", weights, overwrite=True)
            beside.rename(self._folder(number))
        except OSError as error:
            raise AgentError(f"trial {number} cannot be written: {error}") from error
        finally:
            shutil.rmtree(beside, ignore_errors=True)
        self.done = sorted([*self.done, number])

    def episodes(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Durations [cycles] and outcomes of a trial's episodes, (num_episodes,) each."""
        lines = (self._folder(number) / "episodes.csv").read_text(encoding="utf-8").splitlines()
        rows = [line.split(",") for line in lines[1:]]
        durations = np.array([int(cycles) for _, cycles, _ in rows], dtype=np.int32)
        outcomes = np.array([Outcome[name.upper()] for *_, name in rows], dtype=np.int8)
        return durations, outcomes

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
                ordering=training.ordering,
                sarsa=config.sarsa,
                episodes=len(result.durations) + (earlier.episodes if earlier else 0),
                hours=result.hours + (earlier.hours if earlier else 0.0),
                seed=training.seed,
                player=name,
                code_version=code_version(),
                created_by=self._command,
            )


def _weights_bytes(weights: LearnedWeights) -> bytes:
    file = io.BytesIO()
    write_weights(file, weights)
    return file.getvalue()


def _episodes_text(result: TrialResult) -> str:
    names = [Outcome(code).name.lower() for code in result.outcomes]
    rows = zip(result.durations, names, strict=True)
    lines = [f"{number},{cycles},{name}" for number, (cycles, name) in enumerate(rows)]
    return "\n".join(["episode,cycles,outcome", *lines, ""])


def _write_whole(path: Path, text: str) -> None:
    """Write a text file that appears once it is whole."""
    beside = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    beside.write_text(text, encoding="utf-8")
    beside.replace(path)


def _check_same(path: Path, record: dict[str, Any], any_code: bool) -> None:
    """Refuse to mix results of different settings or versions."""
    try:
        there = json.loads((path / "training.json").read_text(encoding="utf-8"))
        settings, version = dict(there["settings"]), there["code_version"]
    except (ValueError, KeyError, TypeError) as error:
        raise AgentError(f"{path / 'training.json'} is no training's: {error!r}") from error
    for name, value in record["settings"].items():
        if settings.get(name) != value:
            raise AgentError(
                f"{path} holds a training with {name}={settings.get(name)!r}, not {value!r}:"
                " use the same settings, or name another folder"
            )
    if version != record["code_version"] and not any_code:
        raise AgentError(
            f"{path} was begun by version {version}, this is {record['code_version']}:"
            " name another folder, or allow it (--any-code)"
        )
