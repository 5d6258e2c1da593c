"""A log and vehicle files to what the simulated cars do beside the real one, in words and in 3D."""

import math
from pathlib import Path

from drift_drake.logs.table import InvalidLogError, read_run
from drift_drake.playback.comparison import Comparison, drawn
from drift_drake.playback.side_by_side import CarModel, Played, SideBySide
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.vehicle_file import read_vehicle


def read_cars(vehicle: Path, corrected: Path | None) -> dict[str, CarModel]:
    """The nominal car and, if there is one, the corrected car.

    Raises:
        InvalidVehicleError: names the file, the key and the remedy.
    """
    cars = {"nominal": CarModel(*read_vehicle(vehicle))}
    if corrected is not None:
        cars["corrected"] = CarModel(*read_vehicle(corrected))
    return cars


def prepare(log: Path, cars: dict[str, CarModel]) -> SideBySide:
    """The diagram for a log.

    Raises:
        InvalidLogError: names the file, the place and the remedy.
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

    note = f"Simulated cars start from the real one every {restart:g} s." if restart > 0.0 else ""
    remarks = " ".join(f"{remark[0].upper()}{remark[1:]}." for remark in played.remarks)
    replay(drawn(played), path, parameters=vehicle, title=name, note=f"{note} {remarks}".strip(), camera="follow")
