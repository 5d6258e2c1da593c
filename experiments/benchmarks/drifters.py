"""Drivers that make drives to learn from: feedback that holds a drift, and scripts of a manual kind."""

import numpy as np
from pydrake.systems.controllers import LinearQuadraticRegulator

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import linearize
from drift_drake.common.arrays import Array
from drift_drake.drive.manoeuvres.drivers import RowByRowDriver
from drift_drake.drive.mpc.plan import interpolate_knots
from drift_drake.drive.reference.equilibrium import DriftEquilibrium

KNOT_SPACING = 0.1  # [s] of scripts, wander and dither
HOLD_STATE_COST = (4.0, 0.3, 20.0, 0.05)  # of (r, v, beta, omega_r)
HOLD_INPUT_COST = (10.0, 5e-5)  # of (delta, tau)
DITHER_STEERING = 0.02  # [rad] standard deviation
DITHER_TORQUE = 6.0  # [N m]


def hold_gain(parameters: VehicleParameters, drift: DriftEquilibrium) -> Array:
    """LQR gain [2, 4] of (delta, tau) on (r, v, beta, omega_r) that holds a drift equilibrium."""
    x = np.array([drift.r, drift.v, drift.beta, drift.omega_r, 0.0, 0.0])
    _, a, b = linearize(x, np.array([drift.delta, drift.tau]), np.array(0.0), parameters.constants())
    gain, _ = LinearQuadraticRegulator(a[:4, :4], b[:4], np.diag(HOLD_STATE_COST), np.diag(HOLD_INPUT_COST))
    return np.asarray(gain)


class HoldDriver(RowByRowDriver):
    """Holds a drift equilibrium of the car it believes in, about inputs that wander; free to leave its circle.

    Args:
        parameters: the car it believes in, and its limits.
        drift: to hold.
        wander: added to the equilibrium's inputs [K, 2], knots 0.1 s apart, the last held on.
    """

    def __init__(self, parameters: VehicleParameters, drift: DriftEquilibrium, wander: Array) -> None:
        super().__init__(parameters)
        self._gain = hold_gain(parameters, drift)
        self._target = np.array([drift.r, drift.v, drift.beta, drift.omega_r])
        self._command = np.array([drift.delta, drift.tau])
        self._wander = wander

    def initial_command(self) -> tuple[float, float]:
        """The command to start from: the equilibrium's."""
        return float(self._command[0]), float(self._command[1])

    def first(self, _t: float, _measured: Array) -> Array:
        return self._command

    def wanted(self, t: float, measured: Array) -> Array:
        return self._command + interpolate_knots(self._wander, t) - self._gain @ (measured[:4] - self._target)


def dither(duration: float, generator: np.random.Generator) -> Array:
    """White noise on the inputs [K, 2] at knots 0.1 s apart, which keeps the car excited."""
    count = round(duration / KNOT_SPACING) + 2
    return np.array([DITHER_STEERING, DITHER_TORQUE]) * generator.standard_normal((count, 2))


def wander(duration: float, generator: np.random.Generator, deviation: Array, period: float) -> Array:
    """Slow noise [K, 2]: independent values every `period` [s], linear in between, at knots 0.1 s apart."""
    t = np.arange(round(duration / KNOT_SPACING) + 2) * KNOT_SPACING
    at = np.arange(int(t[-1] / period) + 2) * period
    values = deviation * generator.standard_normal((len(at), 2))
    return np.stack([np.interp(t, at, values[:, i]) for i in range(2)], axis=1)


def manual_script(parameters: VehicleParameters, duration: float, generator: np.random.Generator) -> Array:
    """Open-loop inputs [K, 2] of a manual kind: steering swung about, throttle opened and lifted, now and then a kick.

    Slow random swings of a random size and pace, and in half of the scripts a kick of throttle and steering that breaks
    the rear away; nobody catches the car, so many end in a spin.
    """
    swing = wander(duration, generator, np.array([generator.uniform(0.04, 0.25), 0.0]), generator.uniform(0.5, 1.2))
    throttle = wander(duration, generator, np.array([0.0, generator.uniform(20.0, 120.0)]), generator.uniform(0.6, 1.5))
    script = swing + throttle + np.array([0.0, generator.uniform(20.0, 140.0)])
    if generator.random() < 0.5:
        start = generator.integers(10, max(11, len(script) - 20))
        kick = slice(start, start + generator.integers(5, 12))
        script[kick] += [generator.choice([-1.0, 1.0]) * generator.uniform(0.1, 0.3), generator.uniform(100.0, 300.0)]
    return np.clip(script, *parameters.command_limits())
