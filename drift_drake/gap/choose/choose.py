"""Which model may drive a car at its limits: the function behind `drift-drake choose`."""

from pathlib import Path

from drift_drake.car.car_file import plant_of
from drift_drake.car.given_vehicle import Vehicle, vehicle_given
from drift_drake.car.log.given import Logs, logs_given
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.standard_output import Progress
from drift_drake.gap.choose.choice import Choice, ask
from drift_drake.gap.choose.usable_drives import check_drives


def choose(logs: Logs, vehicle: Vehicle | None = None, *, progress: Progress | None = None) -> Choice:
    """Says which model may drive a car at its limits, by its logs: the car that they identify, or the learnt one.

    Examples:
        >>> found = choose("logs/monday", "car.yaml")  # doctest: +SKIP
        >>> print(found.believed, found.sentence())  # doctest: +SKIP

    Args:
        logs: path of a case folder or of a run's file, or runs at 100 Hz, with torque, sideslip and rim speed;
        vehicle: vehicle file's path or parameters: a first guess, whose effects are identified anew; the shipped
            coupe's without;
        progress: called with a stage and the share done.

    Raises:
        InvalidLogError: a run cannot be asked; InvalidVehicleError: of the vehicle.
    """
    given = logs_given(logs)
    first_guess = VehicleParameters() if vehicle is None else plant_of(vehicle_given(vehicle).parameters)
    check_drives(given.runs, logs if isinstance(logs, str | Path) else given.case)
    return ask(given.runs, first_guess, progress)
