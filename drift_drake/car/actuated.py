"""What actuators make of logged commands: delays, lags and rate limits, on a grid of times between the rows.

A sensor that is late by q is, seen from the car, commands that come early by nothing and act late by q: measured rows
are then taken at the car's own time.
"""

from typing import Any

import numpy as np

from drift_drake.car.compilation import compiled
from drift_drake.car.effects.delays import DELAYS, HASTENERS, LATE, command_delays, sensor_delay
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.single_track.motion_with_effects import road_wheel, steering_rate

STAGES = 4  # grid intervals a row
RATE_STEPS = 5  # inner steps of the rate limiter in one grid interval


@compiled
def delayed(command: Any, before: Any, period: Any, delay: Any) -> Any:
    """The command [rows], linear between rows and `before` the first, on the grid [STAGES (rows - 1) + 1].

    A delay below zero looks ahead, up to the last row, whose command is held.
    """
    rows = len(command)
    count = STAGES * (rows - 1) + 1
    out = np.empty(count)
    for i in range(count):
        place = min(i / STAGES - delay / period, rows - 1.0)
        if place < 0.0:
            out[i] = before
        else:
            row = min(int(place), rows - 2)
            out[i] = command[row] + (place - row) * (command[row + 1] - command[row])
    return out


@compiled
def first_order_lag(command: Any, before: Any, step: Any, time_constant: Any) -> Any:
    """Exact response of a first-order lag, settled at `before`, to a command that is linear between grid points."""
    out = np.empty(len(command))
    out[0] = before
    decay = np.exp(-step / time_constant)
    for i in range(len(command) - 1):
        ramp = (command[i + 1] - command[i]) / step * time_constant
        out[i + 1] = decay * (out[i] - command[i] + ramp) + command[i + 1] - ramp
    return out


@compiled
def limited_steering(command: Any, before: Any, step: Any, effects: Any) -> Any:
    """Road-wheel angle that follows the command with lag and rate limit, by Heun steps of a grid interval's fifth."""
    out = np.empty(len(command))
    out[0] = before
    h = step / RATE_STEPS
    for i in range(len(command) - 1):
        angle = out[i]
        for j in range(RATE_STEPS):
            start = command[i] + (command[i + 1] - command[i]) * (j / RATE_STEPS)
            end = command[i] + (command[i + 1] - command[i]) * ((j + 1) / RATE_STEPS)
            first = steering_rate(angle, start, effects)
            second = steering_rate(angle + h * first, end, effects)
            angle += 0.5 * h * (first + second)
        out[i + 1] = angle
    return out


def actuated(
    delta_cmd: np.ndarray, tau_cmd: np.ndarray, before: tuple[float, float], period: float, effects: Effects
) -> tuple[np.ndarray, np.ndarray]:
    """Road-wheel angle (before its offset) [rad] and engine torque [N m] on the stages' grid, in the sensors' time.

    A sensor that is late by q is, seen from the car, commands that act late by q: measured rows are taken at the car's
    own time.

    Args:
        delta_cmd, tau_cmd: commands, one a row; before: what they were before the first row, where the actuators
            had settled; period: time between rows [s]; effects: magnitudes.
    """
    step = period / STAGES
    (late_delta, late_torque), late = command_delays(effects), sensor_delay(effects)
    first = float(road_wheel(before[0], effects))
    delta = delayed(road_wheel(delta_cmd, effects), first, period, late_delta + late)
    torque = delayed(tau_cmd, before[1], period, late_torque + late)
    if effects.steering_rate_limit > 0.0:
        delta = limited_steering(delta, first, step, effects)
    elif effects.steering_lag > 0.0:
        delta = first_order_lag(delta, first, step, effects.steering_lag)
    if effects.torque_lag > 0.0:
        torque = first_order_lag(torque, before[1], step, effects.torque_lag)
    return delta, torque


def without_actuators(effects: Effects) -> Effects:
    """The effects that are left once `actuated` has taken those of the commands."""
    taken = ("steering_ratio_error", "steering_lag", "steering_rate_limit", "torque_lag")
    return effects._replace(**dict.fromkeys((*taken, *DELAYS, *HASTENERS, *LATE), 0.0))
