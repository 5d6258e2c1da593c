"""`drift-drake simulate`: a simulated car's log, from a manoeuvre by name or from the commands of another log."""

import dataclasses
import logging
from pathlib import Path
from typing import Annotated, Literal, get_args

import numpy as np
import tyro

from drift_drake.errors import InvalidOptionError
from drift_drake.interruption import ended_at_once
from drift_drake.logs.driving import slowest
from drift_drake.logs.table import InvalidLogError, write_run
from drift_drake.safe_files import try_outputs
from drift_drake.standard_output import said_to, write_results
from drift_drake.vehicle.effects import magnitudes_of
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.vehicle_file import read_vehicle

Name = Literal["straight", "step_steer", "slalom", "figure_8", "loops"]
NAMES: tuple[Name, ...] = get_args(Name)


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

    drive: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="MANOEUVRE|LOG")]
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
    """Where to write what was driven, as JSON (-: standard output)."""


def run_simulate(command: Simulate) -> None:
    """`drift-drake simulate`.

    Raises:
        InvalidLogError, InvalidVehicleError: names the file, the place and the remedy.
        InvalidOptionError: a number is out of range.
    """
    parameters, effects = read_vehicle(command.vehicle)
    check_options(command, parameters)
    source = [] if command.drive in NAMES else [command.drive]
    if source and not Path(command.drive).exists():
        raise InvalidLogError(f"{command.drive}: no such file or manoeuvre; give a log or one of {', '.join(NAMES)}")
    try_outputs({"--out": command.out, "--json": command.json}, [command.vehicle, *source])
    with ended_at_once():
        from drift_drake.drives.simulate import simulate_drive

    logging.getLogger("drake").setLevel(logging.WARNING)
    run, ending = simulate_drive(command, parameters, effects)
    write_run(run, command.out)
    end = "as planned" if ending == "time" else f"early: {ending}"
    beta = np.zeros(1) if run.beta is None else run.beta
    print(f"{command.out}: {command.drive}, {run.t[-1]:.2f} s, ended {end}; {np.min(run.v):.1f} to {np.max(run.v):.1f} "
          f"m/s, sideslip up to {np.max(np.abs(beta)):.2f} rad", file=said_to(command.json))  # fmt: skip
    driven = {"command": command, "effects": magnitudes_of(effects), "ending": ending, "rows": len(run)}
    write_results(command.json, driven)


def check_options(command: Simulate, parameters: VehicleParameters) -> None:
    """Raises InvalidOptionError, which names the option and its range, where a command cannot be driven."""
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
