"""How many threads matrix products take."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()  # some 10 ms: it looks at all libraries that are loaded


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """One thread of BLAS within, for a block or, as a decorator, a function.

    The matrices of a horizon are small: one thread is faster than several, ten times so when other work runs.
    """
    with _libraries().limit(limits=1, user_api="blas"):
        yield
