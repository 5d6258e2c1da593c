"""Folders for files that are not finished yet: locked while their process writes, removed once it has ended."""

import contextlib
import fcntl
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path

PARTIAL = ".part-"  # how the folders' names begin; eight hexadecimal digits follow
_NAME = re.compile(re.escape(PARTIAL) + "[0-9a-f]{8}")


@contextlib.contextmanager
def unfinished_folder(beside: Path) -> Iterator[Path]:
    """A new hidden folder in the folder `beside`, removed with all in it at the end of the block.

    What `kill -9` or a loss of power left of such folders in the same place is removed first. Which these are is seen
    by a lock, which the kernel releases with the process: a number of a process may be another one's by now, or one of
    another machine on a shared disk. Where the file system has no locks, nothing is removed.

    Raises:
        OSError: the folder cannot be made.
    """
    remove_left_behind(beside.resolve())
    folder, lock = _make_locked(beside)
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


def _make_locked(beside: Path) -> tuple[Path, int | None]:
    """A folder and its lock; None where the file system has no locks."""
    while True:
        folder = beside / f"{PARTIAL}{secrets.token_hex(4)}"
        folder.mkdir()
        try:
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        except FileNotFoundError:  # removed by another process before it was locked
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX)
        except OSError:
            os.close(lock)
            return folder, None
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.stat(folder), os.fstat(lock)):
                return folder, lock
        os.close(lock)


@contextlib.contextmanager
def _opened(folder: Path) -> Iterator[int]:
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        yield number
    finally:
        os.close(number)
