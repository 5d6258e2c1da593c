"""Rows so far from the simulator's car that no change of the car explains them are left out, but only a few at a time.

A reading that jumps would move the filter's state, and the rows after it would look like a change of the car. What goes
on being far off is believed: the car may have met a wall.
"""

import numpy as np

from drift_drake.monitoring import bank as filters
from drift_drake.monitoring.bank import Bank, BankState

FAR = 16.0  # root of a row's squared innovations, in standard deviations; beyond twice the clipping of `monitor`
LEFT_OUT = 0.05  # [s] of rows that are left out, then they are believed
REGAINED = 0.1  # of the time that passes with rows that are not left out


def allowance(bank: Bank) -> float:
    """Rows that may be left out at the start."""
    return max(round(LEFT_OUT / bank.period), 1)


def gated_row(
    bank: Bank, state: BankState, left: float, y: np.ndarray, used: np.ndarray, command: np.ndarray
) -> tuple[BankState, np.ndarray | None, float]:
    """The bank one row on; a row that is left out is predicted through.

    Args:
        left: rows that may be left out; y [9], used [9], command [2]: as `bank.row` takes them.

    Returns:
        (the state, the whitened innovations [m, 9] or None where the row was left out, rows that may be left out).
    """
    after = _copy(state)
    innovations = filters.advance_bank(y, used, command, bank, after)
    if left < 1.0 or float(np.sum(innovations[0][used] ** 2)) <= FAR**2:
        return after, innovations, min(left + REGAINED, allowance(bank))
    after = _copy(state)
    filters.advance_bank(y, np.zeros_like(used), command, bank, after)
    return after, None, left - 1.0


def _copy(state: BankState) -> BankState:
    return BankState(*(a.copy() for a in state))
