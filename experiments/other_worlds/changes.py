"""Changes put into a recorded run by hand, so that the car seems to have an effect of the catalogue.

The recorded response cannot be changed. The command to the car can: a command that is made earlier makes the car
respond later. What was measured can too.
"""

import dataclasses
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from drift_drake.car.log.plausible import LARGEST
from drift_drake.car.log.table import Run

COMMANDS = ("delta_cmd", "tau_cmd")
MEASURED = ("x", "y", "psi", "r", "v", "beta", "omega_r", "ax", "ay")


def steering_delay(run: Run, q: float) -> Run:
    """The steering command is logged `q` [s] before it was given; the rows at the end, without one, are cut."""
    shifted = np.interp(run.t + q, run.t, run.delta_cmd)
    return dataclasses.replace(run, delta_cmd=shifted).rows(0, len(run) - rows_in(run, q))


def steering_lag(run: Run, q: float) -> Run:
    """The logged steering command is the one whose first-order lag of `q` [s] is the recorded one."""
    ahead = run.delta_cmd + q * np.gradient(run.delta_cmd, run.period)
    return dataclasses.replace(run, delta_cmd=np.clip(ahead, -LARGEST["delta_cmd"][0], LARGEST["delta_cmd"][0]))


def steering_offset(run: Run, q: float) -> Run:
    """The road wheel stands `q` [rad] further left than commanded."""
    return dataclasses.replace(run, delta_cmd=run.delta_cmd - q)


def steering_ratio_error(run: Run, q: float) -> Run:
    """The road wheel turns 1 + `q` times as far as commanded."""
    return dataclasses.replace(run, delta_cmd=run.delta_cmd / (1.0 + q))


def gyro_gain_error(run: Run, q: float) -> Run:
    """The measured yaw rate times 1 + `q`; the heading stays."""
    return dataclasses.replace(run, r=run.r * (1.0 + q))


def speed_gain_error(run: Run, q: float) -> Run:
    """The measured speed times 1 + `q`; the rim's stays."""
    return dataclasses.replace(run, v=run.v * (1.0 + q))


def command_clock_error(run: Run, q: float) -> Run:
    """Every command is stamped `q` [s] late; rows without one, at the start or (early ones) at the end, are cut."""
    cut = rows_in(run, abs(q))
    rows = (cut, len(run)) if q > 0.0 else (0, len(run) - cut)
    return read_at(run, COMMANDS, run.t - q).rows(*rows)


def torque_gain_error(run: Run, q: float) -> Run:
    """The torque at the axle is 1 + `q` times the logged one."""
    return dataclasses.replace(run, tau_cmd=needed(run, "tau_cmd") / (1.0 + q))


def gyro_bias(run: Run, q: float) -> Run:
    """`q` [rad/s] added to the measured yaw rate; the heading stays."""
    return dataclasses.replace(run, r=run.r + q)


def sideslip_bias(run: Run, q: float) -> Run:
    """`q` [rad] added to the measured sideslip."""
    return dataclasses.replace(run, beta=needed(run, "beta") + q)


def wheel_radius_error(run: Run, q: float) -> Run:
    """The measured rim speed times 1 + `q`."""
    return dataclasses.replace(run, omega_r=needed(run, "omega_r") * (1.0 + q))


def sensor_latency(run: Run, q: float) -> Run:
    """Every measured column is `q` [s] late; the rows at the start, without one, are cut."""
    return read_at(run, MEASURED, run.t - q).rows(rows_in(run, q), len(run))


CHANGES: dict[str, Callable[[Run, float], Run]] = {
    "steering_delay": steering_delay,
    "steering_lag": steering_lag,
    "steering_offset": steering_offset,
    "gyro_bias": gyro_bias,
    "sideslip_bias": sideslip_bias,
    "wheel_radius_error": wheel_radius_error,
    "sensor_latency": sensor_latency,
    "torque_gain_error": torque_gain_error,
    "steering_ratio_error": steering_ratio_error,
    "gyro_gain_error": gyro_gain_error,
    "speed_gain_error": speed_gain_error,
    "command_clock_error": command_clock_error,
}


def with_columns(run: Run, names: Iterable[str], change: Callable[[np.ndarray], np.ndarray]) -> Run:
    """The run with every one of some columns that it has changed in the same way."""
    columns: dict[str, Any] = {name: change(values) for name in names if (values := run.column(name)) is not None}
    return dataclasses.replace(run, **columns)


def read_at(run: Run, names: Iterable[str], times: np.ndarray) -> Run:
    """The run whose rows hold what some columns were at other times [s]; a heading is unwrapped."""
    unwrapped = run if run.psi is None else dataclasses.replace(run, psi=np.unwrap(run.psi))
    return with_columns(unwrapped if "psi" in names else run, names, lambda values: np.interp(times, run.t, values))


def rows_in(run: Run, q: float) -> int:
    """Rows that a time [s] takes, at least."""
    return int(np.ceil(q / run.period - 1e-6))


def needed(run: Run, name: str) -> np.ndarray:
    """The column; ValueError where the log lacks it."""
    values = run.column(name)
    if values is None:
        raise ValueError(f"{run.name}: column {name} is missing; its effect cannot be put in")
    return values
