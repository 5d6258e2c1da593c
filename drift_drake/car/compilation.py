"""Compiled functions: numba, cached on disk, without numba's stale-cache trap."""

import os
import re
from collections.abc import Callable
from contextlib import suppress
from functools import cache, wraps
from pathlib import Path
from typing import Any, TypeVar

import numba
from filelock import FileLock
from numba.core.compiler_lock import global_compiler_lock
from numba.extending import register_jitable

from drift_drake.car.effects.trial import extensions_folder, installed_sources
from drift_drake.common import first_use

Function = TypeVar("Function", bound=Callable[..., Any])


PACKAGE = Path(__file__).parents[1]
IMPORTS = re.compile(r"^[ \t]*(?:from|import) +(drift_drake[\w.]*)(?: +import +(\([^)]*\)|.*))?", re.MULTILINE)


@cache
def _imported(source: Path) -> frozenset[Path]:
    """The package's files that a file of it imports."""
    named = [(module, *(f"{module}.{name}" for name in re.findall(r"\w+", names)))
             for module, names in IMPORTS.findall(source.read_text(encoding="utf-8"))]  # fmt: skip
    paths = {PACKAGE.parent.joinpath(*name.split(".")) for names in named for name in names}
    return frozenset(file for path in paths for file in (path.with_suffix(".py"), path / "__init__.py")
                     if file.is_file())  # fmt: skip


def rests_on(source: Path) -> set[Path]:
    """The file and all of the package's files that it imports, directly or not."""
    found, new = {source}, {source}
    while new:
        new = set[Path]().union(*(_imported(file) for file in new)) - found
        found |= new
    return found


@cache
def _drop_stale_caches() -> None:
    """Removes caches older than a file that they rest on: numba looks only at the file that holds the function."""
    newest = max(source.stat().st_mtime for source in PACKAGE.rglob("*.py"))
    for index in PACKAGE.rglob("*.nbi"):
        # Another process may be dropping the same caches at the same time.
        with suppress(FileNotFoundError):
            written = index.stat().st_mtime
            source = index.parents[1] / f"{index.name.partition('.')[0]}.py"
            # What imports cost is asked only where some file is newer at all.
            if written < newest and (
                not source.is_file() or written < max(file.stat().st_mtime for file in rests_on(source))
            ):
                index.unlink()


@cache
def _drop_stale_caches_of(source: Path) -> None:
    """The same for a file outside the package, such as an experiment's: it rests on the package as a whole."""
    if PACKAGE not in source.parents:
        newest = max(file.stat().st_mtime for file in PACKAGE.rglob("*.py"))
        for index in (source.parent / "__pycache__").glob(f"{source.stem}.*.nbi"):
            with suppress(FileNotFoundError):
                if index.stat().st_mtime < newest:
                    index.unlink()


@cache
def _cache_folder() -> str:
    """Where compiled functions are kept: numba's own choice, but where other packages' functions are compiled in."""
    installed = installed_sources()
    if not installed:
        return str(numba.config.CACHE_DIR)
    newest = max(source.stat().st_mtime for source in PACKAGE.rglob("*.py"))
    return str(extensions_folder() / f"{installed}-{newest:.0f}")


def compiled(function: Function) -> Function:
    """Compiles a function for floats: IEEE arithmetic (no fast-math), so that a run replays to the bit."""
    _drop_stale_caches()
    _drop_stale_caches_of(Path(function.__code__.co_filename))
    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, _cache_folder()
    result: Function = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    numba.config.CACHE_DIR = before
    if not numba.config.DISABLE_JIT:
        _compile_one_process_at_a_time(result, function.__qualname__)
    return result


def inlined(function: Function) -> Function:
    """Marks a long function that one compiled function calls: it is compiled once, as a part of that one."""
    result: Function = numba.njit(inline="always", error_model="numpy")(function)
    return result


@register_jitable
def copied(values: Any, out: Any) -> None:
    """Writes values [n] to out [n]: as `out[:] = values`, whose message for two sizes takes seconds to compile."""
    for i in range(len(out)):
        out[i] = values[i]


def _compile_one_process_at_a_time(dispatcher: Any, name: str) -> None:
    """Processes that need a function at the same time compile it once; the others then find it on the disk.

    Without a lock both compile it, and may give two signatures' files one number. Numba's own lock, over threads, is
    taken first: who waits for a process holds nothing that a thread of that process could wait for.
    """
    compile_signature, folder = dispatcher.compile, Path(dispatcher.stats.cache_path)

    @wraps(compile_signature)
    def compile_alone(signature: Any) -> Any:
        with global_compiler_lock:
            if tuple(signature) in dispatcher.overloads or not os.access(folder, os.W_OK):
                return compile_signature(signature)
            with FileLock(folder / f"{Path(dispatcher.py_func.__code__.co_filename).stem}.{name}.lock"):
                return compile_signature(signature)

    load = dispatcher._cache.load_overload  # numba has no public way to learn that nothing is kept

    def load_or_say(signature: Any, target: Any) -> Any:
        found = load(signature, target)
        if found is None:
            first_use.say()
        return found

    dispatcher.compile, dispatcher._cache.load_overload = compile_alone, load_or_say
