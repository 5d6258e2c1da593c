"""What the pages draw of runs and cars: timelines, coverage, limits, predictions. Slow: called in a thread."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from drift_drake.common.arrays import Array


class Driven(NamedTuple):
    """One run: its name, start and end [s], stretches that are used or not, and how it was driven.

    accelerations: ahead and to the left [m/s^2]; steering: speed [m/s] and command [rad]; each of equal length.
    """

    name: str
    start: float
    stop: float
    stretches: list[Any]
    accelerations: tuple[Array, Array]
    steering: tuple[Array, Array]


def driven(folder: Path, vehicle: Path) -> list[Driven]:
    """How a day's runs were driven, and which parts can be used of a car of that size.

    Raises:
        InvalidLogError, InvalidVehicleError: of the files.
    """
    from drift_drake.car.foreign.simulator_car import SimulatorCar
    from drift_drake.car.given_vehicle import vehicle_given
    from drift_drake.car.log.table import read_case
    from drift_drake.gap.estimation.usable import stretches

    runs = read_case(folder)
    car = vehicle_given(vehicle).parameters
    used = stretches(runs, car.single_track(), not isinstance(car, SimulatorCar))
    found = []
    for run, parts in zip(runs, used, strict=True):
        ahead = np.gradient(run.v, run.period) if run.ax is None else run.ax
        found.append(Driven(run.name, float(run.t[0]), float(run.t[-1]), parts, (ahead, run.v * run.r),
                            (run.v, run.delta_cmd)))  # fmt: skip
    return found


def limits(outlook: dict[str, list[float | None]], vehicle: Path) -> list[tuple[str, float | None, str]]:
    """Least magnitudes that a later day would show, as shares of the practical range: name, share, in words."""
    from drift_drake.car.effects.catalogue import CATALOGUE
    from drift_drake.car.given_vehicle import vehicle_given
    from drift_drake.gap.diagnosis.reports.report import limit_rows

    known = {name: {"least": after[0], "taken_for": ""} for name, after in outlook.items() if name in CATALOGUE}
    rows = limit_rows(known, vehicle_given(vehicle).parameters.single_track())
    return [(row.name, row.share if row.named else None, f"from {row.least}" if row.named else "never") for row in rows]


class Predicted(NamedTuple):
    """A run as measured and as cars predict it: by state the unit, and by car times and values [n]."""

    states: dict[str, tuple[str, dict[str, tuple[Array, Array]]]]
    sentence: str


def predicted(log: Path, vehicle: Path, corrected: Path) -> Predicted:
    """A run's commands played to two cars, put back onto the real one every second.

    Raises:
        InvalidLogError, InvalidVehicleError: of the files.
    """
    from drift_drake.view.playback.play import UNITS, drawn
    from drift_drake.view.playback.replay import replay

    played = replay(log, vehicle, corrected)
    tables = drawn(played.played)
    states = {}
    for state in ("r", "beta", "v", "omega_r"):
        cars = {car: (table["t"].to_numpy(float), table[state].to_numpy(float)) for car, table in tables.items()}
        if np.isfinite(cars["real"][1]).any():
            states[state] = UNITS[state], cars
    return Predicted(states, played.sentence())
