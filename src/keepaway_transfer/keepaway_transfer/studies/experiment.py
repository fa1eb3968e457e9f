"""Running a study: which trials are left, and any executor to play them on.

Trials are played in batches (`batch.play_batch`), each a task of a `concurrent.futures.Executor`:
processes on this machine, or a cluster's through its own executor (Dask's `Client.get_executor`).
A trial gives the same whatever batch it is in, so a run can be stopped and resumed anywhere.
"""

import math
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import AbstractContextManager, nullcontext

from keepaway_transfer.studies.results import ResultsFolder, StudyTrial
from keepaway_transfer.studies.study import Study

Key = tuple[str, int]  # a row's name and a trial's number
PlayBatch = Callable[[Study, Sequence[Key]], list[StudyTrial]]

GOLDEN_SECTION = (math.sqrt(5.0) - 1.0) / 2.0
TRIALS_A_SOURCE = 5  # of a batch, at most, where rows share source runs
TYPICAL_TARGET_EPISODES = 12_000  # of Table 2; to weigh trials in the estimate of the time left


def plan(study: Study, done: Collection[Key], batch: int) -> list[tuple[Key, ...]]:
    """The trials that are left, in batches of about `batch` that are played together.

    Rows that share their trials' source runs stay together, so that those are played once; of such
    runs a batch has a fifth of `batch` at least, as few runs side by side are slow each. All rows
    get on at the same pace: a study that is stopped early has about as many trials of each.
    Rows far apart in the study take turns, so that its first batches are a fair sample of it: the
    time left is estimated from them.

    >>> from keepaway_transfer.studies.study import load_study
    >>> plan(load_study("tiny"), done={("0", 1)}, batch=4)[:2]
    [(('0', 0), ('0', 2), ('0', 3)), (('8', 0), ('8', 1), ('8', 2), ('8', 3))]
    """
    names = [row.name for row in study.rows]
    numbers = range(study.trials)
    if study.shared_sources:
        together = max(1, batch // len(names), batch // TRIALS_A_SOURCE)
        groups = [
            [(name, number) for number in some for name in names]
            for some in _chunks(numbers, together)
        ]
    else:
        groups = [
            [(name, number) for number in some]
            for some in _chunks(numbers, batch)
            for name in _far_apart(names)
        ]
    left = [tuple(key for key in group if key not in done) for group in groups]
    return [group for group in left if group]


def run(
    study: Study,
    results: ResultsFolder,
    executor: Executor,
    play: PlayBatch,
    batch: int,
    shield: Callable[[], AbstractContextManager[None]] = nullcontext,
) -> Iterator[list[StudyTrial]]:
    """Play the trials that are left, and yield those of each batch once they are on the disk.

    Stopping the iteration gives up the batches that were not begun. A batch that has been played is
    written in a `shield`, that lets a signal wait.
    """
    batches = plan(study, results.done, batch)
    pending = {executor.submit(play, study, keys) for keys in batches}
    try:
        while pending:
            done, pending = wait(pending, return_when=FIRST_COMPLETED)
            whole = sorted(done, key=_failed, reverse=True)  # nothing played is lost by a failure
            done.clear()  # a future keeps its trials as long as anything knows it
            while whole:
                trials = whole.pop().result()
                with shield():
                    for trial in trials:
                        results.append(trial)
                yield trials
    finally:
        for future in pending:
            future.cancel()


def _failed(future: Future[list[StudyTrial]]) -> bool:
    return future.exception() is not None


class StudyProgress:
    """How much of a study is done and how long the rest will take at the same rate.

    A trial weighs as many episodes as it may be expected to play.
    """

    def __init__(
        self, study: Study, done: Collection[Key], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._weights = {
            row.name: row.source_episodes + TYPICAL_TARGET_EPISODES for row in study.rows
        }
        self.trials = study.trials * len(study.rows)
        left = [name for keys in plan(study, done, batch=1) for name, _ in keys]
        self.done = self.trials - len(left)
        self._left = sum(self._weights[name] for name in left)
        self._played = 0
        self._clock, self._start = clock, clock()

    def add(self, trials: Sequence[StudyTrial]) -> None:
        """Count trials that were played, a batch's at once: they come to their end together."""
        weight = sum(self._weights[trial.row] for trial in trials)
        self.done += len(trials)
        self._left -= weight
        self._played += weight

    @property
    def seconds_left(self) -> float:
        """Estimated wall time to the end [s]; infinite before the first trial."""
        if not self._played:
            return float("inf")
        return (self._clock() - self._start) * self._left / self._played

    def __str__(self) -> str:
        minutes = self.seconds_left / 60
        left = "unknown" if minutes == float("inf") else f"{minutes:.0f} min"
        return f"time left {left}"


def _far_apart(names: Sequence[str]) -> list[str]:
    """The names in steps of the golden section of their number, round and round.

    >>> "".join(_far_apart("0123456789"))
    '0741852963'
    """
    num = len(names)
    coprime = [step for step in range(1, num + 1) if math.gcd(step, num) == 1]
    step = min(coprime, key=lambda step: abs(step - GOLDEN_SECTION * num))
    return [names[step * k % num] for k in range(num)]


def _chunks(numbers: range, size: int) -> list[range]:
    return [numbers[start : start + size] for start in range(0, len(numbers), size)]
