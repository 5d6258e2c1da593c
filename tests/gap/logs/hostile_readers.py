"""Readers that crash, hang, fill the memory or refuse: light to import, in the process that reads too."""

import os
import signal
import time
from pathlib import Path

from drift_drake.common.errors import DriftDrakeError


def crash(_path: Path) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def end(_path: Path) -> None:
    os._exit(7)


def fill(_path: Path) -> int:
    return len(bytes(8 << 30))


def compute(_path: Path) -> None:
    while True:
        pass


def wait(_path: Path) -> None:
    time.sleep(60.0)


def refuse(path: Path) -> None:
    raise DriftDrakeError(f"{path}: is not to my taste; give another")


def whose(_path: Path) -> int:
    return os.getpid()


def length(path: Path) -> int:
    """Of a file, whose path may be relative."""
    return len(path.read_bytes())
