"""Worker processes that end with the process that started them, however it ends."""

import multiprocessing
import os
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnContext, SpawnProcess

from drift_drake.interruption import ctrl_c_waits, signals_wait

ENDED_WITH_PARENT = 1  # exit code of a worker


class _Worker(SpawnProcess):
    """Ctrl-C, which reaches all processes of a terminal, is left to the parent to answer, once for all.

    Blocked from before the process starts: it imports for a second before it can say for itself what it does with it.
    A start that were broken off would leave a worker that waits for its first orders in vain, and says so.
    """

    def start(self) -> None:
        track_resources()  # as the first start would, which then undoes the mask
        with signals_wait(), ctrl_c_waits():
            super().start()


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
    Process = _Worker  # type: ignore[assignment]


SPAWNING = _Spawning()
"""How workers are started, in pools of `multiprocessing` too."""


@contextmanager
def worker_processes(count: int | None = None) -> Iterator[ProcessPoolExecutor]:
    """A pool of fresh processes, as many as there are cores if no count is given.

    They end at once if the block raises (Ctrl-C included) or if this process ends, by a signal too. Not forked: a fork
    would copy Drake's, BLAS's and other threads in whatever state they are.
    """
    track_resources()
    before = set(multiprocessing.active_children())
    watched, held = SPAWNING.Pipe(duplex=False)
    pool = ProcessPoolExecutor(count, mp_context=SPAWNING, initializer=end_with_parent, initargs=(watched,))
    try:
        with held:  # closed before the pool waits for its workers, if the block raises
            yield pool
            pool.shutdown()
    except BaseException:
        for process in set(multiprocessing.active_children()) - before:
            process.terminate()  # those too that have not begun to watch
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        watched.close()


def end_with_parent(*held: Connection) -> None:
    """What a worker begins with: it ends when the process that started it does, or closes one of the pipes given."""
    parent = multiprocessing.parent_process()
    watched: list[Connection | int] = [*held, *([parent.sentinel] if parent is not None else [])]

    def end() -> None:
        wait(watched)  # readable once their other ends are closed
        os._exit(ENDED_WITH_PARENT)

    threading.Thread(target=end, daemon=True).start()
