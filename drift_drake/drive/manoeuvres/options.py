"""What a simulated drive is asked for; free of Drake, so that the command line can show it without."""

import dataclasses
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from drift_drake.car.log.driving import slowest
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import InvalidOptionError

Name = Literal["straight", "step_steer", "slalom", "steering_check", "figure_8", "loops"]
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

    Manoeuvres: straight (accelerating), step_steer, slalom, steering_check (slow; for 'choose --check'), figure_8 and
    loops (drifts, under model predictive control that knows the vehicle file but not its effects). A log, or any CSV
    with t, delta_cmd and tau_cmd, drives by its commands.
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
    """Factor on the sensors' noise, which is that of a good inertial system; 0: no noise."""
    duration: float | None = None
    """Seconds to drive; the manoeuvre's own without."""
    speed: float = 12.0
    """[m/s] at the start (the log's own, or the drift's, for those)."""
    steering: float = 0.12
    """[rad] of step_steer and slalom."""
    json: Path | None = None
    """Where to write what was driven, as JSON (-: standard output)."""


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
