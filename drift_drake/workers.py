"""Worker processes that end with the process that started them, however it ends."""

import multiprocessing
import os
import threading
from multiprocessing import resource_tracker
from multiprocessing.connection import wait
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


def end_with_parent() -> None:
    """What a worker begins with: it ends when the process that started it does."""
    parent = multiprocessing.parent_process()
    watched = [] if parent is None else [parent.sentinel]

    def end() -> None:
        wait(watched)  # readable once the parent's end is closed
        os._exit(ENDED_WITH_PARENT)

    threading.Thread(target=end, daemon=True).start()
