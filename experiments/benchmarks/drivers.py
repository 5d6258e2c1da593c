"""Drivers of a car at its limits: a slalom, power in turns, transients, and a steady drift held by feedback."""

import contextlib
import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import solve_discrete_are
from scipy.optimize import least_squares

from drift_drake.car.log.table import Run
from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.car.single_track.motion import motion

MANOEUVRES = ("slalom", "power", "transients", "drift")
PERIOD = 0.01  # [s] of the log
STEERING_RATE = 3.0  # [rad/s] of the driver's commands
TORQUE_RATE = 1500.0  # [N m/s]
SPIN, SLOWEST = 1.1, 3.0  # [rad] of sideslip, [m/s] of the car and of its rear rims, at which a run ends


@dataclasses.dataclass(frozen=True)
class Equilibrium:
    """A steady drift of the nominal car and the feedback that holds it."""

    state: np.ndarray  # r, v, beta, omega_r
    command: np.ndarray  # delta, tau
    gain: np.ndarray  # [2, 4]


def regulated_drift(p: Constants, v: float, beta: float) -> Equilibrium:
    """Steady drift at speed v [m/s] and sideslip beta [rad], and a linear-quadratic regulator around it."""
    sign = -np.sign(beta)

    def residual(unknown: np.ndarray) -> np.ndarray:
        r, omega_r, delta, tau = unknown[0], unknown[1], unknown[2], 100.0 * unknown[3]
        rates = motion(r, v, beta, omega_r, delta, tau, p)
        return np.array([rates.r_dot, rates.v_dot, v * rates.beta_dot, rates.omega_r_dot])

    guess = np.array([sign * 0.9 * p.friction * p.gravity / v, v + 4.0, sign * -0.35, 1.4])
    found = least_squares(residual, guess).x
    state = np.array([found[0], v, beta, found[1]])
    command = np.array([found[2], 100.0 * found[3]])

    def rates_at(x: np.ndarray) -> np.ndarray:
        return np.array(motion(*(float(c) for c in x), p)[:4])

    at = np.concatenate([state, command])
    steps = np.array([1e-4, 1e-3, 1e-4, 1e-3, 1e-4, 1e-1])
    jacobian = np.stack(
        [(rates_at(at + np.eye(6)[i] * h) - rates_at(at - np.eye(6)[i] * h)) / (2 * h) for i, h in enumerate(steps)], -1
    )
    a, b = jacobian[:, :4], jacobian[:, 4:]
    # One row of delay from state to command, and actuators that should stay calm: states augmented by the command.
    big = np.zeros((6, 6))
    big[:4, :4], big[:4, 4:] = np.eye(4) + PERIOD * a + PERIOD**2 / 2 * a @ a, PERIOD * b
    thrust = np.zeros((6, 2))
    thrust[4:] = np.eye(2)
    q, r = np.diag([4.0, 0.5, 40.0, 0.05, 0.0, 0.0]), np.diag([30.0, 2e-4])
    s = solve_discrete_are(big, thrust, q, r)
    gain = np.linalg.solve(r + thrust.T @ s @ thrust, thrust.T @ s @ big)[:, :4]
    return Equilibrium(state, command, gain)


def slewed(wanted: float, last: float, rate: float, low: float, high: float) -> float:
    """The command a row later, within the driver's rate and the actuator's range."""
    return float(np.clip(np.clip(wanted, last - rate * PERIOD, last + rate * PERIOD), low, high))


class Driver:
    """Commands of one manoeuvre from the car's state, row by row; its draws are fixed at construction."""

    def __init__(self, kind: str, rng: np.random.Generator, vehicle: VehicleParameters) -> None:
        self.kind = kind
        self.vehicle = vehicle
        u = rng.uniform
        self.side = 1.0 if u() < 0.5 else -1.0
        self.speed = u(10.0, 13.5)
        self.amplitude = {"slalom": u(0.07, 0.18), "power": u(0.04, 0.08), "transients": u(0.22, 0.4), "drift": 0.0}[
            kind
        ]
        self.period = {"slalom": u(1.8, 2.6), "power": u(2.2, 2.8), "transients": u(1.6, 2.2), "drift": 1.0}[kind]
        self.second = u(0.2, 0.5)
        self.second_period = u(0.9, 1.4)
        self.thrust, self.thrust_period = u(20.0, 45.0), u(1.2, 1.6)
        self.pulse = u(170.0, 230.0)
        self.wander, self.wander_period = u(0.01, 0.04), u(2.5, 5.0)
        self.beta = -self.side * u(0.42, 0.6)
        self.equilibrium = regulated_drift(vehicle.constants(), u(12.0, 15.0), self.beta) if kind == "drift" else None

    def start(self) -> np.ndarray:
        """First state (r, v, beta, omega_r)."""
        if self.equilibrium is not None:
            return self.equilibrium.state.copy()
        return np.array([0.0, 8.0, 0.0, 8.0])

    def resting_command(self) -> tuple[float, float]:
        """Command before the first row."""
        if self.equilibrium is None:
            return 0.0, 0.0
        return float(self.equilibrium.command[0]), float(self.equilibrium.command[1])

    def wanted(self, t: float, state: np.ndarray) -> tuple[float, float]:
        """Steering [rad] and torque [N m] before rate limits."""
        phase = 2.0 * np.pi * t / self.period
        if self.equilibrium is not None:
            goal = self.equilibrium.state.copy()
            goal[2] += self.wander * np.sin(2.0 * np.pi * t / self.wander_period)
            delta, tau = self.equilibrium.command - self.equilibrium.gain @ (state - goal)
            return delta, tau + self.thrust * np.sin(2.0 * np.pi * t / self.thrust_period)
        hold = 45.0 * (self.speed - state[1])
        if self.kind == "slalom":
            second = self.second * np.sin(2.0 * np.pi * t / self.second_period)
            return self.side * self.amplitude * (np.sin(phase) + second), float(np.clip(hold, -30.0, 130.0))
        if self.kind == "power":
            pulse = self.pulse * max(np.sin(2.0 * np.pi * (t - 1.0) / 4.6), 0.2) if t > 1.0 else 40.0
            return self.side * self.amplitude * np.sin(phase), float(-30.0 if state[1] > 21.0 else pulse)
        square = 1.0 if np.sin(phase) > 0.0 else -1.0
        kick = 30.0 if np.sin(2.0 * phase + 1.0) > 0.0 else -30.0
        return self.side * self.amplitude * square, float(np.clip(hold + kick, -30.0, 200.0))

    def command(self, t: float, state: np.ndarray, last: tuple[float, float]) -> tuple[float, float]:
        """Command a row later, from the state (r, v, beta, omega_r and whatever follows)."""
        delta, tau = self.wanted(t, state[:4])
        v = self.vehicle
        return (
            slewed(delta, last[0], STEERING_RATE, -v.steering_limit, v.steering_limit),
            slewed(tau, last[1], TORQUE_RATE, v.torque_min, v.torque_max),
        )


def driven(manoeuvres: Sequence[str], drive: Callable[[str, str], Run]) -> list[Run]:
    """A run of each manoeuvre; one too short for a log is driven again with other draws, five times at most.

    Args:
        drive: of a manoeuvre and the run's name.
    """
    runs = []
    for i, kind in enumerate(manoeuvres):
        for _ in range(5):
            with contextlib.suppress(ValueError):
                runs.append(drive(kind, f"run_{i}"))
                break
    return runs
