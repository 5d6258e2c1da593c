"""Columns of a log laid over what other columns say of them, window by window: for a person to look at."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.common.arrays import Array, correlation
from drift_drake.gap.logs.screening.averaging import Columns
from drift_drake.gap.logs.screening.gains import Bounds
from drift_drake.gap.logs.screening.kinematics import Kinematics, motion_of_columns
from drift_drake.gap.logs.screening.redundancy import arm_found
from drift_drake.gap.logs.screening.steering import ratio_found
from drift_drake.view.colours import RUNS
from drift_drake.view.pages.charts import Line, Panel

LIVELIEST = 0.1  # [rad/s] yaw rate from which the steering ratio can be read off
GENTLE = 3.0  # [m/s^2] of v r up to which a car goes where it steers


class Overlay(NamedTuple):
    """A column, what is laid over it, the unit, and both at times t [windows] [s] of runs laid end to end."""

    column: str
    against: str
    unit: str
    t: Array
    measured: Array
    expected: Array

    @property
    def likeness(self) -> float:
        """Correlation of the two."""
        return correlation(self.measured, self.expected)

    @property
    def gain(self) -> float:
        """What the column is too large by, as a ratio of spreads with the correlation's sign."""
        size = float(np.std(self.measured) / max(float(np.std(self.expected)), 1e-12))
        return float(np.copysign(size, self.likeness))


def overlays(runs: Sequence[Columns], period: float, wheelbase: float | None = None) -> list[Overlay]:
    """The overlays that the columns allow.

    Args:
        runs: columns of the log format [rows], by run; period: time between rows [s]; wheelbase [m], where known.
    """
    runs = [columns for columns in runs if {"r", "v"} <= set(columns) and len(np.asarray(columns["v"])) > 1]
    m = motion_of_columns(runs, [period] * len(runs))
    starts = np.concatenate([[0.0], np.cumsum([len(np.asarray(columns["v"])) * period for columns in runs])])
    t = starts[m.run] + m.row * period
    found = [
        Overlay(column, against, unit, t, measured, expected)
        for column, against, unit, measured, expected in _pairs(m, wheelbase)
    ]
    return [clean for one in found if (clean := _there(one)) is not None]


class Estimates(NamedTuple):
    """Numbers of a mapping that gentle driving tells, each None where it does not.

    steering: how many times as large delta_cmd is as turns ask for; ahead, left: of the centre of gravity [m], where
    the speed is measured, less what the mapping says of it already.
    """

    steering: Bounds | None = None
    ahead: Bounds | None = None
    left: Bounds | None = None


def estimates(runs: Sequence[Columns], period: float, wheelbase: float | None = None) -> Estimates:
    """The estimates that the columns allow; arguments as of `overlays`."""
    runs = [columns for columns in runs if {"r", "v"} <= set(columns) and len(np.asarray(columns["v"])) > 1]
    if not runs:
        return Estimates()
    m = motion_of_columns(runs, [period] * len(runs))
    return Estimates(None if wheelbase is None else ratio_found(m, wheelbase), *arm_found(m, wheelbase))


def panels_of(found: Sequence[Overlay]) -> list[Panel]:
    """A panel a column: as it was measured, and what others say."""
    return [
        Panel(
            f"{one.column} [{one.unit}] against {one.against.split(',')[0]}",
            [Line("measured", one.t, one.measured), Line("by other columns", one.t, one.expected, RUNS[1])], 110,
        )
        for one in found
    ]  # fmt: skip


def _pairs(m: Kinematics, wheelbase: float | None) -> list[tuple[str, str, str, Array, Array]]:
    across = np.where(np.isfinite(m.across), m.across, m.turned)
    along = np.where(np.isfinite(m.along), m.along, m.gain)
    gentle = (np.abs(m.turned) < GENTLE) & (np.abs(m.r) > LIVELIEST)
    turn = m.r / np.maximum(m.v, 1e-6)
    ratio = wheelbase or _slope(m.delta_cmd[gentle], turn[gentle])
    steer = f"r L / v, L = {abs(ratio):.3g} m" + ("" if wheelbase else " (what fits gentle turns)")
    return [
        ("r", "d psi/dt", "rad/s", m.r, m.turning),
        ("r", "rate of the course along x, y", "rad/s", m.r, m.course - np.nan_to_num(m.swing)),
        ("ay", "v r + dv_y/dt" if np.isfinite(m.across).any() else "v r", "m/s^2", m.ay, across),
        ("ax", "dv_x/dt - v_y r" if np.isfinite(m.along).any() else "dv/dt", "m/s^2", m.ax, along),
        ("omega_r", "v", "m/s", m.omega_r, m.v),
        ("v", "speed along x, y", "m/s", m.v, m.moved),
        ("delta_cmd", steer, "rad", m.delta_cmd, turn * abs(ratio)),
        ("beta", "course less psi", "rad", m.beta, m.slid),
    ]


def _slope(steer: Array, turn: Array) -> float:
    known = np.isfinite(steer) & np.isfinite(turn)
    return float(np.median(steer[known] / turn[known])) if np.count_nonzero(known) else 1.0


def _there(one: Overlay) -> Overlay | None:
    known = np.isfinite(one.measured) & np.isfinite(one.expected)
    if np.count_nonzero(known) < 3 or min(np.ptp(one.measured[known]), np.ptp(one.expected[known])) < 1e-9:
        return None
    return one._replace(t=one.t[known], measured=one.measured[known], expected=one.expected[known])
