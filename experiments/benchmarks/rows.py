"""Drives made row by row, by compiled Runge-Kutta steps: what makes cases by the thousand; of cars with own states."""

from collections.abc import Callable
from typing import Any

import numpy as np

from drift_drake.car.compilation import compiled
from drift_drake.car.effects.delays import command_delays
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import CarConstants, kind_of, rates, settle
from drift_drake.car.integrate import runge_kutta
from drift_drake.car.scalar import jitable
from drift_drake.car.single_track.motion import body_acceleration, world_rates
from drift_drake.common.arrays import Array

PERIOD = 0.01  # [s] of the rows
SUBSTEPS = 10  # RK4 steps a row; rear wheels ring in their tyres at some 300 rad/s, or settle in them within 1.5 ms
Motion = tuple[Array, Array, Array, Array]  # states [rows, n], accelerations [rows, 2], commands delta, tau [rows]


@compiled
def _command_at(command: Any, place: Any, last: Any) -> Any:
    if place <= 0.0:
        return command[0]
    row = min(int(place), last)
    return command[row] + (place - row) * (command[min(row + 1, last)] - command[row])


@compiled
def commands_at(delta: Any, tau: Any, place: Any, last: Any, q: Any) -> Any:
    """Both commands as they reach the car at a place [rows], from rows up to `last`, and the time there [s].

    Linear between rows; before the first row they were what they are there.
    """
    late_delta, late_tau = command_delays(q)
    return (_command_at(delta, place - late_delta / PERIOD, last), _command_at(tau, place - late_tau / PERIOD, last),
            place * PERIOD)  # fmt: skip


@jitable
def runge_kutta_row(rates: Any, z: Any, row: Any, delta: Any, tau: Any, car: Any, substeps: Any) -> Any:
    """States z a row later, in place, by RK4 of `rates(z, command, car, out)`; returns (a_x, a_y) there.

    `command` holds delta, tau and the time; `car` the car's numbers and its effects, and what else it has.
    """
    last, k, work = row + 1, np.empty(len(z)), np.empty((2, len(z)))
    for i in range(substeps):
        begin = commands_at(delta, tau, row + i / substeps, last, car[1])
        middle = commands_at(delta, tau, row + (i + 0.5) / substeps, last, car[1])
        end = commands_at(delta, tau, row + (i + 1) / substeps, last, car[1])
        runge_kutta(rates, z, begin, middle, end, PERIOD / substeps, car, k, work)
    return rates(z, end, car, k)


def by_rows(
    start: tuple[Array, Array], first: tuple[float, float], duration: float,
    command: Callable[[float, Array, tuple[float, float]], tuple[float, float]],
    advance: Callable[[Array, int, Array, Array], tuple[Array, Array]], ends: Callable[[Array, Array], bool],
    with_end: bool = True,
) -> Motion:  # fmt: skip
    """A drive of a duration [s], which ends early where it is to.

    Args:
        start: state [n] and accelerations [2] of the first row; first: its command;
        command: for the next row, of the time [s], the state and the command; advance: state and accelerations of the
            next row, of the state, the row and the commands up to the next row; ends: by the states before and after;
        with_end: whether the row at which it ends early is kept.
    """
    rows = round(duration / PERIOD) + 1
    delta, tau = np.zeros(rows), np.zeros(rows)
    states, accelerations = np.zeros((rows, len(start[0]))), np.zeros((rows, 2))
    (states[0], accelerations[0]), (delta[0], tau[0]) = start, first
    for row in range(rows - 1):
        delta[row + 1], tau[row + 1] = command(row * PERIOD, states[row], (delta[row], tau[row]))
        states[row + 1], accelerations[row + 1] = advance(states[row], row, delta, tau)
        if ends(states[row], states[row + 1]):
            rows = row + 1 + with_end
            break
    return states[:rows], accelerations[:rows], delta[:rows], tau[:rows]


def row_states(p: CarConstants) -> tuple[str, ...]:
    """Names of the states of a row: those of the car's equations, then its place in the world."""
    return ("r", "v", "beta", "omega_r", "psi", *kind_of(p).own, "x", "y")


def logged(motion: Motion) -> Motion:
    """The motion with r, v, beta, omega_r, psi, x, y in place of `row_states`."""
    states, accelerations, delta, tau = motion
    return np.concatenate([states[:, :5], states[:, -2:]], axis=1), accelerations, delta, tau


@jitable
def _world_frame_rates(z: Any, command: Any, car: Any, out: Any) -> Any:
    """Writes d(row_states)/dt; returns (a_x, a_y)."""
    rates(z, (command[0], command[1]), (car[0], car[1], (0.0, 0.0, 0.0)), out)
    out[len(z) - 2], out[len(z) - 1], _ = world_rates(z[0], z[1], z[2], z[4])
    return body_acceleration(z[0], z[1], z[2], out[1], out[2])


@compiled
def _advance(z: Any, row: Any, delta: Any, tau: Any, p: Any, q: Any) -> Any:
    return runge_kutta_row(_world_frame_rates, z, row, delta, tau, (p, q), SUBSTEPS)


@compiled
def _start(delta: Any, tau: Any, p: Any, q: Any, z: Any) -> Any:
    settle(z, delta, tau, p, q)
    return _world_frame_rates(z, (delta, tau, 0.0), (p, q), np.empty(len(z)))


def start(state: Array, command: tuple[float, float], p: CarConstants, q: Effects) -> tuple[Array, Array]:
    """States (`row_states`) settled in (r, v, beta, omega_r) at the origin, and (a_x, a_y) [m/s^2] there."""
    z = np.zeros(len(row_states(p)))
    z[:4] = state
    return z, np.array(_start(*command, p, q, z))


def advance(z: Array, row: int, delta: Array, tau: Array, p: CarConstants, q: Effects) -> tuple[Array, Array]:
    """States a row later, and (a_x, a_y) [m/s^2] there.

    Args:
        z: states (`row_states`) at `row`; delta [rad], tau [N m]: the commands' rows [rows], filled up to row + 1,
            linear between rows; each is delayed here.
        p: the car; q: magnitudes, the sensors' unused.
    """
    later = z.copy()
    return later, np.array(_advance(later, row, delta, tau, p, q))
