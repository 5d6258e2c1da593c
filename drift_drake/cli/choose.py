"""`drift-drake choose`: which model may drive a car at its limits, decided from its logs."""

import dataclasses
from pathlib import Path
from typing import Annotated

import tyro

from drift_drake.car.car_file import plant_of
from drift_drake.car.effects.magnitudes import magnitudes_of
from drift_drake.car.given_vehicle import vehicle_given
from drift_drake.car.log.cases import only_run
from drift_drake.car.log.table import read_case, run_paths
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.safe_files import try_outputs
from drift_drake.common.standard_output import progress_bar, said_to, write_results
from drift_drake.gap.choose.usable_drives import check_drives


@dataclasses.dataclass(frozen=True)
class Choose:
    """Say which model may drive a car at its limits, by its logs: the car that they identify, or the learnt one.

    drift-drake choose logs/monday --vehicle car.yaml --out identified.yaml
    """

    logs: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOGS")]
    """Run CSV, or case folder, of lively drives in which the tyres slide for a part of the time."""
    vehicle: Path | None = None
    """Vehicle file, a first guess; its effects are identified anew (without: the shipped coupe's)."""
    check: Path | None = None
    """Log of a slow drive that shows the limit of the steering's rate ('simulate steering_check')."""
    out: Path | None = None
    """Where to write the identified car, as a vehicle file that 'drive --model known' takes."""
    json: Path | None = None
    """Where to write the choice, as JSON (-: standard output)."""
    rehearse: bool = True
    """Whether the identified car is driven round the figure-8 in simulation (some 10 s): can this car be drifted?"""
    quiet: bool = False
    """No progress bar."""


def run_choose(command: Choose) -> None:
    given = None if command.vehicle is None else vehicle_given(command.vehicle).parameters
    inputs = [path for path in (command.vehicle, command.check, *run_paths(command.logs)) if path is not None]
    try_outputs({"--out": command.out, "--json": command.json}, inputs)
    check_drives(read_case(command.logs), command.logs)
    check = None if command.check is None else only_run(command.check, "--check")
    single = VehicleParameters() if given is None else plant_of(given).single_track()
    with ended_at_once():
        from drift_drake.drive.manoeuvres.steering_check import USUAL_STEERING, steering_of
        from drift_drake.gap.choose.choice import choose
        from drift_drake.gap.choose.rehearsal import rehearse

    steering = USUAL_STEERING
    if check is not None:
        steering = steering_of(check, single)
        print(f"{command.check}: {steering.sentence()}", file=said_to(command.json))
    with progress_bar(command.quiet) as show:
        choice = choose(command.logs, command.vehicle, progress=show, steering=steering)
    car, rehearsal = choice.found.car, None
    print(choice.sentence(), *choice.remarks, sep="\n", file=said_to(command.json))
    if command.rehearse:
        said = "not rehearsed: whether this car can be drifted is open"
        if car is not None:
            rehearsal = rehearse(car, single)
            said = rehearsal.sentence()
        print(said, file=said_to(command.json))
    if command.out is not None:
        said = "not written, since no car was identified: give some nine seconds of lively driving"
        if car is not None:
            write_vehicle(command.out, car.vehicle, car.effects)
            said = "the car that the logs identify"
        print(f"{command.out}: {said}", file=said_to(command.json))
    write_results(command.json, {
        "believed": choice.believed, "forecast_error": choice.found.error, "limit": choice.limit,
        "surprise": choice.found.surprise, "doubts": choice.found.doubts, "beyond": choice.beyond,
        "remarks": choice.remarks,
        "tracks": car and (1 if isinstance(car.vehicle, VehicleParameters) else 2),
        "vehicle": car and car.vehicle, "effects": car and magnitudes_of(car.effects),
        "rehearsal": rehearsal and rehearsal._asdict() | {"can": rehearsal.can},
    })  # fmt: skip
