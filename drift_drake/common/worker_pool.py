"""Worker processes of this machine, each with a pipe of its own: whenever one is killed, nothing waits for it.

No lock and no queue is shared between workers. One that is killed, while it starts, idles, works or answers, closes its
pipe; another takes its place.
"""

import concurrent.futures
import multiprocessing
import os
import pickle
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any, NamedTuple

from drift_drake.common.errors import DriftDrakeError, one_line
from drift_drake.common.interruption import ctrl_c_waits, signals_wait

ENDED_WITH_PARENT = 1  # exit code of a worker
STARTS = 6  # in a row that fail, with no worker left: then the jobs are given up
PAUSE = 0.1  # [s] more before each further start, once one failed: what kills them may pass
PATIENCE = 2.0  # [s] for a worker to end by itself
Future = concurrent.futures.Future
Submit = Callable[..., "Future[Any]"]


class WorkerEndedError(DriftDrakeError, RuntimeError):
    """A job whose worker process ended before it: killed, or out of memory."""


class WorkerLostError(DriftDrakeError, RuntimeError):
    """A job that is given up, since its worker processes ended before it, or while they started, again and again."""


class _Process(SpawnProcess):
    """Ctrl-C, which reaches all processes of a terminal, is left to the parent to answer, once for all.

    Blocked from before the process starts: it imports for a second before it can say for itself what it does with it.
    A start that were broken off would leave a worker that waits for its first orders in vain, and says so.
    """

    def start(self) -> None:
        track_resources()  # as the first start would, which then undoes the mask
        with signals_wait(), ctrl_c_waits():
            super().start()


class _ProcessWithoutMain(_Process):
    """The same for jobs that need nothing of the user's script: it is not run again in the process, guarded or not.

    It may be started by a cluster's worker, too: those are daemons, which Python lets start no process, as theirs would
    outlive them. This one does not (`end_with_parent`).
    """

    def start(self) -> None:
        main, own = sys.modules["__main__"], multiprocessing.current_process()._config  # type: ignore[attr-defined]
        is_daemon = own.pop("daemon", None)
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            super().start()
        finally:
            sys.modules["__main__"] = main
            if is_daemon is not None:
                own["daemon"] = is_daemon


def track_resources() -> None:
    """Starts Python's process that removes a killed command's semaphores, which then need no warning.

    To be called before anything of `multiprocessing` is made, which would start it otherwise.
    """
    before = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = ",".join([*([before] if before else []), "ignore:resource_tracker:UserWarning"])
    try:
        resource_tracker.ensure_running()
    finally:
        del os.environ["PYTHONWARNINGS"]
        if before is not None:
            os.environ["PYTHONWARNINGS"] = before


class _Spawning(SpawnContext):
    Process = _Process  # type: ignore[assignment]


class _SpawningWithoutMain(SpawnContext):
    Process = _ProcessWithoutMain  # type: ignore[assignment]


def end_with_parent() -> None:
    """What a worker begins with: it ends when the process that started it does."""
    parent = multiprocessing.parent_process()
    watched = [] if parent is None else [parent.sentinel]

    def end() -> None:
        wait(watched)  # readable once the parent's end is closed
        os._exit(ENDED_WITH_PARENT)

    threading.Thread(target=end, daemon=True).start()


@contextmanager
def worker_processes(workers: int, tasks_per_worker: int = 0, with_main: bool = True) -> Iterator[Submit]:
    """Submits a function and its one argument to fresh processes of this machine.

    A process that ends takes its own job with it and no other: the job's future raises `WorkerEndedError`. All end at
    once if the block raises (Ctrl-C included) or if this process ends, by a signal too. Not forked: a fork would copy
    Drake's, BLAS's and other threads in whatever state they are.

    Args:
        tasks_per_worker: a process is replaced by a fresh one after so many jobs; 0 for never;
        with_main: whether jobs need what the script that runs defines.
    """
    track_resources()
    pool = _Pool(workers, tasks_per_worker, _Spawning() if with_main else _SpawningWithoutMain())
    try:
        yield pool.submit
        pool.end()
    except BaseException:  # broken off: the pool must not work through what is left first
        pool.end(at_once=True)
        raise


class _Task(NamedTuple):
    future: "Future[Any]"
    function: Callable[[Any], Any]
    job: Any


class _Worker:
    """One process, and this end of its pipe. It says once that it is there; from then on a job brings an answer."""

    def __init__(self, context: SpawnContext) -> None:
        self.connection, theirs = multiprocessing.Pipe()
        self.ready = False
        self.task: _Task | None = None
        self.done = 0
        with theirs:  # once closed here, the pipe ends with the process
            self.process = context.Process(target=_work, args=(theirs,))
            try:
                self.process.start()
            except BaseException:
                self.connection.close()
                raise

    def end(self, patience: float) -> None:
        """Ends the process, by force if it has not ended after some seconds."""
        self.connection.close()
        self.process.join(patience)
        for by_force in (self.process.terminate, self.process.kill):
            if self.process.exitcode is None:
                by_force()
                self.process.join(PATIENCE)


class _Pool:
    """Hands tasks to workers, from a thread of its own."""

    def __init__(self, count: int, tasks_per_worker: int, context: SpawnContext) -> None:
        self._count, self._tasks_per_worker, self._context = count, tasks_per_worker, context
        self._waiting: deque[_Task] = deque()
        self._workers: list[_Worker] = []
        self._leaving: list[_Worker] = []  # that have done their share of jobs
        self._failed_starts, self._next_start = 0, 0.0
        self._closed = self._stopped = False
        self._bell, self._ring = multiprocessing.Pipe(duplex=False)
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def submit(self, function: Callable[[Any], Any], job: Any) -> "Future[Any]":
        """The future of `function(job)`."""
        future: Future[Any] = Future()
        self._waiting.append(_Task(future, function, job))
        self._wake()
        return future

    def end(self, at_once: bool = False) -> None:
        """Ends all processes, once all jobs are done or at once."""
        self._closed, self._stopped = True, at_once
        self._wake()
        self._thread.join()
        self._bell.close()
        self._ring.close()

    def _wake(self) -> None:
        with self._lock:
            if not self._bell.poll():
                self._ring.send_bytes(b"1")

    def _run(self) -> None:
        try:
            while not self._stopped and not (self._closed and not self._waiting and not self._busy()):
                self._start()
                self._hand_out()
                self._hear()
        finally:
            for worker in [*self._workers, *self._leaving]:
                worker.end(0.0 if self._stopped else PATIENCE)
            for task in [*self._waiting, *(worker.task for worker in self._workers if worker.task is not None)]:
                if task.future.cancel():
                    task.future.set_running_or_notify_cancel()  # who waits for it hears of it
                else:
                    task.future.set_exception(WorkerEndedError("its process was ended"))

    def _busy(self) -> int:
        return sum(worker.task is not None for worker in self._workers)

    def _start(self) -> None:
        """Starts as many workers as there is work for."""
        while len(self._workers) < min(self._count, self._busy() + len(self._waiting)):
            if self._failed_starts >= STARTS and not self._workers:
                self._give_up()
            elif time.monotonic() < self._next_start:
                return
            else:
                try:
                    self._workers.append(_Worker(self._context))
                except OSError:  # no process, or no memory, is left just now
                    self._fail_start()

    def _fail_start(self) -> None:
        self._failed_starts += 1
        self._next_start = time.monotonic() + PAUSE * self._failed_starts

    def _give_up(self) -> None:
        sentence = f"{STARTS} worker processes in a row ended while they started, perhaps for want of memory"
        while self._waiting:
            future = self._waiting.popleft().future
            if future.set_running_or_notify_cancel():
                future.set_exception(WorkerLostError(sentence))
        self._failed_starts = 0

    def _hand_out(self) -> None:
        for worker in [worker for worker in self._workers if worker.ready and worker.task is None]:
            while self._waiting and worker.task is None:
                task = self._waiting.popleft()
                if not task.future.set_running_or_notify_cancel():
                    continue
                try:
                    data = pickle.dumps((task.function, task.job), pickle.HIGHEST_PROTOCOL)
                except Exception as error:  # of many classes
                    task.future.set_exception(error)
                    continue
                worker.task = task
                with suppress(OSError):  # it has just ended: `_hear` finds it so
                    worker.connection.send_bytes(data)

    def _hear(self) -> None:
        """Waits until a worker says something or ends, or until there is something new to do."""
        ends = {end: worker for worker in self._workers for end in (worker.connection, worker.process.sentinel)}
        missing = len(self._workers) < min(self._count, self._busy() + len(self._waiting))
        pause = max(self._next_start - time.monotonic(), 0.0) if missing else None
        heard = wait([self._bell, *ends], pause)
        if self._bell in heard:
            self._bell.recv_bytes()
        for worker in {id(ends[end]): ends[end] for end in heard if end in ends}.values():  # type: ignore[index]
            try:
                while worker.connection.poll():
                    self._answer(worker, worker.connection.recv_bytes())
            except (EOFError, OSError):  # the pipe is at its end, perhaps within an answer
                self._lose(worker)
                continue
            if worker.process.exitcode is not None:
                self._lose(worker)
            elif worker.done and worker.done == self._tasks_per_worker:
                self._workers.remove(worker)
                worker.connection.close()  # which it ends with
                self._leaving.append(worker)

    def _answer(self, worker: _Worker, data: bytes) -> None:
        if not worker.ready:
            worker.ready, self._failed_starts = True, 0
            return
        task, worker.task = worker.task, None
        worker.done += 1
        assert task is not None
        try:
            well, result = pickle.loads(data)
        except Exception as error:  # of many classes
            well, result = False, error
        if well:
            task.future.set_result(result)
        else:
            task.future.set_exception(result)

    def _lose(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.end(0.0)
        if worker.task is not None:
            worker.task.future.set_exception(
                WorkerEndedError("its process ended before it, perhaps for want of memory")
            )
        elif not worker.ready:
            self._fail_start()


def _work(connection: Connection) -> None:
    """What a worker does: job by job, until the pipe ends."""
    end_with_parent()
    with suppress(EOFError, OSError):
        connection.send_bytes(b"ready")
        while True:
            connection.send_bytes(_answered(connection.recv_bytes()))


def _answered(data: bytes) -> bytes:
    try:
        function, job = pickle.loads(data)
        return pickle.dumps((True, function(job)), pickle.HIGHEST_PROTOCOL)
    except BaseException as error:
        error.add_note(f"in a worker process:\n{traceback.format_exc()}")
        return pickle.dumps((False, _portable(error)), pickle.HIGHEST_PROTOCOL)


def _portable(error: BaseException) -> BaseException:
    """The error, or what it says where its class cannot be made again from its message."""
    with suppress(Exception):
        if type(pickle.loads(pickle.dumps(error))) is type(error):
            return error
    kind = DriftDrakeError if isinstance(error, DriftDrakeError) else RuntimeError
    return kind(one_line(error) if kind is DriftDrakeError else f"{type(error).__name__}: {one_line(error)}")
