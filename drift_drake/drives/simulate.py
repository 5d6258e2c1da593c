"""What `drift-drake simulate` drives, and the log that the car's sensors write of it."""

import dataclasses
from pathlib import Path

import numpy as np

from drift_drake.drives.command import COMMANDS, FASTEST, Simulate, check_options
from drift_drake.drives.manoeuvres import MANOEUVRES, Manoeuvre, logged
from drift_drake.drives.names import NAMES
from drift_drake.logs.driving import slowest
from drift_drake.logs.table import COLUMNS, InvalidLogError, Run, make_run, read_columns
from drift_drake.sensing.sensors import NoiseLevels
from drift_drake.simulation.drive import LOG_PERIOD, Drive, DriveLimits
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.vehicle.plausible import check_effects, check_plausible


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
    columns = {name: table[name].to_numpy(dtype=float) for name in COLUMNS}
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
