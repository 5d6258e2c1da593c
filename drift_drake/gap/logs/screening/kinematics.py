"""What a log's columns say of one motion, over windows: rates of heading, course and velocity, exact for any car.

Products are taken row by row, before they are averaged, so that turns, drifts and spins are as good as straight lines.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.gap.logs.screening.averaging import (
    Averages,
    Averaging,
    Columns,
    averages,
    averaging,
    column,
    continuous,
)
from drift_drake.gap.logs.screening.relations import MOVING

BLOCK = 4  # windows, 1.2 s, within which errors may be alike
SHORTEST_BLOCK, BLOCKS = 3, 12  # of logs too short for as many blocks


@dataclasses.dataclass(frozen=True)
class Kinematics(Averages):
    """Windows [windows] in which the car moves; NaN where a column is missing.

    row: of its run, in its middle; psi, beta: means. spin: rate of `r`; along, across: acceleration in body axes that
    `v`, `beta` and `r` make; turned, circling, forward: means of v r, r^2 and v cos(beta); course: rate of the
    direction of travel along x, y; heading, yawed: the same of `psi`, and of the angle that `r` turns by, with `beta`;
    moved: speed along x, y; slid: mean of the direction of travel less `psi`.
    """

    block: np.ndarray
    row: np.ndarray
    psi: np.ndarray
    beta: np.ndarray
    spin: np.ndarray
    along: np.ndarray
    across: np.ndarray
    turned: np.ndarray
    circling: np.ndarray
    forward: np.ndarray
    course: np.ndarray
    heading: np.ndarray
    yawed: np.ndarray
    moved: np.ndarray
    slid: np.ndarray

    def lag(self, values: np.ndarray) -> np.ndarray:
        """What a small delay adds to values [windows]: their slope from window to window of a run, zero at gaps."""
        out = np.zeros(len(values))
        inside = np.flatnonzero((self.run[2:] == self.run[:-2]) & (self.block[2:] - self.block[:-2] <= 1)) + 1
        out[inside] = values[inside + 1] - values[inside - 1]
        return out


def motion_of_columns(runs: Sequence[Columns], periods: Sequence[float], slowest: float = MOVING) -> Kinematics:
    """Windows through the columns of several runs, which may lack all but `r` and `v`, a row each period [s].

    slowest: share of a run's high speeds below which a window is left out.
    """
    parts, blocks = [], 0
    how = [averaging(len(np.asarray(columns["v"])), period) for columns, period in zip(runs, periods, strict=True)]
    size = int(np.clip(sum(len(over.starts) for over in how) // BLOCKS, SHORTEST_BLOCK, BLOCK))
    for index, (columns, period, over) in enumerate(zip(runs, periods, how, strict=True)):
        parts.append(_of_run(columns, period, index, over, blocks + np.arange(len(over.starts)) // size, slowest))
        blocks += len(np.asarray(columns["v"]))
    return Kinematics.joined(parts)


def _of_run(
    columns: Columns, period: float, index: int, over: Averaging, block: np.ndarray, slowest: float
) -> Kinematics:
    mean, change = over.mean, over.change

    def evened(angle: np.ndarray) -> np.ndarray:
        """Over as many rows as the direction of travel is taken."""
        from scipy.ndimage import uniform_filter1d  # slow to import

        return np.asarray(uniform_filter1d(angle, 2 * over.part + 1, mode="nearest"))

    v, r, beta = column(columns, "v"), column(columns, "r"), continuous(column(columns, "beta"))
    forward, sideways = v * np.cos(beta), v * np.sin(beta)
    psi = continuous(column(columns, "psi"))
    slip = np.nan_to_num(beta)
    course, moved = _path(column(columns, "x"), column(columns, "y"), over)
    found = Kinematics(
        **averages(columns, over, index),
        block=block,
        row=over.starts + over.width // 2,
        psi=mean(psi),
        beta=mean(beta),
        spin=change(r),
        along=change(forward) - mean(r * sideways),
        across=change(sideways) + mean(r * forward),
        turned=mean(v * r),
        circling=mean(r * r),
        forward=mean(forward),
        course=change(course),
        heading=change(evened(psi + slip)),
        yawed=change(evened(np.cumsum(r) * period + slip)),
        moved=moved,
        slid=mean(np.angle(np.exp(1j * (course - psi)))),
    )
    return found.where(found.v > slowest * float(np.quantile(v, 0.9)))


def _path(x: np.ndarray, y: np.ndarray, over: Averaging) -> tuple[np.ndarray, np.ndarray]:
    """Direction of travel [rows] along positions, by chords of two parts' length, and speed [windows] along them.

    A chord is shorter than its arc: by a 24th of the squared angle that the course turns on it.
    """
    rows, part = np.arange(len(x)), over.part
    ahead, behind = np.minimum(rows + part, len(x) - 1), np.maximum(rows - part, 0)
    direction = np.arctan2(y[ahead] - y[behind], x[ahead] - x[behind])
    sums_x, sums_y = (np.concatenate([[0.0], np.cumsum(values)]) for values in (x, y))
    half = (over.width - part) // 2

    def at(row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return (sums_x[row + part] - sums_x[row]) / part, (sums_y[row + part] - sums_y[row]) / part

    (x0, y0), (x1, y1), (x2, y2) = (at(over.starts + k * half) for k in range(3))
    turned = np.angle(np.exp(1j * (np.arctan2(y2 - y1, x2 - x1) - np.arctan2(y1 - y0, x1 - x0))))
    length = np.hypot(x1 - x0, y1 - y0) + np.hypot(x2 - x1, y2 - y1)
    return np.unwrap(direction), length * (1.0 + turned**2 / 24.0) / (2 * half * over.period)
