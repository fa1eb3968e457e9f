"""Trials spread over processes; results do not depend on how many, nor on any that is killed."""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import math
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any, Final

import numpy as np

from keepaway_agent.errors import AgentError
from keepaway_agent.training.processes import Worker, how_it_ended
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.training import RECORDED_TRIAL, Training
from keepaway_agent.training.trial import Progress, TrialResult
from keepaway_agent.training.trial_recorder import TrialRecorder

NUM_FIELDS: Final = 128
"""Fields played in lock-step by one process."""
MAX_LOSSES: Final = 3
"""Processes that may be killed, one after the other, without a trial being finished between."""

Watch = Callable[[Progress], None]
Assigned = tuple[int, TrialRecorder | None]
"""A trial's number, and what records it."""

log = logging.getLogger(__name__)


def play_trials(
    training: Training,
    numbers: Sequence[int],
    processes: int = 1,
    num_fields: int = NUM_FIELDS,
    watch: Watch | None = None,
    recorder: TrialRecorder | None = None,
) -> Generator[TrialResult, None, None]:
    """Play trials, and give each one's result as soon as it has finished; `label` is its number.

    A process that is killed is noticed at once and replaced, and what it played is played again; a
    warning is logged that says so.

    Args:
        training: what is trained.
        numbers: of the trials.
        processes: over how many processes they are spread; results do not depend on it.
        num_fields: trials that a process plays side by side.
        watch: is called with the progress several times a second.
        recorder: records RECORDED_TRIAL, if that is among the numbers; see `Training.recorder`.

    Raises:
        AgentError: a training that cannot be played, or processes that are killed again and again.
        KeepawayError: something is in the place of the bag.
    """
    processes = max(1, min(processes, len(numbers)))
    num_fields = max(1, min(num_fields, math.ceil(len(numbers) / processes)))
    if processes == 1:
        assigned = ((number, _recorder_of(number, recorder)) for number in numbers)
        yield from _play_here(training, assigned, num_fields, watch)
        return
    crew = _Crew(training, numbers, num_fields, recorder)
    try:
        for _ in range(processes):
            crew.hire()
        yield from crew.results(watch)
    finally:
        crew.end()


def _recorder_of(number: int, recorder: TrialRecorder | None) -> TrialRecorder | None:
    return recorder if number == RECORDED_TRIAL else None


def _play_here(
    training: Training, assigned: Iterator[Assigned], num_fields: int, watch: Watch | None
) -> Generator[TrialResult, None, None]:
    loaded = training.start()
    weights = np.stack([each.values for each in loaded]) if loaded else None
    with contextlib.ExitStack() as recorders:

        def trials() -> Iterator[Any]:
            for number, recorder in assigned:
                if recorder:
                    recorders.enter_context(contextlib.closing(recorder))
                yield training.trial(number, weights, recorder)

        for result in Trainer(training.trainer, num_fields).run(trials(), watch):
            if isinstance(result.trial.watch, TrialRecorder):
                result.trial.watch.close()
            yield dataclasses.replace(result, trial=dataclasses.replace(result.trial, watch=None))


class _Ask:
    """A worker asks for a trial."""


def _work(pipe: Connection, training: Training, num_fields: int) -> None:
    """A process: play one trial after the other, until there is none."""

    def assigned() -> Iterator[Assigned]:
        while True:
            pipe.send(_Ask())
            answer: Assigned | None = pipe.recv()
            if answer is None:
                return
            yield answer

    try:
        for result in _play_here(training, assigned(), num_fields, pipe.send):
            pipe.send(result)
    except ValueError as error:
        pipe.send(error)


@dataclasses.dataclass
class _Hired:
    """What is known of one worker."""

    worker: Worker
    taken: list[int] = dataclasses.field(default_factory=list)  # trials that it plays
    progress: Progress = dataclasses.field(default_factory=Progress)  # as it said last
    finished: Progress = dataclasses.field(default_factory=Progress)  # of trials that came whole


class _Crew:
    """The processes of a training, and who plays which trial."""

    def __init__(
        self,
        training: Training,
        numbers: Sequence[int],
        num_fields: int,
        recorder: TrialRecorder | None,
    ) -> None:
        self._training, self._num_fields, self._recorder = training, num_fields, recorder
        self._waiting = deque(numbers)
        self._left = len(numbers)
        self._hired: dict[Connection, _Hired] = {}
        self._before = Progress()  # what those finished that are gone
        self._losses = 0  # since a trial was finished

    def hire(self) -> None:
        """Start one more process."""
        worker = Worker(_work, self._training, self._num_fields)
        self._hired[worker.pipe] = _Hired(worker)

    def end(self) -> None:
        """End all processes."""
        for hired in self._hired.values():
            hired.worker.kill()
        for hired in self._hired.values():
            hired.worker.end()

    def results(self, watch: Watch | None) -> Generator[TrialResult, None, None]:
        """Results of all as they come; `watch` is called with the progress of all together."""
        while self._left:
            for ready in wait(list(self._hired)):
                assert isinstance(ready, Connection)
                try:
                    news = ready.recv()
                except (EOFError, OSError):
                    self._replace(ready)
                    continue
                if isinstance(news, ValueError):
                    raise news
                if isinstance(news, TrialResult):
                    self._note(self._hired[ready], news)
                    yield news
                elif isinstance(news, Progress):
                    self._hired[ready].progress = news
                    if watch:
                        watch(self._progress())
                else:
                    self._assign(ready)

    def _assign(self, pipe: Connection) -> None:
        number = self._waiting.popleft() if self._waiting else None
        if number is not None:
            self._hired[pipe].taken.append(number)
        answer = None if number is None else (number, _recorder_of(number, self._recorder))
        with contextlib.suppress(OSError):  # it was killed, which is seen when it is read
            pipe.send(answer)

    def _note(self, hired: _Hired, result: TrialResult) -> None:
        hired.taken.remove(int(result.trial.label))
        one = Progress(1, len(result.durations), int(result.durations.sum()))
        hired.finished = _sum(hired.finished, one)
        self._left -= 1
        self._losses = 0

    def _replace(self, pipe: Connection) -> None:
        """A process has ended: let another play what it had, if it was killed."""
        gone = self._hired.pop(pipe)
        how = how_it_ended(code := gone.worker.end())
        self._before = _sum(self._before, gone.finished)
        if not gone.taken and not code:
            return
        if code >= 0:
            raise AgentError(f"a worker process {how}; what it wrote says why")
        self._losses += 1
        if self._losses >= MAX_LOSSES:
            raise AgentError(
                f"{self._losses} worker processes in a row were lost, the last {how}: what is"
                " finished is kept; use fewer --processes or --fields"
            )
        log.warning("a worker process %s; %s", how, self._play_again(gone.taken))
        self.hire()

    def _play_again(self, numbers: Sequence[int]) -> str:
        """Put trials in front of those that wait; what is done about it, in words."""
        self._waiting.extendleft(reversed(numbers))
        words = (
            f"trials {', '.join(map(str, numbers))} are played again" if numbers else "continues"
        )
        if RECORDED_TRIAL in numbers and self._recorder and self._recorder.path.exists():
            self._recorder = self._recorder.anew()
            words += f" and recorded to {self._recorder.path}"
        return words

    def _progress(self) -> Progress:
        return _sum(self._before, *(hired.progress for hired in self._hired.values()))


def _sum(*parts: Progress) -> Progress:
    return Progress(*map(sum, zip(*map(dataclasses.astuple, parts), strict=True)))
