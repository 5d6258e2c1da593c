"""Directions of the errors that no effect of the catalogue has, nor a part of one.

A heading that drifts or has a gain off, the recorder's clock that runs fast, a yaw moment that no tyre makes: what they
would do to the errors of windows follows from the logs, or from one more prediction. They are asked of every day as
partial effects are (`estimation.partial`): a fault that is one of them, or like one, is not taken for another cause.
"""

from collections.abc import Callable, Sequence

import numpy as np

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import CarConstants
from drift_drake.gap.estimation.windows import HORIZONS, PREDICTED, WindowedRun, run_errors

DRIFT = 0.02  # [rad/s] of a heading, a unit
GAIN = 0.05  # [-] of a heading's changes
CLOCK = 0.02  # [-] by which the recorder's clock runs fast
TURNING = 0.2  # [rad/s^2] of the car, that a yaw moment makes

PSI = PREDICTED.index("psi")


def heading_drift(run: WindowedRun) -> np.ndarray:
    """Change of the errors [windows, HORIZONS, channels] where the heading's drift is taken off."""
    out = np.zeros((len(run.starts), HORIZONS, len(PREDICTED)))
    out[:, :, PSI] = -DRIFT * np.array(run.horizons)
    return out


def heading_gain(run: WindowedRun) -> np.ndarray:
    """The same of a gain of the heading."""
    psi = run.start_y[:, PSI]
    out = np.zeros((len(run.starts), HORIZONS, len(PREDICTED)))
    out[:, :, PSI] = -GAIN * (psi[_horizons(run)] - psi[run.starts][:, None])
    return out


def clock_rate(run: WindowedRun) -> np.ndarray:
    """The same of a clock that runs fast: what is logged at a horizon is of a little before it."""
    rates = np.gradient(run.start_y, run.period, axis=0)
    return np.asarray(CLOCK * np.array(run.horizons)[:, None] * rates[_horizons(run)])


def yaw_moment(run: WindowedRun, constants: CarConstants) -> np.ndarray:
    """A wrench [rows, 3] (`windows.run_errors`): a yaw moment on the body, at all times."""
    wrench = np.zeros((len(run.y), 3))
    wrench[:, 2] = TURNING * constants.yaw_inertia
    return wrench


OF_SENSORS: dict[str, Callable[[WindowedRun], np.ndarray]] = {
    "heading drift": heading_drift,
    "heading gain": heading_gain,
    "clock rate": clock_rate,
}
FREE = (*OF_SENSORS, "yaw moment")


def free_columns(
    runs: Sequence[WindowedRun], constants: CarConstants, own: Effects, at: np.ndarray
) -> dict[str, np.ndarray]:
    """Derivatives of the errors [windows of all runs, HORIZONS, channels] by each free direction, in its unit.

    Args:
        constants, own: the car that the errors `at` are of, the same shape.
    """
    out = {name: np.concatenate([of_run(run) * run.used for run in runs]) for name, of_run in OF_SENSORS.items()}
    turned = [run_errors(run, constants, own, wrench=yaw_moment(run, constants)) for run in runs]
    return out | {"yaw moment": np.concatenate(turned) - at}


def _horizons(run: WindowedRun) -> np.ndarray:
    """Rows [windows, HORIZONS] of the horizons."""
    return np.asarray(run.starts[:, None] + run.stride_rows * np.arange(1, HORIZONS + 1))
