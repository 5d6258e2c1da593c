"""`drift-drake simulate`: a simulated car's log, from a manoeuvre by name or from the commands of another log."""

import dataclasses
import logging
from pathlib import Path

import numpy as np
import tyro

from drift_drake.drives.manoeuvres import MANOEUVRES, Manoeuvre, logged
from drift_drake.errors import InvalidOptionError
from drift_drake.logs.driving import slowest
from drift_drake.logs.table import COLUMNS, InvalidLogError, Run, make_run, read_columns, write_run
from drift_drake.run_folder import to_json
from drift_drake.safe_files import try_outputs
from drift_drake.simulation.drive import LOG_PERIOD, Drive, DriveLimits
from drift_drake.simulation.sensors import NoiseLevels
from drift_drake.standard_output import said_to, write_text
from drift_drake.vehicle.effects import Effects, magnitudes_of
from drift_drake.vehicle.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.vehicle.plausible import check_effects, check_plausible
from drift_drake.vehicle.vehicle_file import read_vehicle

COMMANDS = ("t", "delta_cmd", "tau_cmd")
FASTEST = 100.0  # [m/s]
LONGEST = 3600.0  # [s]
MOST_NOISE = 1000.0
STEERED = ("step_steer", "slalom")  # manoeuvres by --steering


@dataclasses.dataclass(frozen=True)
class Simulate:
    """Drive a vehicle file, effects and all, and write the log that its sensors would.

    drift-drake simulate slalom --vehicle car.yaml --out logs/run_0.csv --seed 3

    drift-drake simulate logs/monday/run_0.csv --vehicle corrected.yaml --out again.csv

    Manoeuvres: straight (accelerating), step_steer, slalom, figure_8 and loops (drifts, under model predictive control
    that knows the vehicle file but not its effects). A log, or any CSV with t, delta_cmd and tau_cmd, drives by its
    commands.
    """

    drive: tyro.conf.Positional[str]
    """Name of a manoeuvre, or path of a log."""
    vehicle: Path
    """The car to drive (YAML); `effects:` in it act too."""
    out: Path
    """Where to write the log (CSV, or .csv.gz)."""
    seed: int = 0
    """Of the sensors' noise."""
    noise: float = 1.0
    """The sensors' noise, in times that of a good inertial system; 0: none."""
    duration: float | None = None
    """Seconds to drive; the manoeuvre's own without."""
    speed: float = 12.0
    """[m/s] at the start (the log's own, or the drift's, for those)."""
    steering: float = 0.12
    """[rad] of step_steer and slalom."""
    json: Path | None = None
    """Where to write what was driven (-: standard output)."""


def run_simulate(command: Simulate) -> None:
    """`drift-drake simulate`.

    Raises:
        InvalidLogError, InvalidVehicleError: names the file, the place and the mend.
        InvalidOptionError: a number is out of range.
    """
    logging.getLogger("drake").setLevel(logging.WARNING)
    parameters, effects = read_vehicle(command.vehicle)
    source = [] if command.drive in MANOEUVRES else [command.drive]
    try_outputs({"--out": command.out, "--json": command.json}, [command.vehicle, *source])
    run, ending = simulate(command, parameters, effects)
    write_run(run, command.out)
    end = "as planned" if ending == "time" else f"early: {ending}"
    beta = np.zeros(1) if run.beta is None else run.beta
    print(f"{command.out}: {command.drive}, {run.t[-1]:.2f} s, ended {end}; {np.min(run.v):.1f} to {np.max(run.v):.1f} "
          f"m/s, sideslip up to {np.max(np.abs(beta)):.2f} rad", file=said_to(command.json))  # fmt: skip
    if command.json is not None:
        driven = {"command": command, "effects": magnitudes_of(effects), "ending": ending, "rows": len(run)}
        write_text(command.json, to_json(driven))


def simulate(command: Simulate, parameters: VehicleParameters, effects: Effects) -> tuple[Run, str]:
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
    drive = Drive(parameters, m.driver, m.steps, m.spacing, np.zeros((2, 2)), m.command, effects, m.reference, noise)
    limits = DriveLimits(min_speed=slowest(parameters), max_speed=FASTEST)
    table, ending = drive.run(m.state, 0.0, command.duration or m.duration, command.seed, limits)
    table["t"] = LOG_PERIOD * np.round(table["t"] / LOG_PERIOD)
    columns = {name: table[name].to_numpy(dtype=float) for name in COLUMNS}
    try:
        return make_run(command.out, columns), ending
    except InvalidLogError as error:
        raise InvalidLogError(f"{error} (the drive ended after {table['t'].iloc[-1]:.2f} s: {ending})") from None


def check_options(command: Simulate, parameters: VehicleParameters) -> None:
    """Sees that the numbers of a command can be driven.

    Raises:
        InvalidOptionError: names the option and its range.
    """
    if command.seed < 0:
        raise InvalidOptionError(f"--seed {command.seed}: give 0 or more")
    if not 0.0 <= command.noise <= MOST_NOISE:
        raise InvalidOptionError(f"--noise {command.noise:g}: give 0 or more, up to {MOST_NOISE:g}")
    low = slowest(parameters)
    if not low <= command.speed <= FASTEST:
        raise InvalidOptionError(f"--speed {command.speed:g}: give {low:.2g} to {FASTEST:g} m/s for this car")
    if command.duration is not None and not 0.0 < command.duration <= LONGEST:
        raise InvalidOptionError(f"--duration {command.duration:g}: give seconds above 0, up to {LONGEST:g}")
    if command.drive in STEERED and not abs(command.steering) <= parameters.steering_limit:
        raise InvalidOptionError(
            f"--steering {command.steering:g}: give an angle within the vehicle's {parameters.steering_limit:g} rad"
        )


def _manoeuvre(command: Simulate, parameters: VehicleParameters, effects: Effects) -> Manoeuvre:
    if command.drive in MANOEUVRES:
        try:
            return MANOEUVRES[command.drive](parameters, command.speed, command.steering)
        except ValueError as error:
            raise InvalidVehicleError(f"{command.vehicle}: this car cannot drive {command.drive}: {error}") from None
    path = Path(command.drive)
    if not path.exists():
        raise InvalidLogError(f"{path}: no such file or manoeuvre; give a log or one of {', '.join(MANOEUVRES)}")
    columns = read_columns(path)
    missing = [name for name in COMMANDS if name not in columns]
    if missing:
        raise InvalidLogError(f"{path}: missing column {', '.join(missing)}; driving needs {', '.join(COMMANDS)}")
    rows = len(columns["t"])
    columns.setdefault("r", np.zeros(rows))
    columns.setdefault("v", np.full(rows, command.speed))
    return logged(make_run(path, columns), parameters, effects)
