"""The progress bar of a command, on standard error."""

import contextlib
import sys
from collections.abc import Callable, Iterator

from tqdm import tqdm

Progress = Callable[[str, float], None]
"""Is told a stage's name and the share done."""


@contextlib.contextmanager
def progress_bar(quiet: bool) -> Iterator[Progress]:
    """A bar that is told a stage's name and the share done; nothing where `quiet`."""
    with tqdm(total=100, disable=quiet, file=sys.stderr, bar_format="{l_bar}{bar}| {elapsed}") as bar:

        def show(stage: str, share: float) -> None:
            bar.set_description(stage)
            bar.update(round(100 * share) - bar.n)

        yield show
