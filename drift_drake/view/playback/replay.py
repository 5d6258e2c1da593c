"""A log played with simulated cars: the function behind `drift-drake replay`."""

import dataclasses
from pathlib import Path

from drift_drake.car.given_vehicle import Vehicle, vehicle_given
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.view.playback.play import Comparison, compare, describe, prepare, write_replay
from drift_drake.view.playback.side_by_side import CarModel, Played


@dataclasses.dataclass(frozen=True)
class Replayed:
    """What the cars did (`played.cars`: a table by car) and how far off it is (`comparison.rms`, by state and car)."""

    name: str
    played: Played
    comparison: Comparison
    restart: float  # [s]
    vehicle: VehicleParameters

    def sentence(self) -> str:
        """The errors in words, a line each."""
        return describe(self.name, self.comparison, self.restart)

    def write(self, path: str | Path) -> None:
        """Writes the 3D replay: one HTML file that any browser plays."""
        write_replay(self.played, Path(path), self.name, self.restart, self.vehicle)


def replay(log: str | Path | Run, vehicle: Vehicle, corrected: Vehicle | None = None, *,
           restart: float = 1.0) -> Replayed:  # fmt: skip
    """Plays a log's commands to the simulator's car, and to the corrected one, next to the real car.

    Examples:
        >>> played = replay("logs/monday/run_0.csv", "car.yaml", (car, {"steering_lag": 0.1}))
        >>> played.write("replay.html")  # doctest: +SKIP

    Args:
        log: a run's file, or a run; vehicle, corrected: vehicle files' paths, parameters, or (parameters, effects);
        restart: seconds [s] after which the simulated cars are put back onto the real one, over and over; 0: never.

    Raises:
        InvalidLogError: the log cannot be played; InvalidVehicleError: of a vehicle.
    """
    cars = {"nominal": vehicle} | ({} if corrected is None else {"corrected": corrected})
    given = {name: vehicle_given(car) for name, car in cars.items()}
    played = prepare(log, {name: CarModel(car.parameters, car.effects) for name, car in given.items()}).run(restart)
    name = log.name if isinstance(log, Run) else Path(log).name
    return Replayed(name, played, compare(played), restart, given["nominal"].parameters.single_track())
