"""`drift-drake replay`: a log beside what the simulator makes of its commands."""

import dataclasses
import logging
import math
from pathlib import Path

import tyro

from drift_drake.logs.table import InvalidLogError, read_run
from drift_drake.playback.comparison import Comparison, compare, drawn
from drift_drake.playback.side_by_side import CarModel, Played, SideBySide
from drift_drake.run_folder import to_json
from drift_drake.safe_files import try_outputs
from drift_drake.standard_output import said_to, write_text
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.vehicle_file import read_vehicle


@dataclasses.dataclass(frozen=True)
class Replay:
    """Play a log's commands to the simulator's car and to the corrected one, and watch both beside the real car.

    drift-drake replay logs/monday/run_0.csv --vehicle car.yaml --corrected corrected.yaml --html replay.html
    """

    log: tyro.conf.Positional[Path]
    """One run in the log format (CSV, .csv.gz or Parquet)."""
    vehicle: Path
    """What the simulator believes of the car (YAML)."""
    corrected: Path | None = None
    """The corrected vehicle, as `drift-drake apply` writes it."""
    restart: float = 1.0
    """Seconds after which the simulated cars are put back onto the real one, over and over; 0: never."""
    html: Path | None = None
    """Where to write the 3D replay: one HTML file that any browser plays."""
    json: Path | None = None
    """Where to write the errors (-: standard output)."""


def run_replay(command: Replay) -> None:
    """`drift-drake replay`.

    Raises:
        InvalidLogError, InvalidVehicleError: names the file, the place and the mend.
    """
    cars = read_cars(command.vehicle, command.corrected)
    others = [command.corrected] if command.corrected is not None else []
    try_outputs({"--html": command.html, "--json": command.json}, [command.log, command.vehicle, *others])
    played = play(prepare(command.log, cars), command.restart)
    comparison = compare(played)
    print(describe(command.log.name, comparison, command.restart), file=said_to(command.json))
    if command.json is not None:
        errors = {"log": command.log, "restart": command.restart} | comparison.to_dict()
        write_text(command.json, to_json(errors))
    if command.html is not None:
        write_replay(played, command.html, command.log.name, command.restart, cars["nominal"].parameters)
        print(f"{command.html}: open it in a browser", file=said_to(command.json))


def read_cars(vehicle: Path, corrected: Path | None) -> dict[str, CarModel]:
    """The nominal car and, if there is one, the corrected car.

    Raises:
        InvalidVehicleError: names the file, the key and the mend.
    """
    cars = {"nominal": CarModel(*read_vehicle(vehicle))}
    if corrected is not None:
        cars["corrected"] = CarModel(*read_vehicle(corrected))
    return cars


def prepare(log: Path, cars: dict[str, CarModel]) -> SideBySide:
    """The diagram for a log.

    Raises:
        InvalidLogError: names the file, the place and the mend.
    """
    run = read_run(log)
    try:
        return SideBySide(run, cars)
    except InvalidLogError as error:
        raise InvalidLogError(f"{log}: {str(error).removeprefix(run.name + ': ')}") from None


def play(prepared: SideBySide, restart: float) -> Played:
    """Drives the cars (see `SideBySide.run`).

    Raises:
        InvalidLogError: a restart that is no time.
    """
    if not 0.0 <= restart < math.inf:
        raise InvalidLogError(f"--restart is {restart:g}; give seconds between restarts, or 0 for never")
    return prepared.run(restart)


def describe(name: str, comparison: Comparison, restart: float) -> str:
    """What the command prints."""
    every = f"restarted every {restart:g} s" if restart > 0.0 else "never restarted"
    lines = [f"{name}: {comparison.seconds:.1f} s of predictions, {every}", comparison.table()]
    for car, times in comparison.lost.items():
        if times:
            when = ", ".join(f"{t:.1f}" for t in times[:5]) + (", ..." if len(times) > 5 else "")
            lines.append(f"the {car} car spun or stopped at {when} s, and is left out from there to the next restart")
    return "\n".join([*lines, *comparison.remarks])


def write_replay(played: Played, path: Path, name: str, restart: float, vehicle: VehicleParameters) -> None:
    """Writes the 3D replay, with a note on what is seen."""
    from drift_drake.pictures.replay import replay  # matplotlib and Meshcat are slow to import

    logging.getLogger("drake").setLevel(logging.WARNING)  # not where Meshcat would listen meanwhile
    note = f"Simulated cars start from the real one every {restart:g} s." if restart > 0.0 else ""
    remarks = " ".join(f"{remark[0].upper()}{remark[1:]}." for remark in played.remarks)
    replay(drawn(played), path, parameters=vehicle, title=name, note=f"{note} {remarks}".strip(), camera="follow")
