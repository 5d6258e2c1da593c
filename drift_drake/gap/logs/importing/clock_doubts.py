"""Clocks in another unit than the mapping states: powers of a thousand, or hours, minutes and seconds packed."""

import numpy as np

from drift_drake.common.arrays import Array

FASTEST, SLOWEST = 5e3, 0.5  # [Hz] of a recorder's rows
UNITS = {1.0: "s", 1e-3: "ms", 1e-6: "us", 1e-9: "ns"}
COARSEST = 2.0  # [s] between packed times that a jump of 40 can be distinguished from
MINUTE, HOUR = 40.0, 4000.0  # that packed times jump by, in addition to the time that passed: hhmmss.ss


def clock_doubts(column: str, t: Array, unit: str) -> list[str]:
    """Sentences on a clock [n] in seconds, if its unit is not what the mapping states.

    Args:
        column: its name; unit: as stated, where it is one of time.
    """
    size = next((size for size, name in UNITS.items() if name == unit), None)
    steps = np.diff(t)
    steps = steps[steps > 0.0]
    if size is None or not len(steps):
        return []
    return _another_power(column, float(np.median(steps)), unit, size) or _packed(column, t / size, steps / size)


def _another_power(column: str, step: float, unit: str, size: float) -> list[str]:
    if 1.0 / FASTEST <= step <= 1.0 / SLOWEST:
        return []
    fit = [(other, name) for other, name in UNITS.items() if 1.0 / FASTEST <= step / size * other <= 1.0 / SLOWEST]
    if not fit:
        return []
    # Of two that fit, the rate nearest to 100 Hz.
    other, name = min(fit, key=lambda entry: abs(np.log(step / size * entry[0] / 0.01)))
    return [
        f"the clock '{column}' has a row each {step:.3g} s as {unit}: it looks like {name} "
        f"({1.0 / (step / size * other):.3g} Hz); give its unit as {name}"
    ]


def _packed(column: str, numbers: Array, steps: Array) -> list[str]:
    """Of times written as hhmmss.ss: they jump from 59 to 100, and their last two digits never pass 59."""
    usual = float(np.median(steps))
    if usual > COARSEST:
        return []
    jumps = np.flatnonzero(np.abs(np.diff(numbers) - MINUTE) < 2.0 * usual + 1e-3)
    jumps = np.concatenate([jumps, np.flatnonzero(np.abs(np.diff(numbers) - MINUTE - HOUR) < 2.0 * usual + 1e-3)])
    seconds = numbers % 100.0
    if not len(jumps) or np.any(seconds >= 60.0):
        return []
    before, after = seconds[jumps], seconds[jumps + 1]
    if np.any(before < 60.0 - 3.0 * usual) or np.any(after > 3.0 * usual):
        return []
    return [
        f"the clock '{column}' jumps by 40 each time that its last two digits pass 59: it looks like hours, minutes "
        "and seconds in one number (hhmmss.ss), which breaks a run at each minute; give its unit as hhmmss"
    ]
