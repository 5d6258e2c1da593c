"""What `drift-drake simulate` drives, and the log that the car's sensors write of it."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydrake.systems.framework import LeafSystem
from pydrake.systems.primitives import ConstantVectorSource

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.driving import slowest
from drift_drake.car.log.measured_motion import measured_motion
from drift_drake.car.log.table import COLUMNS, InvalidLogError, Run, make_run, read_columns
from drift_drake.car.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.car.sensors import NoiseLevels
from drift_drake.car.step_model import NominalStepModel
from drift_drake.car.vehicle_file import check_effects, check_plausible
from drift_drake.common.arrays import Array
from drift_drake.drive.loop.drive import LOG_PERIOD, Drive, DriveLimits
from drift_drake.drive.manoeuvres.drivers import ROW_PERIOD, RowByRowDriver
from drift_drake.drive.manoeuvres.options import COMMANDS, FASTEST, NAMES, Name, Simulate, check_options
from drift_drake.drive.manoeuvres.steering_check import SteeringCheck
from drift_drake.drive.mpc.controller import MpcController
from drift_drake.drive.mpc.mpc import Mpc
from drift_drake.drive.mpc.plan import DT, Plan
from drift_drake.drive.reference.trajectory import Reference, figure_8, loops

SPEED_TIME = 1.0  # [s] in which a script's driver takes off an error in speed
ACCELERATION = 2.5  # [m/s^2] of the straight
STEP_AT, STEP_RAMP = 1.0, 0.1  # [s] when the steering steps, and how long it takes
SLALOM_PERIOD = 2.0  # [s]
HORIZON, PLAN_PERIOD = 25, 0.01  # steps of 0.1 s and [s] between plans of the drifts' model predictive control


class Manoeuvre(NamedTuple):
    """What `drives.drive.Drive` needs of a manoeuvre."""

    driver: LeafSystem
    steps: int
    spacing: float  # [s] of its plans
    state: Array  # [6] at the start
    command: tuple[float, float]  # at the start
    duration: float  # [s]
    reference: Reference | None = None


class ScriptDriver(RowByRowDriver):
    """Steers as a script says and holds the speed that it says.

    Args:
        parameters: the car it believes in, and its limits.
        script: (delta [rad], speed [m/s], acceleration [m/s^2]) wanted at a time [s].
    """

    def __init__(self, parameters: VehicleParameters, script: Callable[[float], tuple[float, float, float]]) -> None:
        super().__init__(parameters)
        self._script = script

    def wanted(self, t: float, measured: Array) -> Array:
        delta, speed, acceleration = self._script(t)
        tau = self.torque(acceleration + (speed - float(measured[1])) / SPEED_TIME)
        return np.array([delta, tau])


def straight(p: VehicleParameters, speed: float, _steering: float) -> Manoeuvre:
    """Accelerates straight on from `speed`, for 5 s, then holds the speed."""
    top = speed + 5.0 * ACCELERATION
    return _scripted(p, speed, lambda t: (0.0, min(speed + ACCELERATION * t, top), ACCELERATION * (t < 5.0)), 8.0)


def step_steer(p: VehicleParameters, speed: float, steering: float) -> Manoeuvre:
    """Steers in at once after a second, at a held speed."""
    return _scripted(p, speed, lambda t: (steering * float(np.clip((t - STEP_AT) / STEP_RAMP, 0, 1)), speed, 0.0), 5.0)


def slalom(p: VehicleParameters, speed: float, steering: float) -> Manoeuvre:
    """Steers to and fro, two seconds a turn and growing over five turns, at a held speed."""

    def script(t: float) -> tuple[float, float, float]:
        return steering * min(t / (5.0 * SLALOM_PERIOD), 1.0) * float(np.sin(2.0 * np.pi * t / SLALOM_PERIOD)), speed, 0

    return _scripted(p, speed, script, 12.0)


def steering_check(p: VehicleParameters, _speed: float, _steering: float) -> Manoeuvre:
    """Steers to and fro on a straight, slowly."""
    check = SteeringCheck(p)
    return Manoeuvre(check, 1, ROW_PERIOD, check.start(), (0.0, 0.0), check.duration, check.lane)


MANOEUVRES: dict[Name, Callable[[VehicleParameters, float, float], Manoeuvre]] = {
    "straight": straight,
    "step_steer": step_steer,
    "slalom": slalom,
    "steering_check": steering_check,
    "figure_8": lambda p, _speed, _steering: _tracked(p, figure_8(p)),
    "loops": lambda p, _speed, _steering: _tracked(p, loops(p)),
}


def logged(run: Run, p: VehicleParameters, effects: Effects) -> Manoeuvre:
    """A log's commands, from the state that it shows at its start; it needs `tau_cmd`."""
    commands = np.stack([run.delta_cmd, np.asarray(run.tau_cmd)], axis=1)
    state, _ = measured_motion(run, p).state(0, run.period, effects)
    source = ConstantVectorSource(Plan(0.0, commands).vector())
    delta_0, tau_0 = np.clip(commands[0], *p.command_limits())
    return Manoeuvre(source, len(run) - 1, run.period, np.array([*state, 0.0, 0.0]), (float(delta_0), float(tau_0)),
                     float(run.t[-1] - run.t[0]))  # fmt: skip


def _scripted(p: VehicleParameters, speed: float, script: Callable[[float], tuple[float, float, float]],
              duration: float) -> Manoeuvre:  # fmt: skip
    driver, state = ScriptDriver(p, script), np.array([0.0, speed, 0.0, speed, 0.0, 0.0])
    delta, tau = driver.command(0.0, state)
    return Manoeuvre(driver, 1, ROW_PERIOD, state, (float(delta), float(tau)), duration)


def _tracked(p: VehicleParameters, reference: Reference) -> Manoeuvre:
    """Drifts under model predictive control that believes in the vehicle file without effects."""
    delta, tau = (float(value) for value in reference.input(0.0))
    mpc = Mpc(NominalStepModel(p), p, reference, HORIZON, delay=PLAN_PERIOD, initial_command=(delta, tau))
    driver = MpcController(mpc, PLAN_PERIOD)
    return Manoeuvre(driver, HORIZON, DT, reference.state(0.0), (delta, tau), reference.duration, reference)


def simulate_drive(command: Simulate, parameters: VehicleParameters, effects: Effects) -> tuple[Run, str]:
    """The log of a drive at 100 Hz and how it ended: "time" is as planned, else what limit it met.

    Raises:
        InvalidLogError, InvalidVehicleError, InvalidOptionError: as `run_simulate`.
    """
    check_options(command, parameters)
    check_plausible(parameters)
    check_effects(effects, parameters)
    levels = dataclasses.asdict(NoiseLevels())
    noise = NoiseLevels(**{name: command.noise * level for name, level in levels.items()})
    m = _manoeuvre(command, parameters, effects)
    drive = Drive(parameters, m.driver, m.steps, m.spacing, None, m.command, effects, m.reference, noise)
    limits = DriveLimits(min_speed=slowest(parameters), max_speed=FASTEST)
    table, ending = drive.run(m.state, 0.0, command.duration or m.duration, command.seed, limits)
    table["t"] = LOG_PERIOD * np.round(table["t"] / LOG_PERIOD)
    columns = {name: table[name].to_numpy(dtype=float) for name in COLUMNS if name in table}
    try:
        return make_run(command.out, columns), ending
    except InvalidLogError as error:
        raise InvalidLogError(f"{error} (the drive ended after {table['t'].iloc[-1]:.2f} s: {ending})") from None


def _manoeuvre(command: Simulate, parameters: VehicleParameters, effects: Effects) -> Manoeuvre:
    if command.drive in NAMES:
        try:
            return MANOEUVRES[command.drive](parameters, command.speed, command.steering)
        except ValueError as error:
            raise InvalidVehicleError(f"{command.vehicle}: this car cannot drive {command.drive}: {error}") from None
    path = Path(command.drive)
    columns = read_columns(path)
    missing = [name for name in COMMANDS if name not in columns]
    if missing:
        raise InvalidLogError(f"{path}: missing column {', '.join(missing)}; driving needs {', '.join(COMMANDS)}")
    rows = len(columns["t"])
    columns.setdefault("r", np.zeros(rows))
    columns.setdefault("v", np.full(rows, command.speed))
    return logged(make_run(path, columns), parameters, effects)
