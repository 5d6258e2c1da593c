"""Directions of the errors that no effect of the catalogue has: parts of effects, and faults that no effect is like.

A sensor whose gain is off, friction that depends on the speed, backlash of the steering, a torque that saturates: each
is an effect of the catalogue times a function of the driving. A heading that drifts or has a gain off, the recorder's
clock that runs fast, a yaw moment that no tyre makes: what they would do to the errors of windows follows from the
logs, or from one more prediction. Their scores show what a named cause leaves over, and in which signal and which
driving; they are how a fault that the catalogue lacks is seen at all, and is not taken for another cause.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import CarConstants
from drift_drake.gap.estimation.windows import HORIZONS, PREDICTED, WindowedRun, run_errors

DRIFT = 0.02  # [rad/s] of a heading, a unit
GAIN = 0.05  # [-] of a heading's changes
CLOCK = 0.02  # [-] by which the recorder's clock runs fast
TURNING = 0.2  # [rad/s^2] of the car, that a yaw moment makes

PSI = PREDICTED.index("psi")
STEERS = 0.05  # [rad/s] of steering, beyond which its direction is certain
THROTTLE = 0.2  # of a run's largest torque, the same of the torque's
LARGEST = 3.0  # standard deviations of a function of the driving, at which it is clipped

DRIVING = (
    "speed", "time in the run", "lateral acceleration", "direction of the turn", "direction of steering", "torque",
    "direction of the torque", "sideslip",
)  # fmt: skip


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


class Partial(NamedTuple):
    """An effect times a function of the driving, or a free direction (`FREE`)."""

    effect: str
    driving: str = ""  # of `DRIVING`; none of a free direction

    def __str__(self) -> str:
        return f"{self.effect} by {self.driving}" if self.driving else self.effect


PARTIAL = tuple(
    Partial(effect, driving)
    for effect, functions in {
        "friction_level": ("speed", "time in the run", "lateral acceleration"),
        "steering_offset": ("direction of steering", "direction of the turn", "time in the run"),
        "front_stiffness_error": ("lateral acceleration", "speed"),
        "torque_gain_error": ("torque", "direction of the torque", "speed", "time in the run"),
        "rolling_resistance": ("direction of the torque", "speed", "time in the run", "direction of the turn"),
        "gyro_bias": ("direction of the turn", "speed", "time in the run"),
        "sideslip_bias": ("sideslip", "direction of the turn", "speed", "time in the run"),
        "wheel_radius_error": ("speed", "torque", "time in the run"),
        "sensor_latency": ("speed", "lateral acceleration", "time in the run"),
    }.items()
    for driving in functions
) + tuple(Partial(name) for name in FREE)


def driving(runs: Sequence[WindowedRun]) -> np.ndarray:
    """Functions of the driving in each window [windows, DRIVING], in the middle of its horizons."""
    out = []
    for run in runs:
        middle = run.starts + HORIZONS * run.stride_rows // 2
        r, v, beta = (run.start_y[middle, i] for i in range(3))
        ahead = np.minimum(middle + run.stride_rows // 2 + 1, len(run.delta) - 1)
        behind = np.maximum(middle - run.stride_rows // 2 - 1, 0)
        steering = (run.delta[ahead] - run.delta[behind]) / (np.maximum(ahead - behind, 1) * run.period)
        tau = run.tau[middle]
        most = max(float(np.max(np.abs(run.tau))), 1e-9)
        out.append(np.stack([v, middle * run.period, np.abs(r * v), r, np.tanh(steering / STEERS), tau,
                             np.tanh(tau / (THROTTLE * most)), beta], axis=-1))  # fmt: skip
    return np.concatenate(out)


def standards(runs: Sequence[WindowedRun]) -> np.ndarray:
    """Means and standard deviations [2, DRIVING] of the functions over the windows of a baseline."""
    found = driving(runs)
    return np.stack([found.mean(axis=0), np.maximum(found.std(axis=0), 1e-9)])


def partial_columns(
    jacobian: np.ndarray, names: Sequence[str], runs: Sequence[WindowedRun], standard: np.ndarray,
    free: Mapping[str, np.ndarray],
) -> tuple[list[Partial], np.ndarray]:  # fmt: skip
    """The partial effects of `names` and the free directions, and the derivatives of errors by them [windows, errors,
    partial].

    Args:
        jacobian: derivatives by the effects `names` [windows, errors, n]; standard: `standards` of the baseline;
        free: derivatives by the free directions [windows, errors] each.
    """
    there = partial_effects(names)
    share = np.clip((driving(runs) - standard[0]) / standard[1], -LARGEST, LARGEST)
    columns = [
        jacobian[:, :, list(names).index(p.effect)] * share[:, None, DRIVING.index(p.driving)]
        if p.driving
        else free[p.effect]
        for p in there
    ]
    return there, np.stack(columns, axis=-1)


def partial_effects(names: Sequence[str]) -> list[Partial]:
    """Partial effects of the effects `names`, and the free directions."""
    return [p for p in PARTIAL if p.effect in names or not p.driving]
