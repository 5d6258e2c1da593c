"""Files of foreign formats are read in a process of their own, with limits of memory and time.

The libraries that read them trust what a file says of itself: a byte may end Python, a kilobyte may claim gigabytes.
There it ends that process, and one sentence says so. It is started for the first file and kept for further ones.
"""

import atexit
import contextlib
import importlib
import os
import pickle
import resource
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any, TypeVar

from drift_drake.common.bounds import check_claims, is_small_text
from drift_drake.common.errors import DriftDrakeError, one_line
from drift_drake.common.interruption import ctrl_c_waits

Result = TypeVar("Result")
MEGABYTE = 1 << 20
MEMORY, MEMORY_PER_BYTE = 1024 * MEGABYTE, 16  # [bytes] that reading may take, and for each byte of the file
SECONDS, SECONDS_PER_MEGABYTE = 10.0, 1.0  # of processor time
STARTED = 60.0  # [s] that its start may take
ENDING = 0.2  # [s] that an end may take
SLICE = 0.05  # [s] between looks at what it does
ONE_THREAD = {  # threads reserve memory that they do not use, which the limit counts
    "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "ARROW_IO_THREADS": "1", "MALLOC_ARENA_MAX": "1",
    "ARROW_DEFAULT_MEMORY_POOL": "system",
}  # fmt: skip
PROGRAM = "import sys; sys.path[:] = {path!r}; from drift_drake.common.apart import serve; serve({number})"


class _OutOfMemoryError(DriftDrakeError):
    """Reading took more than the limit."""


class _EndedError(DriftDrakeError):
    """The process that reads ended, or was ended."""


def read_guarded(function: Callable[..., Result], path: Path, error: type[DriftDrakeError], *more: Any) -> Result:
    """What a module's function makes of a file, or of a folder: text of a moderate size here, all else apart.

    Args:
        more: further arguments of the function.

    Raises:
        error: reading takes too much memory or time, crashes, or raises anything but a `DriftDrakeError` of its own.
    """
    return function(path, *more) if is_small_text(path) else read_apart(function, path, error, *more)


def read_apart(function: Callable[..., Result], path: Path, error: type[DriftDrakeError], *more: Any) -> Result:
    """The same in the process that reads, whatever the file is."""
    size = _size(path)
    memory, seconds = MEMORY + MEMORY_PER_BYTE * size, SECONDS + SECONDS_PER_MEGABYTE * size / MEGABYTE
    try:
        return _reader().read(function, (path, *more), memory, seconds)
    except _OutOfMemoryError:
        reason = f"it takes more than {memory / 1e9:.1f} GB of memory"
    except TimeoutError:
        reason = f"it takes more than {seconds:.0f} s"
    except _EndedError as end:
        reason = f"its reader crashed: {end}"
    except DriftDrakeError:
        raise
    except ValueError as other:
        reason = one_line(other)
    raise error(
        f"{path}: cannot be read ({reason}); write it anew if it is damaged, or cut it into shorter files"
    ) from None


def _size(path: Path) -> int:
    with contextlib.suppress(OSError):
        files = path.iterdir() if path.is_dir() else [path]
        return sum(file.stat().st_size for file in files)
    return 0


class _Reader:
    """The process that reads, and this end of its pipe."""

    def __init__(self) -> None:
        self._lock, self._owner = threading.Lock(), os.getpid()
        self._connection, theirs = Pipe()
        program = PROGRAM.format(path=[entry or os.getcwd() for entry in sys.path], number=theirs.fileno())
        flags = subprocess._args_from_interpreter_flags()  # type: ignore[attr-defined]
        with theirs, ctrl_c_waits():  # which the terminal sends to it too
            self._process = subprocess.Popen(
                [sys.executable, *flags, "-c", program], env=os.environ | ONE_THREAD, pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip

    def read(self, function: Callable[..., Result], given: tuple[Any, ...], memory: float, seconds: float) -> Result:
        with self._lock:
            try:
                self._wait(STARTED)  # its start is not the file's
                self._connection.recv_bytes()
                self._connection.send((os.getcwd(), function.__module__, function.__qualname__, given, memory, seconds))
                self._wait(seconds)
                data, sizes = self._connection.recv()
                buffers = [bytearray(size) for size in sizes]
                for buffer in buffers:
                    if buffer:
                        self._connection.recv_bytes_into(buffer)
            except (EOFError, OSError) as error:
                self.end()
                if isinstance(error, TimeoutError) or self._process.returncode == -signal.SIGXCPU:
                    raise TimeoutError from None
                raise _EndedError(_how(self._process.returncode)) from None
            except BaseException:  # Ctrl-C: an answer that is not waited for must not be the next file's
                self.end()
                raise
        result, refusal = pickle.loads(data, buffers=buffers)
        if refusal is not None:
            raise refusal
        return result  # type: ignore[no-any-return]

    def _wait(self, seconds: float) -> None:
        """Waits until it says something; raises TimeoutError where it rests so long.

        That it computes, or would if other work left it a processor, is limited by its processor time.
        """
        left = seconds
        while not self._connection.poll(SLICE):
            left -= 0.0 if self._computes() else SLICE
            if left < 0.0:
                raise TimeoutError

    def _computes(self) -> bool:
        try:
            return Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()[0] == "R"
        except OSError:
            return False

    def end(self) -> None:
        self._connection.close()
        if os.getpid() != self._owner:  # a copy in a forked process
            return
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(ENDING)  # how it ended by itself, if it did
        self._process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(STARTED)
        _OF_PROCESS.pop(self._owner, None)
        atexit.unregister(self.end)


def _how(code: int | None) -> str:
    if code is None or code >= 0:
        return f"exit code {code}"
    name = signal.Signals(-code).name
    return f"{name}, perhaps for want of memory" if -code == signal.SIGKILL else name


_OF_PROCESS: dict[int, _Reader] = {}  # a forked process has a reader of its own


def _reader() -> _Reader:
    number = os.getpid()
    if number not in _OF_PROCESS:
        _OF_PROCESS[number] = reader = _Reader()
        atexit.register(reader.end)
    return _OF_PROCESS[number]


def serve(number: int) -> None:
    """What the process that reads does: file by file, until the pipe ends."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with Connection(number) as connection, contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            connection.send_bytes(b"ready")
            here, module, name, given, memory, seconds = connection.recv()
            os.chdir(here)  # paths are said as they were given
            function = getattr(importlib.import_module(module), name)
            buffers: list[pickle.PickleBuffer] = []
            try:
                with _limited(memory, seconds):
                    check_claims(given[0])
                    data = _pickled((function(*given), None), buffers)
            except Exception as error:  # of classes that this process alone may have
                buffers.clear()
                data = _pickled((None, _portable(error)), [])
            views = [buffer.raw() for buffer in buffers]
            connection.send((data, [view.nbytes for view in views]))
            for view in views:
                if view.nbytes:
                    connection.send_bytes(view)
            del data, views, buffers  # which hold the file


def _pickled(answer: tuple[Any, Exception | None], buffers: list[pickle.PickleBuffer]) -> bytes:
    return pickle.dumps(answer, pickle.HIGHEST_PROTOCOL, buffer_callback=buffers.append)


def _portable(error: Exception) -> Exception:
    if isinstance(error, MemoryError):
        return _OutOfMemoryError()
    if isinstance(error, DriftDrakeError | ValueError | OSError):
        return error if isinstance(error, DriftDrakeError) else ValueError(one_line(error))
    return ValueError(f"{type(error).__name__}: {one_line(error)}")


@contextlib.contextmanager
def _limited(memory: float, seconds: float) -> Iterator[None]:
    """Limits of what the block takes: address space [bytes] and processor time [s], which ends the process."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    for kind, limit in (
        (resource.RLIMIT_AS, _address_space() + memory),
        (resource.RLIMIT_CPU, used.ru_utime + used.ru_stime + seconds + 1.0),
    ):
        most = resource.getrlimit(kind)[1]
        with contextlib.suppress(ValueError, OSError):  # a system that has no such limit
            resource.setrlimit(kind, (int(limit) if most == resource.RLIM_INFINITY else min(int(limit), most), most))
    try:
        yield
    finally:
        for kind in (resource.RLIMIT_AS, resource.RLIMIT_CPU):
            most = resource.getrlimit(kind)[1]
            with contextlib.suppress(ValueError, OSError):
                resource.setrlimit(kind, (most, most))


def _address_space() -> int:
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    except OSError:
        return 1024 * MEGABYTE
