"""Ctrl-C and SIGTERM: clean up first, once something was begun; before that, end at once."""

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from types import FrameType

ENDS = {signal.SIGINT: ("interrupted", 130), signal.SIGTERM: ("terminated", 143)}
"""What a command says when it is ended by a signal, and its exit code."""


class TerminatedError(BaseException):
    """SIGTERM came."""


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Within the block, SIGTERM raises `TerminatedError`, so that worker processes and unfinished files are cleaned up.

    Only the main thread can ask for it.
    """
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


@contextlib.contextmanager
def ctrl_c_waits() -> Iterator[None]:
    """Within the block Ctrl-C waits for the block's end; threads and processes that it begins never see it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def ended_at_once(name: str = "drift-drake") -> Iterator[None]:
    """Within the block, which must have begun nothing, Ctrl-C and SIGTERM end the process in one line.

    For imports: an exception raised within those of compiled modules is lost, or becomes another one. Only the main
    thread can ask for it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, _frame: FrameType | None) -> None:
        how, code = ENDS[signal.Signals(number)]
        os.write(2, f"{name}: {how} before anything was begun\n".encode())
        os._exit(code)

    before = {number: signal.signal(number, end) for number in ENDS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
