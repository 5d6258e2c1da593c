"""Simulated cases for developing and calibrating the diagnosis: a compiled plant, four manoeuvres, sensors' noise.

The plant integrates `motion_with_effects` with all internal states of its own by RK4 at 0.5 ms, apart from the
diagnosis's filter (which treats actuators ahead of it and steps by 5 ms). `drake_cases` makes them with Drake plants
instead; drivers and draws are shared.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from drift_drake.car.compilation import compiled
from drift_drake.car.effects.delays import on_time, stamped
from drift_drake.car.effects.magnitudes import INTERNAL_COUNT, Effects, InternalStates, reading_gains
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.car.scalar import fixed_tuple
from drift_drake.car.sensors import LOG_ROW, NoiseLevels
from drift_drake.car.single_track.motion_with_effects import motion_with_effects, settled_internal_states
from experiments.benchmarks.drivers import MANOEUVRES, PERIOD, SLOWEST, SPIN, Driver, driven
from experiments.benchmarks.rows import by_rows, runge_kutta_row
from experiments.benchmarks.strange_effects import Strange, make_strange, ring_rates, rung_torque, strange_wrench
from experiments.benchmarks.truths import Truth, true_car

FINE = 20  # integration steps a row
RING = 7 + INTERNAL_COUNT  # place of the driveline's ringing in the plant's state
STATES = RING + 2
LAGGED = slice(7, 11)  # places of what actuators and tyres lag by
NOISE = {name: float(getattr(NoiseLevels(), name)) for name in LOG_ROW if name != "t"}


@compiled
def _rates(z: Any, command: Any, car: Any, out: Any) -> Any:
    """Writes the rates of z, and returns (a_x, a_y).

    z: r, v, beta, omega_r, psi, x, y, the effects' internal states, ring, ring rate.
    """
    (delta, tau, t), (constants, effects, strange) = command, car
    internal = InternalStates(*fixed_tuple(z[7:RING], INTERNAL_COUNT))
    f_x, f_y, m_z = strange_wrench(t, z[0], z[1], z[2], z[3], z[5], z[6], z[4], delta, tau, constants, strange)
    torque = rung_torque(tau, z[RING], strange)
    rates, m = motion_with_effects(
        z[0], z[1], z[2], z[3], z[4], internal, delta, torque, constants, effects, f_x, f_y, m_z
    )
    out[0], out[1], out[2], out[3] = rates.r_dot, rates.v_dot, rates.beta_dot, rates.omega_r_dot
    out[4], out[5], out[6] = z[0], z[1] * np.cos(z[4] + z[2]), z[1] * np.sin(z[4] + z[2])
    for i, rate in enumerate(m):
        out[7 + i] = rate
    out[RING], out[RING + 1] = ring_rates(z[RING], z[RING + 1], tau)
    return rates.a_x, rates.a_y


@compiled
def _advance(z: Any, row: Any, delta: Any, tau: Any, constants: Any, effects: Any, strange: Any) -> Any:
    return runge_kutta_row(_rates, z, row, delta, tau, (constants, effects, strange), FINE)


def simulate_run(driver: Driver, truth: Truth, vehicle: VehicleParameters, rng: np.random.Generator, name: str,
             duration: float = 12.0) -> Run:  # fmt: skip
    """One run of the car that `truth` describes, as its sensors log it."""
    constants, effects = true_car(truth, vehicle)
    motion = drive_rows(driver, constants, lambda _row: effects, make_strange(truth.strange), duration)
    return sensed(*motion, effects, rng, name)


def drive_rows(
    driver: Driver, constants: Constants, effects: Callable[[int], Effects], strange: Strange, duration: float,
    settles_at: int | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """States [rows, STATES], accelerations [rows, 2] and commands delta, tau [rows] of a drive, ended by a spin.

    Args:
        effects: of the car from a row to the next one; at -1 those that it has settled in before the drive;
        settles_at: the row at which actuators and tyres that begin to lag do so from where they are.
    """
    before, state = on_time(effects(-1)), driver.start()
    first = driver.command(0.0, state, driver.resting_command())
    z = np.zeros(STATES)
    z[:4] = state
    z[7:RING] = settled_internal_states(*(float(c) for c in state), *first, constants, before)
    z[RING] = first[1]
    acceleration = np.array(_rates(z, (*first, 0.0), (constants, before, strange), np.empty(STATES)))

    def advance(z: np.ndarray, row: int, delta: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        now, later = on_time(effects(row)), z.copy()
        if row == settles_at:
            later[LAGGED] = settled_internal_states(*map(float, z[:4]), delta[row], tau[row], constants, now)[:4]
        return later, np.array(_advance(later, row, delta, tau, constants, now, strange))

    return by_rows(
        (z, acceleration), first, duration, lambda t, z, last: driver.command(t, z[:4], last), advance,
        lambda _, z: abs(z[2]) > SPIN or z[1] < SLOWEST or z[3] < SLOWEST, with_end=False,
    )  # fmt: skip


def sensed(states: np.ndarray, accelerations: np.ndarray, delta: np.ndarray, tau: np.ndarray, effects: Effects,
           rng: np.random.Generator, name: str, noise: float = 1.0) -> Run:  # fmt: skip
    """What is logged of true states [rows, 7 or more] and commands: biased, late, `noise` times as noisy as usual."""
    commands, kept = stamped({"delta_cmd": delta, "tau_cmd": tau}, effects, PERIOD)
    states, accelerations = states[:kept], accelerations[:kept]
    t = np.arange(kept) * PERIOD
    by_r, by_v, by_beta, by_rim = reading_gains(effects)
    true = {
        "r": by_r * states[:, 0] + effects.gyro_bias,
        "v": by_v * states[:, 1],
        "beta": by_beta * states[:, 2] + effects.sideslip_bias,
        "omega_r": by_rim * states[:, 3],
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
    return Run(name=name, t=t, delta_cmd=commands["delta_cmd"], tau_cmd=commands["tau_cmd"], **columns)


def make_case(truth: Truth, vehicle: VehicleParameters, rng: np.random.Generator, duration: float = 12.0,
              manoeuvres: Sequence[str] = MANOEUVRES) -> list[Run]:  # fmt: skip
    """A run of each manoeuvre by one car (`drivers.driven`)."""
    return driven(
        manoeuvres,
        lambda kind, name: simulate_run(Driver(kind, rng, vehicle), truth, vehicle, rng, name, duration),
    )
