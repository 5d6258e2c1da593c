"""How a command ends: in one line, whatever ends it.

Ctrl-C, SIGTERM and a terminal that is closed: clean up first, once something was begun; before that, end at once.
Memory that is short, and standard output that is closed or full, are answered as bad input is.
"""

import contextlib
import errno
import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from types import FrameType
from typing import TextIO

from drift_drake.common.errors import DriftDrakeError, one_line, shown

ENDS = {signal.SIGINT: ("interrupted", 130), signal.SIGTERM: ("terminated", 143), signal.SIGHUP: ("hung up", 129)}
"""What a command says when it is ended by a signal, and its exit code."""
IMPORTER = "<frozen importlib._bootstrap>"  # the file of Python's own frames while it imports
AGAIN = 0.05  # [s] after which a signal that came within an import comes again
BAD_INPUT = 2  # exit code for input that cannot be used
NO_PLACE = (errno.ENOSPC, errno.EIO, errno.EBADF, errno.EFBIG, errno.EDQUOT)  # of what is no file with a name
NOT_READ = 141  # where standard output is closed by its reader, as of other programs in a shell


NO_MEMORY = re.compile("cannot allocate memory|failed to map segment|bad_alloc|out of memory", re.IGNORECASE)
"""What the system says where a library cannot be loaded for want of memory."""


class TerminatedError(BaseException):
    """SIGTERM or SIGHUP came."""


@contextlib.contextmanager
def terminable() -> Iterator[list[signal.Signals]]:
    """Within the block Ctrl-C raises KeyboardInterrupt, other ends `TerminatedError`, so that what was begun is undone.

    Gives the signals that came: compiled code may hand on another exception than the one that was raised within it.
    Within an import a signal waits for the import's end. Only the main thread can ask for it.
    """
    came: list[signal.Signals] = []

    def end(number: int, frame: FrameType | None) -> None:
        if _importing(frame):
            again = threading.Timer(AGAIN, os.kill, (os.getpid(), number))
            again.daemon = True
            again.start()
            return
        came.append(signal.Signals(number))
        raise KeyboardInterrupt if number == signal.SIGINT else TerminatedError

    with _answered(end):
        yield came


@contextlib.contextmanager
def ctrl_c_waits() -> Iterator[None]:
    """Within the block Ctrl-C waits for the block's end; threads and processes that it begins never see it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def signals_wait() -> Iterator[None]:
    """Within the block Ctrl-C and SIGTERM wait for its end, whichever thread of the process they come to."""
    came: list[int] = []
    try:
        with _answered(lambda number, _frame: came.append(number)):
            yield
    finally:
        for number in came[:1]:
            signal.raise_signal(number)


@contextlib.contextmanager
def ended_at_once(prefix: str = "drift-drake: ") -> Iterator[None]:
    """Within the block, which must have begun nothing, Ctrl-C and SIGTERM end the process in one line.

    For imports: an exception raised within those of compiled modules is lost, or becomes another one. Only the main
    thread can ask for it.
    """

    def end(number: int, _frame: FrameType | None) -> None:
        how, code = ENDS[signal.Signals(number)]
        os.write(2, f"{prefix}{how} before anything was begun\n".encode())
        os._exit(code)

    with _answered(end):
        yield


def _importing(frame: FrameType | None) -> bool:
    while frame is not None and frame.f_code.co_filename != IMPORTER:
        frame = frame.f_back
    return frame is not None


def leave_ends_to_the_system() -> None:
    """For a command that has not begun, or is over: Python itself has no lines of its own for a signal."""
    for number in _heeded():
        signal.signal(number, signal.SIG_DFL)


def _heeded() -> list[signal.Signals]:
    """Those that are not ignored, as a shell's background jobs ignore Ctrl-C; none but in the main thread."""
    if threading.current_thread() is not threading.main_thread():
        return []
    return [number for number in ENDS if signal.getsignal(number) is not signal.SIG_IGN]


@contextlib.contextmanager
def _answered(end: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    before = {number: signal.signal(number, end) for number in _heeded()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def ended_well(run: Callable[[], int], prefix: str, kept: str) -> int:
    """Runs a command; returns its exit code.

    Args:
        prefix: of the line that it ends with; kept: what is said of its results where a signal ended it.
    """
    came: list[signal.Signals] = []
    try:
        with terminable() as came:
            try:
                code = run()
                sys.stdout.flush()
                return code
            except BaseException as error:
                return _ended_by(error, came, prefix, kept)
    except (KeyboardInterrupt, TerminatedError) as error:  # which came while the block was left
        return _ended_by(error, came, prefix, kept)


def _ended_by(error: BaseException, came: Sequence[signal.Signals], prefix: str, kept: str) -> int:
    """Says what ended a command; its exit code. Raises a fault of ours."""
    if isinstance(error, BrokenPipeError) and not came:
        # `| head` has read what it wanted; nothing more can be said, not even at exit.
        _to_nowhere(sys.stdout)
        return NOT_READ
    answer = _answer(error, came, kept)
    if answer is None:
        raise error
    with contextlib.suppress(OSError):  # whose reader is gone, too
        print(f"{prefix}{answer[0]}", file=sys.stderr, flush=True)
    _to_nowhere_if_broken(sys.stdout)
    _to_nowhere_if_broken(sys.stderr)
    return answer[1]


def stand_in_for_closed_streams(prefix: str = "drift-drake: ") -> int | None:
    """Opens what of standard input, output and error is closed, lest the next file takes its place.

    Returns:
        The exit code where standard output is closed, which a command ends with; None where it is open.
    """
    closed = [number for number in range(3) if not _is_open(number)]
    for _ in closed:
        os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    if 2 in closed:
        sys.stderr = open(2, "w")  # noqa: SIM115
    if 1 not in closed:
        return None
    os.write(2, f"{prefix}standard output is closed; give it a place, such as > /dev/null\n".encode())
    return BAD_INPUT


def _is_open(number: int) -> bool:
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


def _to_nowhere(stream: TextIO) -> None:
    """Lets a stream that takes nothing any more lose what it still holds, which Python writes at its end."""
    with contextlib.suppress(OSError, ValueError):  # of a stream that is no file
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)


def _to_nowhere_if_broken(stream: TextIO) -> None:
    try:
        stream.flush()
    except (OSError, ValueError):
        _to_nowhere(stream)


def _answer(error: BaseException, came: Sequence[signal.Signals], kept: str) -> tuple[str, int] | None:
    """(what is said, exit code); None for a fault of ours."""
    if came or isinstance(error, KeyboardInterrupt | TerminatedError):
        number = came[0] if came else signal.SIGTERM if isinstance(error, TerminatedError) else signal.SIGINT
        how, code = ENDS[number]
        return f"{how}; {kept}", code
    if isinstance(error, DriftDrakeError):
        return one_line(error), BAD_INPUT
    if isinstance(error, MemoryError) or (isinstance(error, ImportError | OSError) and NO_MEMORY.search(str(error))):
        return "there is too little memory for this; end other programs, or give less at a time", BAD_INPUT
    if isinstance(error, OSError) and error.filename is not None:
        # A path that the system refuses: too long a name, a folder that may not be read.
        return f"{shown(str(error.filename))}: cannot be used ({error.strerror}); give another path", BAD_INPUT
    if isinstance(error, OSError) and error.errno in NO_PLACE:
        return (
            f"standard output cannot be written ({error.strerror}); free some space, or give it another place",
            BAD_INPUT,
        )
    return None
