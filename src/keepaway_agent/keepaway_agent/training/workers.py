"""Trials spread over processes; results do not depend on how many."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import multiprocessing
import os
import queue
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any, Final

import numpy as np

from keepaway_agent.errors import AgentError
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.training import RECORDED_TRIAL, Training
from keepaway_agent.training.trial import Progress, TrialResult
from keepaway_agent.training.trial_recorder import TrialRecorder

NUM_FIELDS: Final = 128
"""Fields played in lock-step by one process."""


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
