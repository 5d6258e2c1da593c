"""Experiments: one file each, `python -m experiments.NAME`; results go to runs/.

Ctrl-C ends each in one line; what is done stays, and the same command goes on from there.
"""

import sys
from types import TracebackType


def _interrupted(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if issubclass(kind, KeyboardInterrupt):
        print("\ninterrupted; the same command with the same folder goes on where it was", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)


sys.excepthook = _interrupted

import diagrams  # noqa: E402, F401 (sets the number of BLAS threads before NumPy is imported)
