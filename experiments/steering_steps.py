"""The steering's lag from steps that a gyroscope saw at 10 Hz: yaw rate against the command, lagged.

r = v delta / (L + K v^2) of steady cornering, with delta the command after a first-order lag (the car's own answer in
yaw is part of it). Gain, offset and K are fitted by least squares for every lag on a grid, run by run.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from drift_drake.diagnosis.commands import STAGES, delayed, first_order_lag
from drift_drake.logs.table import Run

LAGS = np.linspace(0.01, 0.4, 40)  # [s]
SWING = 0.05  # [rad] that a run's command must move by, to tell anything


def fit_of(run: Run, lag: float) -> float:
    """Mean square error of the yaw rate [rad^2/s^2] with the best gain, offset and understeer for this lag."""
    command = delayed(run.delta_cmd, float(run.delta_cmd[0]), run.period, 0.0)
    delta = first_order_lag(command, float(run.delta_cmd[0]), run.period / STAGES, lag)[::STAGES]
    shapes = np.stack([run.v * delta, run.v, run.v**3 * delta], axis=-1)
    weights, _, _, _ = np.linalg.lstsq(shapes, run.r, rcond=None)
    return float(np.mean((run.r - shapes @ weights) ** 2))


def steering_lag_of_steps(runs: Sequence[Run]) -> dict[str, Any]:
    """Lags [s] of the runs that have steps, their median, and a 95 % interval of it from resampled runs."""
    lags, names = [], []
    for run in runs:
        if np.ptp(run.delta_cmd) > SWING:
            names.append(run.name)
            lags.append(float(LAGS[int(np.argmin([fit_of(run, float(lag)) for lag in LAGS]))]))
    draws = np.random.default_rng(0).integers(0, len(lags), (2000, len(lags)))
    low, high = np.quantile(np.median(np.array(lags)[draws], axis=1), [0.025, 0.975])
    return {"runs": names, "lags": lags, "median": float(np.median(lags)), "low": float(low), "high": float(high)}
