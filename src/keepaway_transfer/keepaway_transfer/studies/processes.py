"""An executor of worker processes that may be killed: what one had is played again by another.

`concurrent.futures.ProcessPoolExecutor` gives up all that it has when one process dies.
"""

import logging
import queue
import threading
import traceback
from collections.abc import Callable
from concurrent.futures import Executor, Future
from multiprocessing.connection import Connection
from typing import Any, NamedTuple, ParamSpec, TypeVar

from keepaway_agent.training.processes import Worker, how_it_ended
from keepaway_transfer.errors import StudyError

ATTEMPTS = 3
"""Times that one call is made, if the process that makes it is killed."""

P = ParamSpec("P")
R = TypeVar("R")
log = logging.getLogger(__name__)


class _Call(NamedTuple):
    future: Future[Any]
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    named: dict[str, Any]


class WorkerExecutor(Executor):
    """Makes calls in processes of this machine, each with a thread here that watches it.

    Leaving a `with` by an exception ends the processes at once.
    """

    def __init__(self, num_workers: int) -> None:
        """Processes start with the first calls."""
        self._calls: queue.SimpleQueue[_Call | None] = queue.SimpleQueue()
        self._workers: set[Worker] = set()
        self._closed = self._killed = False
        self._lock = threading.Lock()
        self._threads = [
            threading.Thread(target=self._watch, daemon=True) for _ in range(max(1, num_workers))
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, fn: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> Future[R]:
        """As every executor does.

        Raises:
            RuntimeError: it was shut down.
        """
        future: Future[R] = Future()
        with self._lock:
            if self._closed:
                raise RuntimeError("the executor was shut down")
            self._calls.put(_Call(future, fn, args, kwargs))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls; make those that wait, unless they are to be cancelled."""
        with self._lock:
            already, self._closed = self._closed, True
        if cancel_futures:
            self._cancel_waiting()
        if not already:
            for _ in self._threads:
                self._calls.put(None)
        if wait:
            for thread in self._threads:
                thread.join()

    def kill(self) -> None:
        """End all processes now, and cancel everything."""
        with self._lock:
            self._killed = True
            for worker in self._workers:
                worker.kill()
        self.shutdown(cancel_futures=True)

    def __exit__(self, kind: object, *_: object) -> None:
        self.shutdown() if kind is None else self.kill()

    def _cancel_waiting(self) -> None:
        try:
            while True:
                if call := self._calls.get_nowait():
                    call.future.cancel()
        except queue.Empty:
            return

    def _watch(self) -> None:
        """A thread: make calls in a process, and start another where one has died."""
        worker: Worker | None = None
        while (call := self._calls.get()) is not None:
            if call.future.set_running_or_notify_cancel():
                worker = self._make(call, worker)
        if worker:
            worker.pipe.close()  # by which it knows that there is no more
            self._end(worker)

    def _make(self, call: _Call, worker: Worker | None) -> Worker | None:
        """Make a call, at most ATTEMPTS times; the process for the next one."""
        for _attempt in range(ATTEMPTS):
            code, how = 0, "cannot be started"
            try:
                worker = worker or self._hire()
                worker.pipe.send(call[1:])
                succeeded, value = worker.pipe.recv()
            except (EOFError, OSError):
                if worker:
                    how = how_it_ended(code := self._end(worker))
                worker = None
                if code >= 0 or self._killed:
                    break
                log.warning("a worker process %s; what it played is played again", how)
            else:
                (call.future.set_result if succeeded else call.future.set_exception)(value)
                return worker
        words = f"a worker process {how} while it played a batch: what is finished is kept"
        call.future.set_exception(StudyError(words))
        return None

    def _hire(self) -> Worker:
        with self._lock:
            if self._killed:
                raise OSError("the executor was ended")
            worker = Worker(_answer)
            self._workers.add(worker)
        return worker

    def _end(self, worker: Worker) -> int:
        with self._lock:
            self._workers.discard(worker)
        return worker.end()


def _answer(pipe: Connection) -> None:
    """A process: make the calls that come."""
    while True:
        try:
            function, arguments, named = pipe.recv()
        except EOFError:
            return
        try:
            answer = True, function(*arguments, **named)
        except Exception as error:
            error.add_note(traceback.format_exc())
            answer = False, error
        pipe.send(answer)
