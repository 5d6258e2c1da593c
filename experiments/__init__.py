"""Experiments, `python -m experiments.FOLDER.NAME`; results go to runs/.

Ctrl-C ends each in one line; what is done stays, and the same command goes on from there.
"""

import multiprocessing
import signal
import sys
from types import FrameType, TracebackType

_interrupted = False


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _interrupted
    _interrupted = True
    signal.default_int_handler(number, frame)


def _tell(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if not (_interrupted or issubclass(kind, KeyboardInterrupt)):
        sys.__excepthook__(kind, error, trace)
    elif multiprocessing.parent_process() is None:
        print("\ninterrupted; the same command with the same folder goes on where it was", file=sys.stderr)


sys.excepthook = _tell
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _interrupt)  # an exception within the imports of compiled modules becomes another one

import diagrams  # noqa: E402, F401 (sets the number of BLAS threads before NumPy is imported)
