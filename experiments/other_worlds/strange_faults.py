"""Strange faults that the catalogue lacks, put into the logs of a day without an effect.

The recorded response cannot be changed. What a sensor reads can, and the command to the car: of a fault of an actuator,
the logged command is the one that the fault would have turned into the recorded one. Faults in which friction or forces
change need a car of their own and are not here. Sizes are a full-size car's, to be scaled by its wheelbase or, of
torques, by what the run itself uses.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from drift_drake.car.effects.catalogue import REFERENCE, wheelbase
from drift_drake.car.log.plausible import LARGEST
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from experiments.other_worlds.changes import COMMANDS, MEASURED, needed, read_at, with_columns

MOST_USED = 0.95  # quantile of a command's absolute value that stands for its largest
JITTERED = 0.15  # [s] between independent errors of the commands' stamps
PLAY_RATE = 3.0  # [rad/s] by which a driver turns through the play
EDGE = 0.03  # of the largest torque, over which a dead zone sets in
PERIODIC = 5.0  # [s] of a gyroscope that wanders
HOLD_EVERY, HOLD = 2.0, 0.4  # [s] between, and of, the times at which the rim speed is held

Put = Callable[[Run, float, np.random.Generator], Run]


def sideslip_gain(run: Run, q: float, _rng: np.random.Generator) -> Run:
    """The measured sideslip is too small by a share `q`."""
    return dataclasses.replace(run, beta=needed(run, "beta") * (1.0 - q))


def sideslip_by_speed(run: Run, q: float, _rng: np.random.Generator) -> Run:
    """`q` [rad] added to the measured sideslip for each scale of the speed's scatter within the run."""
    apart = run.v - np.median(run.v)
    return dataclasses.replace(run, beta=needed(run, "beta") + q * apart / max(float(np.std(run.v)), 0.05))


def gyro_drift(run: Run, q: float, _rng: np.random.Generator) -> Run:
    """`q` [rad/s] more in the measured yaw rate at a run's end than at its start; the heading stays."""
    return dataclasses.replace(run, r=run.r + q * (run.t - run.t[0]) / (run.t[-1] - run.t[0]))


def gyro_wander(run: Run, q: float, rng: np.random.Generator) -> Run:
    """A bias of the gyroscope [rad/s] that goes up and down by `q` every five seconds."""
    phase = rng.uniform(0.0, 2.0 * np.pi)
    return dataclasses.replace(run, r=run.r + q * np.sin(2.0 * np.pi * run.t / PERIODIC + phase))


def heading_drift(run: Run, q: float, _rng: np.random.Generator) -> Run:
    """The measured heading turns away by `q` [rad/s]; the yaw rate stays."""
    return dataclasses.replace(run, psi=np.unwrap(needed(run, "psi")) + q * (run.t - run.t[0]))


def coarse_wheel_speed(run: Run, q: float, _rng: np.random.Generator) -> Run:
    """The rim speed is read in steps of `q` [m/s], rounded down: pulses that are counted."""
    return dataclasses.replace(run, omega_r=q * np.floor(needed(run, "omega_r") / q))


def held_wheel_speed(run: Run, q: float, rng: np.random.Generator) -> Run:
    """Every two seconds the rim speed is held for 0.4 s, and reads a share `q` too little while it is."""
    omega_r = needed(run, "omega_r").copy()
    for start in np.arange(run.t[0] + rng.uniform(0.0, HOLD_EVERY), run.t[-1], HOLD_EVERY):
        rows = (run.t >= start) & (run.t < start + HOLD)
        if np.any(rows):
            omega_r[rows] = (1.0 - q) * omega_r[int(np.argmax(rows))]
    return dataclasses.replace(run, omega_r=omega_r)


def stretched_clock(run: Run, q: float, _rng: np.random.Generator) -> Run:
    """The recorder's clock runs fast by a share `q`: what took a second is logged as taking 1 + `q`."""
    return read_at(run, (*MEASURED, *COMMANDS), run.t[0] + (run.t - run.t[0]) / (1.0 + q))


def jittered_commands(run: Run, q: float, rng: np.random.Generator) -> Run:
    """Commands are logged up to `q` [s] before they act, by another time every 0.15 s."""
    lasts = float(run.t[-1] - run.t[0])
    knots = np.linspace(run.t[0], run.t[-1], max(int(lasts / JITTERED), 2))
    early = np.interp(run.t, knots, rng.uniform(0.0, q, len(knots)))
    return read_at(run, COMMANDS, run.t + early)


def held_commands(run: Run, q: float, _rng: np.random.Generator) -> Run:
    """Commands are logged only every `q` [s] and held until the next one."""
    every = max(round(q / run.period), 1)
    return with_columns(run, COMMANDS, lambda values: values[np.arange(len(values)) // every * every])


def steering_backlash(run: Run, q: float, _rng: np.random.Generator) -> Run:
    """The road wheel follows the command with a play of `q` [rad] in all: the command has turned through it."""
    moves = np.sign(np.gradient(run.delta_cmd))
    last = np.maximum.accumulate(np.where(moves != 0.0, np.arange(len(moves)), 0))
    wanted = run.delta_cmd + 0.5 * q * moves[last]
    command, most = wanted.copy(), PLAY_RATE * run.period
    for i in range(1, len(command)):
        command[i] = command[i - 1] + np.clip(wanted[i] - command[i - 1], -most, most)
    return _steered(run, command)


def nonlinear_steering(run: Run, q: float, _rng: np.random.Generator) -> Run:
    """Steering that yields: a share `q` more is commanded at large angles, nothing at small ones."""
    return _steered(run, run.delta_cmd * (1.0 + q * (run.delta_cmd / _largest(run.delta_cmd)) ** 2))


def one_sided_steering(run: Run, q: float, _rng: np.random.Generator) -> Run:
    """To the left a share `q` more is commanded than the road wheel turns, to the right nothing."""
    return _steered(run, run.delta_cmd * np.where(run.delta_cmd > 0.0, 1.0 + q, 1.0))


def torque_dead_zone(run: Run, q: float, _rng: np.random.Generator) -> Run:
    """Torque commands below a share `q` of the largest do nothing, larger ones that much less."""
    tau = needed(run, "tau_cmd")
    most = _largest(tau)
    return dataclasses.replace(run, tau_cmd=tau + q * most * np.tanh(tau / (EDGE * most)))


def torque_ceiling(run: Run, q: float, _rng: np.random.Generator) -> Run:
    """Of torque above a quantile of the run's, 1 + `q` times as much was commanded as came."""
    tau = needed(run, "tau_cmd")
    top = float(np.quantile(tau, 0.6))
    return dataclasses.replace(run, tau_cmd=np.where(tau > top, top + (1.0 + q) * (tau - top), tau))


def torque_by_speed(run: Run, q: float, _rng: np.random.Generator) -> Run:
    """An engine that tires: up to a share `q` more was commanded than came, at the highest speeds of a run."""
    low, high = np.quantile(run.v, [0.05, MOST_USED])
    share = np.clip((run.v - low) / max(high - low, 1e-3), 0.0, 1.0)
    return dataclasses.replace(run, tau_cmd=needed(run, "tau_cmd") * (1.0 + q * share))


@dataclasses.dataclass(frozen=True)
class StrangeFault:
    """One kind: how it is put in, and a full-size car's magnitudes."""

    put: Put
    low: float
    high: float
    length: float = 0.0  # power of the wheelbase, relative to the reference car's, that scales it
    either_sign: bool = False

    def range_for(self, vehicle: VehicleParameters) -> tuple[float, float]:
        """Least and greatest magnitude for a car of another size."""
        size = (wheelbase(vehicle) / wheelbase(REFERENCE)) ** self.length
        return self.low * size, self.high * size

    def drawn(self, vehicle: VehicleParameters, rng: np.random.Generator) -> float:
        """A magnitude for a car."""
        sign = -1.0 if self.either_sign and rng.uniform() < 0.5 else 1.0
        return float(f"{sign * rng.uniform(*self.range_for(vehicle)):.4g}")


STRANGE = {
    "sideslip_gain": StrangeFault(sideslip_gain, 0.2, 0.35),
    "jittered_commands": StrangeFault(jittered_commands, 0.06, 0.1, length=0.5),
    "torque_dead_zone": StrangeFault(torque_dead_zone, 0.2, 0.35),
    "gyro_drift": StrangeFault(gyro_drift, 0.04, 0.08, length=-0.5, either_sign=True),
    "steering_backlash": StrangeFault(steering_backlash, 0.025, 0.045),
    "coarse_wheel_speed": StrangeFault(coarse_wheel_speed, 0.5, 0.9, length=0.5),
    "stretched_clock": StrangeFault(stretched_clock, 0.02, 0.04),
    "torque_ceiling": StrangeFault(torque_ceiling, 1.0, 2.0),
    "nonlinear_steering": StrangeFault(nonlinear_steering, 0.3, 0.5),
    "heading_drift": StrangeFault(heading_drift, 0.02, 0.04, length=-0.5, either_sign=True),
    "gyro_wander": StrangeFault(gyro_wander, 0.025, 0.05, length=-0.5),
    "sideslip_by_speed": StrangeFault(sideslip_by_speed, 0.015, 0.03, either_sign=True),
    "one_sided_steering": StrangeFault(one_sided_steering, 0.15, 0.3),
    "torque_by_speed": StrangeFault(torque_by_speed, 0.4, 0.8),
    "held_wheel_speed": StrangeFault(held_wheel_speed, 0.05, 0.1),
    "held_commands": StrangeFault(held_commands, 0.15, 0.25, length=0.5),
}


def strange_day(
    runs: Sequence[Run], kind: str, vehicle: VehicleParameters, rng: np.random.Generator
) -> tuple[list[Run], float]:
    """Runs of one day with a strange fault of one magnitude, and that magnitude.

    Args:
        kind: of `STRANGE`; vehicle: the car, for its size.
    """
    fault = STRANGE[kind]
    magnitude = fault.drawn(vehicle, rng)
    return [fault.put(run, magnitude, rng) for run in runs], magnitude


def _largest(values: np.ndarray) -> float:
    """What stands for the largest absolute value of a command."""
    return max(float(np.quantile(np.abs(values), MOST_USED)), 1e-6)


def _steered(run: Run, command: np.ndarray) -> Run:
    """The run with another steering command, within what a log may hold."""
    most = LARGEST["delta_cmd"][0]
    return dataclasses.replace(run, delta_cmd=np.clip(command, -most, most))
