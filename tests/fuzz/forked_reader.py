"""The process that reads foreign files, as a copy of the command's process: a fresh Python takes half a second."""

import contextlib
import os
import signal
import subprocess
import threading
import time
from multiprocessing.connection import Pipe

from drift_drake.common import apart


class _Copy:
    """What `subprocess.Popen` has of a process."""

    def __init__(self, pid: int) -> None:
        self.pid, self.returncode = pid, None

    def wait(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while self.returncode is None:
            ended, status = os.waitpid(self.pid, os.WNOHANG)
            if ended:
                self.returncode = os.waitstatus_to_exitcode(status)
            elif time.monotonic() > end:
                raise subprocess.TimeoutExpired("reader", seconds)
            else:
                time.sleep(0.002)

    def kill(self) -> None:
        if self.returncode is None:
            os.kill(self.pid, signal.SIGKILL)


class ForkedReader(apart._Reader):
    """Begun by a fork; all else is the product's."""

    def __init__(self) -> None:
        self._lock, self._owner = threading.Lock(), os.getpid()
        self._connection, theirs = Pipe()
        child = os.fork()
        if child == 0:
            with contextlib.suppress(BaseException):
                self._connection.close()
                null = os.open(os.devnull, os.O_RDWR)
                for number in (0, 1, 2):
                    os.dup2(null, number)
                apart.serve(theirs.fileno())
            os._exit(0)
        theirs.close()
        self._process = _Copy(child)


def read_by_copies() -> None:
    """From now on in this process and in its copies."""
    apart._Reader = ForkedReader
