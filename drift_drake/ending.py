"""How commands end: bad input, Ctrl-C and SIGTERM are answered in one line, and what was begun is undone."""

import os
import signal
import sys
from collections.abc import Callable, Sequence

from drift_drake.errors import DriftDrakeError, one_line, shown
from drift_drake.interruption import ENDS, TerminatedError, terminable

BAD_INPUT = 2  # exit code for input that cannot be used
NOT_READ = 141  # where standard output is closed by its reader, as of other programs in a shell


def ended_well(run: Callable[[], int], prefix: str, kept: str) -> int:
    """Runs a command; returns its exit code.

    Args:
        prefix: of the line that it ends with; kept: what is said of its results where a signal ended it.
    """
    with terminable() as came:
        try:
            code = run()
            sys.stdout.flush()
            return code
        except BaseException as error:
            if isinstance(error, BrokenPipeError) and not came:
                # `| head` has read what it wanted; nothing more can be said, not even at exit.
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
                return NOT_READ
            answer = _answer(error, came, kept)
            if answer is None:
                raise
            print(f"{prefix}{answer[0]}", file=sys.stderr)
            return answer[1]


def _answer(error: BaseException, came: Sequence[signal.Signals], kept: str) -> tuple[str, int] | None:
    """(what is said, exit code); None for a fault of ours."""
    if came or isinstance(error, KeyboardInterrupt | TerminatedError):
        terminated = came[0] == signal.SIGTERM if came else isinstance(error, TerminatedError)
        how, code = ENDS[signal.SIGTERM if terminated else signal.SIGINT]
        return f"{how}; {kept}", code
    if isinstance(error, DriftDrakeError):
        return one_line(error), BAD_INPUT
    if isinstance(error, OSError) and error.filename is not None:
        # A path that the system refuses: too long a name, a folder that may not be read.
        return f"{shown(str(error.filename))}: cannot be used ({error.strerror}); give another path", BAD_INPUT
    return None
