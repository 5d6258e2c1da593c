"""How many inputs are tried, how long each may take, and what counts as a good end.

`make fuzz` sets FUZZ_CASES, the number of cases in all; without, each target gets a few that are the same every time.
"""

import os
import signal
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from hypothesis import HealthCheck, settings

from drift_drake.common.errors import LONGEST_LINE, DriftDrakeError, one_line

CASES = int(os.environ.get("FUZZ_CASES", "0"))
FEW = 20  # cases of a target in the test suite
LONGEST = 20  # [s] that an input may take
COUNTS: dict[str, Counter[str]] = {}

settings.register_profile(
    "fuzz",
    max_examples=FEW,
    deadline=None,
    derandomize=not CASES,
    database=settings.default.database if CASES else None,
    suppress_health_check=list(HealthCheck),
    print_blob=True,
)
settings.load_profile("fuzz")


def cases(share: float, few: int = FEW) -> Any:
    """The settings of a target that gets a share of all cases, and a few in the test suite."""
    return settings(max_examples=max(few, round(share * CASES)))


class HangError(BaseException):
    """An input took longer than `LONGEST`."""


@contextmanager
def limited() -> Iterator[None]:
    """Raises `HangError` where the block takes too long."""

    def end(*_: Any) -> None:
        raise HangError(f"more than {LONGEST} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.alarm(LONGEST)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def tried(target: str, use: Callable[..., Any], *arguments: Any) -> Any:
    """Uses an input: it is taken, or refused in one sentence; anything else is a failure.

    Returns:
        What was made of it, None where it was refused.
    """
    counts = COUNTS.setdefault(target, Counter())
    counts["tried"] += 1
    with limited(), np.errstate(all="ignore"):
        try:
            out = use(*arguments)
        except DriftDrakeError as error:
            out, said = None, one_line(error)
        else:
            said = None
    counts["taken" if said is None else "refused"] += 1
    assert said is None or 0 < len(said) < 2 * LONGEST_LINE
    return out
