"""The last rows of a drive, as far back as its newest window of predictions needs them."""

from typing import NamedTuple

import numpy as np

from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.windows import HORIZONS, PREDICTED, SETTLING, SMOOTHING, WindowedRun, smoothed

BEHIND = 1.0  # [s] before a window's start that actuators and internal states settle in
JUMP = 12.0  # scales of the shortest horizon that a reading is off both of its neighbours, to be none
READ = [CHANNELS.index(name) for name in PREDICTED]
SPEED, SIDESLIP, RIM, HEADING = (PREDICTED.index(name) for name in ("v", "beta", "omega_r", "psi"))


class Rows(NamedTuple):
    """The newest rows last; those that have not been filled yet are zero."""

    filled: np.ndarray  # [] rows
    y: np.ndarray  # [rows, PREDICTED] as measured
    command: np.ndarray  # [rows, 2] delta [rad], tau [N m]
    bank: np.ndarray  # [rows] of the road [rad]
    bad: np.ndarray  # [rows] 1 where a reading is missing


def no_rows(period: float, stride: float) -> Rows:
    """Empty rows for a window of horizons `stride` [s] apart, and what is before it; period: of rows [s]."""
    n = round(BEHIND / period) + (HORIZONS + 1) * max(round(stride / period), 1) + 1
    return Rows(np.zeros(()), np.zeros((n, len(PREDICTED))), np.zeros((n, 2)), np.zeros(n), np.zeros(n))


def with_row(rows: Rows, y: np.ndarray, command: np.ndarray, bank: float, bad: bool) -> Rows:
    """The rows after one more: y [PREDICTED]; bad: a reading is missing, those of the row before stand for it."""
    news = (y, command, bank, float(bad))
    moved = (np.concatenate([old[1:], np.asarray(new)[None]]) for old, new in zip(rows[1:], news, strict=True))
    return Rows(np.minimum(rows.filled + 1.0, len(rows.y)), *moved)


def newest_window(rows: Rows, used: np.ndarray, period: float, stride: float, scales: np.ndarray) -> WindowedRun | None:
    """The window that ends at the newest row; None where its rows are too few, or a reading in them is missing.

    Args:
        used: [PREDICTED] channels that are measured; scales: [PREDICTED] of errors at the shortest horizon.
    """
    n, step = int(rows.filled), max(round(stride / period), 1)
    start = n - 1 - HORIZONS * step
    if start < round(SETTLING / period):
        return None
    y, command, bank = (a[-n:].copy() for a in rows[1:4])
    bad = (rows.bad[-n:] > 0.0) | jumps(y, scales)
    if np.any(bad[max(start - round(SMOOTHING * stride / period), 0) :]):
        return None
    y[bad] = y[np.maximum.accumulate(np.where(bad, 0, np.arange(n)))][bad]
    if not used[RIM]:
        y[:, RIM] = y[:, SPEED]
    if used[HEADING]:
        y[:, HEADING] = np.unwrap(y[:, HEADING])
    else:
        y[:, HEADING] = np.concatenate([[0.0], np.cumsum(0.5 * (y[1:, 0] + y[:-1, 0]) * period)])
    start_y = np.stack([smoothed(y[:, i], period, stride) for i in range(len(PREDICTED))], axis=1)
    return WindowedRun(
        "newest", period, y, start_y, np.ascontiguousarray(command[:, 0]), np.ascontiguousarray(command[:, 1]),
        np.array([start]), stride, False, used, "newest", bank if np.any(bank) else None, not used[RIM],
    )  # fmt: skip


def jumps(y: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Which rows [n] (bool) hold a reading that is far off both of its neighbours; y [n, PREDICTED]."""
    out, turn = np.zeros(len(y), dtype=bool), 2.0 * np.pi
    before, after = y[1:-1] - y[:-2], y[1:-1] - y[2:]
    for step in (before, after):
        step[:, HEADING] -= turn * np.round(step[:, HEADING] / turn)
    far = JUMP * scales
    out[1:-1] = np.any((before * after > 0.0) & (np.abs(before) > far) & (np.abs(after) > far), axis=1)
    return out
