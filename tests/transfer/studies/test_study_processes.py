"""Calls in worker processes that may be killed: each is made to its end, or fails in words."""

import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path

import pytest

from keepaway_transfer.errors import StudyError
from keepaway_transfer.studies.processes import ATTEMPTS, WorkerExecutor


def double(number: int) -> int:
    return 2 * number


def fail(words: str) -> None:
    raise StudyError(words)


def be_killed(folder: Path, times: int) -> int:
    """Be killed N times; then the number of deaths."""
    already = len(list(folder.iterdir()))
    if already < times:
        (folder / str(already)).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return already


def end_with_code(code: int) -> None:
    os._exit(code)


def sleep(pid_file: Path) -> None:
    pid_file.write_text(str(os.getpid()))
    time.sleep(1000)


@pytest.fixture
def executor() -> Iterator[WorkerExecutor]:
    with WorkerExecutor(2) as made:
        yield made


def test_calls_are_made_and_answered_in_order(executor):
    assert list(executor.map(double, range(10))) == list(range(0, 20, 2))


def test_an_error_is_raised_where_the_result_is_asked_for(executor):
    with pytest.raises(StudyError, match="out of tiles") as raised:
        executor.submit(fail, "out of tiles").result()
    assert "in fail" in raised.value.__notes__[0]
    assert executor.submit(double, 4).result() == 8


def test_a_call_whose_process_is_killed_is_made_again(executor, tmp_path, caplog):
    others = [executor.submit(double, number) for number in range(4)]
    assert executor.submit(be_killed, tmp_path, ATTEMPTS - 1).result() == ATTEMPTS - 1
    assert [other.result() for other in others] == [0, 2, 4, 6]
    assert caplog.text.count("was ended by SIGKILL (out of memory?); what it played") == 2


def test_a_call_that_always_ends_so_fails_in_words_and_others_are_made(executor, tmp_path):
    with pytest.raises(StudyError, match="was ended by SIGKILL"):
        executor.submit(be_killed, tmp_path, 100).result()
    with pytest.raises(StudyError, match="ended with code 3"):
        executor.submit(end_with_code, 3).result()
    assert len(list(tmp_path.iterdir())) == ATTEMPTS
    assert executor.submit(double, 4).result() == 8


def test_leaving_by_an_exception_ends_all_at_once(tmp_path):
    threads = threading.active_count()
    file = tmp_path / "pid"

    def leave() -> None:
        with WorkerExecutor(1) as executor:
            first, second = (executor.submit(sleep, file) for _ in range(2))
            futures.extend((first, second))
            while not (file.exists() and file.read_text()):
                time.sleep(0.01)
            raise KeyboardInterrupt

    futures: list[Future[None]] = []
    with pytest.raises(KeyboardInterrupt):
        leave()
    assert threading.active_count() == threads
    with pytest.raises(ProcessLookupError):
        os.kill(int(file.read_text()), 0)
    assert isinstance(futures[0].exception(), StudyError)
    assert futures[1].cancelled()


def test_nothing_is_taken_after_the_end():
    executor = WorkerExecutor(1)
    waiting = executor.submit(double, 1)
    executor.shutdown()
    assert waiting.result() == 2
    with pytest.raises(RuntimeError, match="shut down"):
        executor.submit(double, 1)
