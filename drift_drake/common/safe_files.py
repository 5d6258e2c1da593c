"""Writing that loses nothing: to a temporary file next to the destination, which takes its place once complete."""

import contextlib
import errno
import fcntl
import gzip
import os
import re
import secrets
import shutil
import stat
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drift_drake.common.errors import OutputError

if TYPE_CHECKING:
    import numpy as np

PARTIAL = ".part-"  # how the folders' names begin; eight hexadecimal digits follow
_NAME = re.compile(re.escape(PARTIAL) + "[0-9a-f]{8}")
STANDARD_OUTPUT = Path("-")
ROWS_AT_ONCE = 10_000
PATIENCE = 5.0  # [s] that a named pipe may be without a reader
PROBE = 4096  # bytes that must fit where a result is to be written


@contextlib.contextmanager
def unfinished_folder(parent: Path) -> Iterator[Path]:
    """A new hidden folder in the folder `parent`, removed with all in it at the end of the block.

    What `kill -9` or a loss of power left of such folders in the same place is removed first. Which these are is seen
    by a lock, which the kernel releases with the process: a number of a process may be another one's by now, or one of
    another machine on a shared disk. Where the file system has no locks, nothing is removed.

    Raises:
        OSError: the folder cannot be made.
    """
    remove_left_behind(parent.resolve())
    folder, lock = _make_locked(parent)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


@cache  # once a process: a folder of thousands of files is not listed for each of them
def remove_left_behind(folder: Path) -> None:
    """Removes the folders for unfinished files that no process holds."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for name in [entry.name for entry in entries if _NAME.fullmatch(entry.name)]:
            with contextlib.suppress(OSError), _opened(folder / name) as lock:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder / name, ignore_errors=True)


def _make_locked(parent: Path) -> tuple[Path, int | None]:
    """A folder and its lock; None where the file system has no locks."""
    while True:
        folder = parent / f"{PARTIAL}{secrets.token_hex(4)}"
        folder.mkdir()
        lock = None
        try:
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX)
            except OSError:
                os.close(lock)
                return folder, None
            if os.path.samestat(os.stat(folder), os.fstat(lock)):
                return folder, lock
        except FileNotFoundError:  # removed by another process before it was locked
            pass
        except OSError:
            shutil.rmtree(folder, ignore_errors=True)
            if lock is not None:
                os.close(lock)
            raise
        if lock is not None:
            os.close(lock)


@contextlib.contextmanager
def _opened(folder: Path) -> Iterator[int]:
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        yield number
    finally:
        os.close(number)


@contextlib.contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """The path of a temporary file to write, which replaces `path` at the end of the block.

    The folder is made. If the block raises, or the process ends within it, `path` keeps what it held. The temporary
    file has the same name, which tells many writers the format, in a folder of its own next to `path`. A link is
    followed; what is no regular file (/dev/null, a pipe that somebody reads) is written to directly.

    Raises:
        OutputError: the file cannot be written.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        target = Path(os.path.realpath(path))
        if _special(path):
            with _with_reader(path):
                yield path
            return
        with unfinished_folder(target.parent) as folder:
            part = folder / target.name
            yield part
            _flush(part)
            if target.exists():
                part.chmod(stat.S_IMODE(target.stat().st_mode))
            part.replace(target)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(_sentence(path, error)) from error


@contextlib.contextmanager
def writing_together(folder: Path) -> Iterator[Path]:
    """A temporary folder to write files into, which are all moved to `folder` at the end of the block.

    Raises:
        OutputError: a file cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with unfinished_folder(folder) as part:
            yield part
            for path in sorted(part.iterdir()):
                _flush(path)
            for path in sorted(part.iterdir()):
                path.replace(folder / path.name)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(_sentence(folder, error)) from error


def write_bytes(path: str | Path, data: bytes) -> None:
    """Writes a binary file, whole or not at all."""
    with replacing(path) as part:
        part.write_bytes(data)


def write_text(path: str | Path, text: str) -> None:
    """Writes a text file in UTF-8, whole or not at all."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def try_outputs(outputs: Mapping[str, Path | None], inputs: Iterable[str | Path] = ()) -> None:
    """Sees before a computation that its results can be written, and tells on standard error which files exist.

    Args:
        outputs: path of the file by option (`--out`); None, and `-` for standard output, are passed over.
        inputs: files that no output may replace.

    Raises:
        OutputError: a folder cannot be made or written to, a path is a folder's or an input's, or two are the same.
    """
    wanted = {option: path for option, path in outputs.items() if path is not None and path != STANDARD_OUTPUT}
    taken = {Path(os.path.realpath(path)): "an input" for path in inputs}
    for option, path in wanted.items():
        try:
            folder, special, real = path.is_dir(), _special(path), Path(os.path.realpath(path))
        except (OSError, ValueError) as error:
            raise OutputError(f"{option} {_sentence(path, error)}") from None
        if folder:
            raise OutputError(f"{option} {path}: is a folder; give the name of a file")
        if special:
            continue
        if real in taken:
            raise OutputError(f"{option} {path}: is {taken[real]} too; give another file")
        taken[real] = f"that of {option}"
        try_folder(path.parent, option)
    for option, path in wanted.items():
        if os.path.isfile(path):
            print(f"{option} {path}: exists and will be replaced", file=sys.stderr)


def try_folder(folder: Path, option: str) -> None:
    """Makes a folder that files can be written to; raises OutputError where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with unfinished_folder(folder) as part:
            (part / "probe").write_bytes(bytes(PROBE))  # a full disk still takes folders
    except (OSError, ValueError) as error:
        raise OutputError(f"{option} {_sentence(folder, error)}") from None


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Holds the folder of --out while the block works on its results, so that no two processes mix theirs.

    Raises:
        OutputError: it cannot be written to, or another process holds it.
    """
    try_folder(folder, "--out")
    with unfinished_folder(folder) as own:
        others = [path.name for path in folder.iterdir() if path.name.startswith(PARTIAL) and path.name != own.name]
        if others:
            raise OutputError(
                f"--out {folder}: another process is writing there; give another folder, or remove {others[0]} if "
                "none is"
            )
        yield


def _special(path: Path) -> bool:
    return path.exists() and not path.is_file() and not path.is_dir()


@contextlib.contextmanager
def _with_reader(path: Path) -> Iterator[None]:
    """Holds a named pipe open while it is written to; raises OutputError where nobody comes to read it."""
    if not path.is_fifo():
        yield
        return
    end = time.monotonic() + PATIENCE
    while True:
        try:
            pipe = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
            break
        except OSError as error:
            if error.errno != errno.ENXIO:
                raise
        if time.monotonic() > end:
            raise OutputError(f"{path}: is a pipe that nothing reads; start its reader, or give the name of a file")
        time.sleep(0.01)
    try:
        yield
    finally:
        os.close(pipe)


def _flush(path: Path) -> None:
    """Onto the disk: a renamed file whose content is still in memory is empty after a loss of power."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def _sentence(path: Path, error: Exception) -> str:
    path = Path(*[part for part in path.parts if not part.startswith(PARTIAL)])
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return f"{path}: cannot be written ({reason}); give another place, or free some space"


def write_table(table: Any, path: str | Path, **options: Any) -> None:
    """Writes a pandas table as CSV, whole or not at all; options are those of `to_csv`."""
    with replacing(path) as part:
        table.to_csv(part, **options)


def write_columns(columns: "Mapping[str, np.ndarray]", path: str | Path) -> None:
    """Writes columns of numbers of equal length as CSV (packed for `.gz`), whole or not at all; NaN is left empty.

    A third of the time that pandas takes, which writes the same text.
    """
    import numpy as np  # slow to import

    rows, line = np.column_stack(list(columns.values())), ",".join(["%.9g"] * len(columns)) + "\n"
    with replacing(path) as part, gzip.open(part, "wt") if part.suffix == ".gz" else part.open("w") as file:
        file.write(",".join(columns) + "\n")
        for begin in range(0, len(rows), ROWS_AT_ONCE):
            block = rows[begin : begin + ROWS_AT_ONCE]
            text = line * len(block) % tuple(block.ravel().tolist())
            file.write(text.replace("nan", "") if np.isnan(block).any() else text)


def write_figure(figure: Any, path: str | Path, **options: Any) -> None:
    """Writes a matplotlib figure, whole or not at all; options are those of `savefig`."""
    with replacing(path) as part:
        figure.savefig(part, **options)


def write_arrays(path: str | Path, **arrays: Any) -> None:
    """Writes arrays as .npz, whole or not at all."""
    from numpy import savez

    with replacing(path) as part, part.open("wb") as file:
        savez(file, **arrays)
