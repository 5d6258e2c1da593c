"""Simulated cases for developing and calibrating the diagnosis: a compiled plant, four manoeuvres, sensors' noise.

The plant integrates `motion_with_effects` with every memory of its own by RK4 at 0.5 ms, apart from the diagnosis's
filter (which treats actuators ahead of it and steps by 5 ms). The blind check makes its cases with Drake plants
instead (`gap_blind`); drivers and draws are shared.
"""

import dataclasses
from typing import Any

import numpy as np
from scipy.linalg import solve_discrete_are
from scipy.optimize import least_squares

from drift_drake.compilation import compiled
from drift_drake.estimation.prior import TOLERANCE_OF
from drift_drake.logs.table import Run
from drift_drake.vehicle.bicycle import motion
from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.effects import MEMORIES, Effects, Memory, make_effects, motion_with_effects, settled_memory
from drift_drake.vehicle.parameters import Constants, Tolerance, VehicleParameters
from drift_drake.vehicle.scalar import fixed_tuple
from experiments.gap.strange_effects import FAMILIES, Strange, ring_rates, rung_torque, strange_wrench

PERIOD = 0.01  # [s] of the log
FINE = 20  # integration steps a row
STEERING_RATE = 3.0  # [rad/s] of the driver's commands
TORQUE_RATE = 1500.0  # [N m/s]
SPIN = 1.1  # [rad] of sideslip at which a run ends
RING = 7 + MEMORIES  # place of the driveline's ringing in the plant's state
STATES = RING + 2
NOISE = {
    "x": 0.01,
    "y": 0.01,
    "psi": 0.001,
    "r": 0.002,
    "v": 0.02,
    "beta": 0.002,
    "omega_r": 0.04,
    "ax": 0.05,
    "ay": 0.05,
}


@dataclasses.dataclass(frozen=True)
class Truth:
    """What a case hides: effects of the catalogue, strange ones, and the car's deviations from nominal."""

    effects: dict[str, float]
    strange: dict[str, float] = dataclasses.field(default_factory=dict)
    deviations: dict[str, float] = dataclasses.field(default_factory=dict)


@compiled
def _rates(z: Any, t: Any, delta: Any, tau: Any, constants: Any, effects: Any, strange: Any, out: Any) -> Any:
    """z: r, v, beta, omega_r, psi, x, y, the effects' memory, ring, ring rate, a_x, a_y (outputs only)."""
    memory = Memory(*fixed_tuple(z[7:RING], MEMORIES))
    f_x, f_y, m_z = strange_wrench(t, z[0], z[1], z[2], z[3], z[5], z[6], z[4], delta, tau, constants, strange)
    torque = rung_torque(tau, z[RING], strange)
    rates, m = motion_with_effects(
        z[0], z[1], z[2], z[3], z[4], memory, delta, torque, constants, effects, f_x, f_y, m_z
    )
    out[0], out[1], out[2], out[3] = rates.r_dot, rates.v_dot, rates.beta_dot, rates.omega_r_dot
    out[4], out[5], out[6] = z[0], z[1] * np.cos(z[4] + z[2]), z[1] * np.sin(z[4] + z[2])
    for i, rate in enumerate(m):
        out[7 + i] = rate
    out[RING], out[RING + 1] = ring_rates(z[RING], z[RING + 1], tau)
    out[STATES], out[STATES + 1] = rates.a_x, rates.a_y


@compiled
def _at(history: Any, rows: Any, place: Any) -> Any:
    if place <= 0.0:
        return history[0]
    row = min(int(place), rows - 1)
    return history[row] + (place - row) * (history[min(row + 1, rows)] - history[row])


@compiled
def _advance(z: Any, row: Any, delta_cmd: Any, tau_cmd: Any, constants: Any, effects: Any, strange: Any) -> Any:
    """From row to row + 1; commands up to row + 1 are known."""
    h = PERIOD / FINE
    n = STATES
    k1, k2, k3, k4 = np.zeros(n + 2), np.zeros(n + 2), np.zeros(n + 2), np.zeros(n + 2)
    late = effects.steering_delay / PERIOD
    for i in range(FINE):
        a, b, c = row + i / FINE, row + (i + 0.5) / FINE, row + (i + 1) / FINE
        da, db, dc = (_at(delta_cmd, row + 1, a - late), _at(delta_cmd, row + 1, b - late),
                      _at(delta_cmd, row + 1, c - late))  # fmt: skip
        ta, tb, tc = _at(tau_cmd, row + 1, a), _at(tau_cmd, row + 1, b), _at(tau_cmd, row + 1, c)
        _rates(z, a * PERIOD, da, ta, constants, effects, strange, k1)
        _rates(z + 0.5 * h * k1[:n], b * PERIOD, db, tb, constants, effects, strange, k2)
        _rates(z + 0.5 * h * k2[:n], b * PERIOD, db, tb, constants, effects, strange, k3)
        _rates(z + h * k3[:n], c * PERIOD, dc, tc, constants, effects, strange, k4)
        z += h / 6.0 * (k1[:n] + 2.0 * k2[:n] + 2.0 * k3[:n] + k4[:n])
    _rates(z, (row + 1) * PERIOD, dc, tc, constants, effects, strange, k1)
    return k1[n], k1[n + 1]


@dataclasses.dataclass(frozen=True)
class Equilibrium:
    """A steady drift of the nominal car and the feedback that holds it."""

    state: np.ndarray  # r, v, beta, omega_r
    command: np.ndarray  # delta, tau
    gain: np.ndarray  # [2, 4]


def drift_equilibrium(p: Constants, v: float, beta: float) -> Equilibrium:
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
    push = np.zeros((6, 2))
    push[4:] = np.eye(2)
    q, r = np.diag([4.0, 0.5, 40.0, 0.05, 0.0, 0.0]), np.diag([30.0, 2e-4])
    s = solve_discrete_are(big, push, q, r)
    gain = np.linalg.solve(r + push.T @ s @ push, push.T @ s @ big)[:, :4]
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
        self.push, self.push_period = u(20.0, 45.0), u(1.2, 1.6)
        self.pulse = u(170.0, 230.0)
        self.wander, self.wander_period = u(0.01, 0.04), u(2.5, 5.0)
        self.beta = -self.side * u(0.42, 0.6)
        self.equilibrium = drift_equilibrium(vehicle.constants(), u(12.0, 15.0), self.beta) if kind == "drift" else None

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
            return delta, tau + self.push * np.sin(2.0 * np.pi * t / self.push_period)
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


MANOEUVRES = ("slalom", "power", "transients", "drift")


def true_constants(vehicle: VehicleParameters, deviations: dict[str, float]) -> tuple[Constants, float]:
    """The car's own constants under its deviations from nominal, and its steering offset [rad]."""
    c = vehicle.constants()._asdict()
    for name, value in deviations.items():
        if name == "front_axle_distance":
            c["front_axle_distance"] += value
            c["rear_axle_distance"] -= value
        elif name == "torque":
            c["gear_ratio"] *= 1.0 + value
        elif name != "steering_offset":
            c[name] *= 1.0 + value
    return Constants(**c), deviations.get("steering_offset", 0.0)


def simulate(driver: Driver, truth: Truth, vehicle: VehicleParameters, rng: np.random.Generator, name: str,
             duration: float = 12.0) -> Run:  # fmt: skip
    """One run of the car that `truth` describes, as its sensors log it."""
    constants, offset = true_constants(vehicle, truth.deviations)
    effects = make_effects(truth.effects)
    effects = effects._replace(steering_offset=effects.steering_offset + offset)
    strange = Strange(**truth.strange)
    strange = Strange(*(float(q) for q in strange))
    rows = round(duration / PERIOD) + 1
    delta, tau = np.zeros(rows), np.zeros(rows)
    state = driver.start()
    delta[0], tau[0] = driver.command(0.0, state, driver.resting_command())
    z, scratch = np.zeros(STATES), np.zeros(STATES + 2)
    z[:4] = state
    z[7:RING] = settled_memory(*(float(c) for c in state), delta[0], tau[0], constants, effects)
    z[RING] = tau[0]
    _rates(z, 0.0, delta[0], tau[0], constants, effects, strange, scratch)
    states, accelerations = np.zeros((rows, STATES)), np.zeros((rows, 2))
    states[0], accelerations[0] = z, scratch[STATES:]
    end = rows
    for row in range(rows - 1):
        delta[row + 1], tau[row + 1] = driver.command(row * PERIOD, z[:4], (delta[row], tau[row]))
        accelerations[row + 1] = _advance(z, row, delta, tau, constants, effects, strange)
        states[row + 1] = z
        if abs(z[2]) > SPIN or z[1] < 3.0 or z[3] < 3.0:
            end = row + 1
            break
    return sensed(states[:end], accelerations[:end], delta[:end], tau[:end], effects, rng, name)


def sensed(states: np.ndarray, accelerations: np.ndarray, delta: np.ndarray, tau: np.ndarray, effects: Effects,
           rng: np.random.Generator, name: str, noise: float = 1.0) -> Run:  # fmt: skip
    """What the sensors log of true states [rows, 7 or more]: biased, late, `noise` times as noisy as usual."""
    t = np.arange(len(states)) * PERIOD
    true = {
        "r": states[:, 0] + effects.gyro_bias,
        "v": states[:, 1],
        "beta": states[:, 2] + effects.sideslip_bias,
        "omega_r": states[:, 3] * (1.0 + effects.wheel_radius_error),
        "psi": states[:, 4],
        "x": states[:, 5],
        "y": states[:, 6],
        "ax": accelerations[:, 0],
        "ay": accelerations[:, 1],
    }
    columns: dict[str, Any] = {}
    for column, values in true.items():
        late = np.interp(t - effects.sensor_latency, t, values)
        columns[column] = late + noise * NOISE[column] * rng.standard_normal(len(t))
    return Run(name=name, t=t, delta_cmd=delta, tau_cmd=tau, **columns)


def make_case(truth: Truth, vehicle: VehicleParameters, rng: np.random.Generator, duration: float = 12.0) -> list[Run]:
    """Four runs of one car; a run that spins within its first second is driven again with other draws."""
    runs = []
    for i, kind in enumerate(MANOEUVRES):
        for _ in range(5):
            try:
                runs.append(simulate(Driver(kind, rng, vehicle), truth, vehicle, rng, f"run_{i}", duration))
                break
            except ValueError:
                continue
    return runs


def drawn_deviations(rng: np.random.Generator, tolerance: Tolerance) -> dict[str, float]:
    """Deviations from nominal, one normal draw of each tolerance's standard deviation (two and a half at most)."""
    out = {}
    for field in dataclasses.fields(tolerance):
        if field.name != "gear_ratio":
            out[field.name] = float(np.clip(rng.standard_normal(), -2.5, 2.5) * getattr(tolerance, field.name))
    return out


LEAST_TOLERANCES = 4.0  # a deviation of a tolerance's size is no gap to report


def drawn_magnitude(rng: np.random.Generator, name: str, tolerance: Tolerance) -> float:
    """A magnitude within the practical range.

    A signed one is at least an eighth of the way to its end, and one that a tolerance could be at least four of them.
    """
    info = CATALOGUE[name]
    if not info.signed:
        return float(rng.uniform(info.low, info.high))
    end = info.low if rng.uniform() < 0.5 else info.high
    least = 0.125 * abs(end)
    if name in TOLERANCE_OF:
        least = max(least, LEAST_TOLERANCES * getattr(tolerance, TOLERANCE_OF[name]))
    return float(np.sign(end) * rng.uniform(least, abs(end)))


def drawn_truth(rng: np.random.Generator, tier: str, vehicle: VehicleParameters) -> Truth:
    """What a case of a tier hides.

    Tiers: exact (a single effect, the nominal exact), tolerance (a single effect, the nominal off), none, pair,
    family (an effect that the catalogue lacks).
    """
    deviations = {} if tier == "exact" else drawn_deviations(rng, vehicle.tolerance)
    if tier == "none":
        return Truth({}, {}, deviations)
    if tier == "family":
        name = str(rng.choice(list(FAMILIES)))
        family = FAMILIES[name]
        sign = -1.0 if family.signed and rng.uniform() < 0.5 else 1.0
        return Truth({}, {name: sign * float(rng.uniform(family.low, family.high))}, deviations)
    names = rng.choice(list(CATALOGUE), size=2 if tier == "pair" else 1, replace=False)
    return Truth({str(name): drawn_magnitude(rng, str(name), vehicle.tolerance) for name in names}, {}, deviations)
