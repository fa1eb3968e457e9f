"""The results of a study on disk: a folder that trials are appended to, one by one.

`study.json` holds the settings, the code version and the command; `trials.jsonl` one JSON object a
line and trial, with every episode's duration. A line is on the disk before the next trial is waited
for, so that a run can be killed at any moment; half a line is cut off when the folder is opened to
resume. A folder takes trials of one study only, from one process at a time.

`pack` makes `trials.parquet` of it (`records`): a hundredth of the size, and all that reports need.
A folder with that file is whole without the other, and a study can be resumed in it.
"""

import fcntl
import json
import logging
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any

from keepaway_agent.files import write_whole
from keepaway_sim.world.config import CYCLE_TIME
from keepaway_transfer import metrics
from keepaway_transfer.errors import StudyError
from keepaway_transfer.studies.records import (
    RECORDS_FILE,
    Record,
    durations_record,
    read_records,
    write_records,
)
from keepaway_transfer.studies.study import Study, study_from

log = logging.getLogger(__name__)

STUDY_FILE, TRIALS_FILE = "study.json", "trials.jsonl"


@dataclass(frozen=True)
class SourceRun:
    """What a trial trained on before the target task."""

    task: str
    episodes: int
    cycles: int  # simulated, of 0.1 s
    keeper: int  # index of the keeper whose weights were carried over


@dataclass(frozen=True)
class StudyTrial:
    """One trial as it was played; every measure is worked out from it later."""

    row: str
    number: int  # within the row
    sources: tuple[SourceRun, ...]
    cycles: tuple[int, ...]  # duration of each episode of the target task [cycles of 0.1 s]
    greedy_cycles: tuple[int, ...]  # the same, then played without learning or exploring
    code_version: str
    start_level: float | None = None  # [s] of the values that the target task began with

    @property
    def key(self) -> tuple[str, int]:
        """Identifies this trial among all of its study."""
        return self.row, self.number


@dataclass(frozen=True)
class StudyResults:
    """A results folder that was read: the study and the records of its trials so far."""

    study: Study
    command: str
    code_version: str  # that the folder was begun with
    records: tuple[Record, ...]
    note: str = ""  # what else must be known of them


def record_of(trial: StudyTrial, study: Study) -> Record:
    """What is kept of a trial of this study."""
    cycles = sum(run.cycles for run in trial.sources)
    return Record(
        row=trial.row,
        number=trial.number,
        source_episodes=sum(run.episodes for run in trial.sources),
        source_hours=cycles * CYCLE_TIME / metrics.SECONDS_PER_HOUR,
        start_level=trial.start_level,
        code_version=trial.code_version,
        **durations_record(trial.cycles, trial.greedy_cycles, study.threshold, study.window),
    )


def read_results(folder: Path | str) -> StudyResults:
    """Read a results folder, packed or not.

    Raises:
        StudyError: no results there, or a line that is no trial, with its number.
    """
    folder = Path(folder)
    head = _read_head(folder)
    try:
        study = study_from(head["study"])
        about = head["command"], head["code_version"]
    except StudyError as error:
        raise StudyError(f"{folder / STUDY_FILE}: {error}") from error
    except (KeyError, ValueError) as error:
        raise StudyError(f"{folder} holds no results: {error!r}") from error
    packed = _read_packed(folder)
    known = {record.key for record in packed}
    fresh = tuple(record_of(one, study) for one in read_trials(folder) if one.key not in known)
    return StudyResults(study, *about, (*packed, *fresh), str(head.get("note", "")))


def read_trials(folder: Path | str) -> Iterator[StudyTrial]:
    """The trials of `trials.jsonl`, each once with all its episodes; none if it is not there.

    Raises:
        StudyError: a line that is no trial, with its number.
    """
    path = Path(folder) / TRIALS_FILE
    if not path.exists():
        return
    seen: set[tuple[str, int]] = set()
    with path.open("rb") as lines:
        for number, line in enumerate(lines, start=1):
            if not line.endswith(b"\n"):  # it is still being written
                continue
            trial = _trial_from(line, f"{path}, trial on line {number}")
            if trial.key not in seen:
                seen.add(trial.key)
                yield trial


def pack(folder: Path | str, into: Path | str | None = None) -> Path:
    """Write the records of a folder's trials as `trials.parquet`, there or into another folder.

    Another folder gets `study.json` as well: it is then results like any other.
    """
    folder, into = Path(folder), Path(into or folder)
    records = read_results(folder).records
    into.mkdir(parents=True, exist_ok=True)
    if into.resolve() != folder.resolve():
        write_whole(into / STUDY_FILE, (folder / STUDY_FILE).read_text(encoding="utf-8"))
    write_records(into / RECORDS_FILE, records)
    return into / RECORDS_FILE


class ResultsFolder:
    """A results folder that one running study writes to. Made by `open_results`.

    Attributes:
        done: keys of the trials that are there, but those appended since it was opened.
    """

    def __init__(self, folder: Path, file: IO[str], done: frozenset[tuple[str, int]]) -> None:
        self._folder, self._file = folder, file
        self.done = done

    def append(self, trial: StudyTrial) -> None:
        """Add a trial and wait until it is on the disk."""
        self._file.write(json.dumps(asdict(trial), separators=(",", ":"), allow_nan=False) + "\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def take_over(self, records: Iterable[Record]) -> None:
        """Add what another study has kept of trials, those that are not done yet."""
        fresh = [one for one in records if one.key not in self.done]
        write_records(self._folder / RECORDS_FILE, (*_read_packed(self._folder), *fresh))
        self.done |= {one.key for one in fresh}


@contextmanager
def open_results(
    folder: Path | str,
    study: Study,
    *,
    command: str,
    code_version: str,
    resume: bool = False,
    any_code: bool = False,
) -> Iterator[ResultsFolder]:
    """Begin a results folder, or resume one of the same settings and code.

    Args:
        folder: made if it does not exist.
        study: whose trials will be appended.
        command: that the folder is begun with, kept beside the results.
        code_version: of this run; every trial carries the version it was played with.
        resume: continue if there are results.
        any_code: resume also with code of another version.

    Raises:
        StudyError: results are there and `resume` is not asked for; they were made with other
            settings or code; another process is writing to them.
    """
    folder = Path(folder)
    if (folder / STUDY_FILE).exists() and not resume:
        raise StudyError(f"{folder} has results: add --resume to continue, or name another folder")
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / TRIALS_FILE, "a+", encoding="utf-8") as file:
        _lock(file, folder)  # before anything is written that another process may have written too
        if (folder / STUDY_FILE).exists():
            _check_same(folder, study, code_version, any_code)
        else:
            settings = {**study.settings, "trials": study.trials}
            head = {"study": settings, "command": command, "code_version": code_version}
            write_whole(folder / STUDY_FILE, json.dumps(head, indent=1, allow_nan=False) + "\n")
        _cut_off_half_a_line(file)
        done = {record.key for record in _read_packed(folder)}
        done.update(one.key for one in read_trials(folder))
        yield ResultsFolder(folder, file, frozenset(done))


def _check_same(folder: Path, study: Study, code_version: str, any_code: bool) -> None:
    head = _read_head(folder)
    before, now = study_from(head["study"]).settings, study.settings
    changed = [
        f"{name}: {before[name]} -> {now[name]}" for name in now if now[name] != before[name]
    ]
    if changed:
        raise StudyError(
            f"{folder} was made with other settings; undo the change or name another folder."
            f" Changed: {'; '.join(changed)}"
        )
    if head["code_version"] != code_version and not any_code:
        raise StudyError(
            f"{folder} was begun with code {head['code_version']}, this is {code_version}: name"
            " another folder, or add --any-code if the change cannot move a result"
        )


def _read_head(folder: Path) -> dict[str, Any]:
    try:
        head: dict[str, Any] = json.loads((folder / STUDY_FILE).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise StudyError(f"{folder} holds no results: it has no {STUDY_FILE}") from None
    except (ValueError, RecursionError) as error:
        raise StudyError(f"{folder / STUDY_FILE}: {error}") from error
    if not isinstance(head, dict):
        raise StudyError(f"{folder / STUDY_FILE}: not a JSON object")
    return head


def _read_packed(folder: Path) -> tuple[Record, ...]:
    path = folder / RECORDS_FILE
    return read_records(path) if path.exists() else ()


def _trial_from(line: bytes, where: str) -> StudyTrial:
    try:
        data = json.loads(line.decode("utf-8"))
        data["sources"] = tuple(SourceRun(**source) for source in data["sources"])
        data["cycles"], data["greedy_cycles"] = tuple(data["cycles"]), tuple(data["greedy_cycles"])
        return StudyTrial(**data)
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise StudyError(f"{where}: {error}") from error


def _lock(file: IO[str], folder: Path) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise StudyError(f"{folder}: another process is writing to these results") from None
    except OSError as error:  # some network file systems know no locks
        log.warning(
            "%s cannot be locked (%s): see that one study alone writes there", folder, error
        )


def _cut_off_half_a_line(file: IO[str]) -> None:
    """What a writer that was killed in the middle of a line left behind."""
    path = Path(file.name)
    content = path.read_bytes()
    if not content.endswith(b"\n"):
        os.truncate(path, content.rfind(b"\n") + 1)
