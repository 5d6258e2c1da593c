"""SIGTERM as an exception, so that worker processes and unfinished files are cleaned up before the process ends."""

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType


class TerminatedError(BaseException):
    """SIGTERM came."""


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Within the block, SIGTERM raises `TerminatedError`; only the main thread can ask for it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(_number: int, _frame: FrameType | None) -> None:
        raise TerminatedError

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
