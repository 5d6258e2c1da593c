"""What a command says where it waits for the compiler: compiled functions are kept on the disk, and made once."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

SENTENCE = "compiling what this command needs, this once: up to a minute"
_SAID: list[bool] = [True]  # the newest: of the command that runs


@contextmanager
def said_once() -> Iterator[None]:
    """Has the first function that is compiled in a block be said on standard error."""
    _SAID.append(False)
    try:
        yield
    finally:
        _SAID.pop()


def say() -> None:
    """Says it, where it is wanted and has not been said."""
    if not _SAID[-1]:
        from tqdm import tqdm  # a bar may be in its line

        _SAID[-1] = True
        tqdm.write(SENTENCE, file=sys.stderr)
