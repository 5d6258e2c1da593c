"""What steps of the steering tell that a gyroscope and an encoder saw at 10 Hz: the wheel's offset, and its lag or not.

Slow cornering without slip: r = v (delta + offset) / L, with delta the command after a first-order lag.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from drift_drake.car.actuated import STAGES, delayed, first_order_lag
from drift_drake.car.log.table import Run

LAGS = np.linspace(0.01, 0.4, 40)  # [s]
SMALL = 0.1  # [rad] of steering up to which tyres slip little
READINGS = 0.1  # [s] between two of them
LOST_AT_ENDS = 3.84  # twice the log likelihood that a lag loses at the ends of its 95 % interval
RESAMPLES = 2000


def lagged(run: Run, lag: float) -> np.ndarray:
    """The command [rows] after a first-order lag."""
    command = delayed(run.delta_cmd, float(run.delta_cmd[0]), run.period, 0.0)
    return np.asarray(first_order_lag(command, float(run.delta_cmd[0]), run.period / STAGES, lag)[::STAGES])


def offset_of(run: Run, wheelbase: float) -> float:
    """Steering offset [rad] that the yaw rate of one run shows."""
    return float(np.sum(run.v * (wheelbase * run.r - run.v * run.delta_cmd)) / np.sum(run.v**2))


def squared_error(run: Run, lag: float) -> tuple[float, float]:
    """Mean square of the yaw rate that the best offset and gain leave under a lag, and the number of readings."""
    shapes = np.stack([run.v * lagged(run, lag), run.v], axis=-1)
    weights, _, _, _ = np.linalg.lstsq(shapes, run.r, rcond=None)
    return float(np.mean((run.r - shapes @ weights) ** 2)), len(run) * run.period / READINGS


def lag_interval(runs: Sequence[Run]) -> tuple[float, float, float]:
    """The likeliest lag [s] of all runs and its 95 % interval on the grid, readings' noise taken as white."""
    loss = np.zeros(len(LAGS))
    for run in runs:
        errors = np.array([squared_error(run, float(lag))[0] for lag in LAGS])
        loss += squared_error(run, float(LAGS[0]))[1] * np.log(errors)
    likely = LAGS[loss - np.min(loss) < LOST_AT_ENDS]
    return float(LAGS[int(np.argmin(loss))]), float(likely[0]), float(likely[-1])


def steering_of_steps(runs: Sequence[Run], wheelbase: float) -> dict[str, Any]:
    """Offset [rad] (mean over runs of small steering, 95 % interval from resampled runs) and lag [s] with interval."""
    small = [run for run in runs if float(np.max(np.abs(run.delta_cmd))) < SMALL]
    offsets = np.array([offset_of(run, wheelbase) for run in small])
    draws = np.random.default_rng(0).integers(0, len(offsets), (RESAMPLES, len(offsets)))
    low, high = np.quantile(np.mean(offsets[draws], axis=1), [0.025, 0.975])
    moved = [run for run in runs if np.ptp(run.delta_cmd) > 0.0]
    lag, least, most = lag_interval(moved)
    return {
        "offset": {"runs": len(small), "estimate": float(np.mean(offsets)), "low": float(low), "high": float(high)},
        "lag": {"runs": len(moved), "estimate": lag, "low": least, "high": most, "bounded": bool(most < LAGS[-1])},
    }
