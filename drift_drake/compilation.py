"""Compiled functions: numba, cached on disk, without numba's stale-cache trap."""

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


@cache
def _drop_stale_caches() -> None:
    """Removes caches older than any source file: numba looks only at the file that holds the compiled function."""
    package = Path(__file__).parent
    newest = max(source.stat().st_mtime for source in package.rglob("*.py"))
    for index in package.rglob("*.nbi"):
        # Another process may be dropping the same caches at the same time.
        with suppress(FileNotFoundError):
            if index.stat().st_mtime < newest:
                index.unlink()


def compiled(function: Function) -> Function:
    """Compiles a function for floats: IEEE arithmetic (no fast-math), so that a run replays to the bit."""
    _drop_stale_caches()
    result: Function = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    return result
