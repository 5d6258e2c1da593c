"""One run as measurements for the filter: channels as an array, which rows count, the sensors' noise."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.car.log.table import Run
from drift_drake.gap.estimation.filter_state import CHANNELS, MEASURED
from drift_drake.gap.logs.noise import white_noise_level

COURSE_TIME = 0.6  # [s] of positions that a first sideslip is taken from
SETTLING_TIME = 0.35  # [s] at a run's start whose innovations do not count: commands before it are unknown
ENDING_TIME = 0.15  # [s] at its end that do not either: commands that act before they are logged are unknown there


@dataclasses.dataclass(frozen=True)
class RunData:
    """One run, ready for the filter."""

    name: str
    period: float
    y: np.ndarray  # [rows, 9] in the order of CHANNELS, zeros where a channel is missing
    used: np.ndarray  # [9] bool
    delta: np.ndarray
    tau: np.ndarray
    counted: np.ndarray  # [rows] bool: rows whose innovations count
    bank: np.ndarray | None = None  # [rows] of the road [rad], where the log has it
    trace: np.ndarray | None = None  # [rows, 9] that the model discrepancy leaves in the innovations


def first_sideslip(run: Run) -> float | None:
    """Sideslip [rad] at a run's start where none is logged: the course that positions show less the heading.

    None without positions or heading.
    """
    if run.x is None or run.y is None or run.psi is None:
        return None
    rows = max(round(COURSE_TIME / run.period), 2)
    t = run.t[:rows] - run.t[0]
    # The turning course at the first row: the slope there of a parabola through the first positions.
    v_x, v_y = (np.polyfit(t, position[:rows], 2)[1] for position in (run.x, run.y))
    turn = np.arctan2(v_y, v_x) - np.polyfit(t, np.unwrap(run.psi)[:rows], 2)[2]
    return float(np.arctan2(np.sin(turn), np.cos(turn)))


def prepare_run(run: Run) -> RunData:
    """Channels as an array, the heading unwrapped, the rows that count."""
    y = np.zeros((len(run), MEASURED))
    used = np.zeros(MEASURED, dtype=np.bool_)
    for i, name in enumerate(CHANNELS):
        values = run.column(name)
        if values is not None:
            y[:, i] = np.unwrap(values) if name == "psi" else values
            used[i] = True
    if run.beta is None:
        y[:, CHANNELS.index("beta")] = first_sideslip(run) or 0.0  # where the filter starts; no measurement
    tau = run.tau_cmd if run.tau_cmd is not None else np.zeros(len(run))
    counted = (run.t - run.t[0] >= SETTLING_TIME) & (run.t[-1] - run.t > ENDING_TIME)
    return RunData(run.name, run.period, y, used, run.delta_cmd.astype(float), tau.astype(float), counted, run.bank)


def noise_levels(runs: Sequence[RunData]) -> np.ndarray:
    """Noise of each channel [9], the median over runs; a noiseless channel gets a millionth of its range."""
    levels = np.ones(MEASURED)
    for i in range(MEASURED):
        found = [white_noise_level(run.y[:, i]) for run in runs if run.used[i]]
        if found:
            reach = max(float(np.ptp(run.y[:, i])) for run in runs if run.used[i])
            levels[i] = max(float(np.median(found)), 1e-6 * reach, 1e-9)
    return levels
