"""Which rows of a run a single-track car can be asked about: not those of a spin, nor of standstill."""

import numpy as np

from drift_drake.logs.table import Run
from drift_drake.vehicle.parameters import VehicleParameters

SLOWEST = 0.6  # [1] speed in sqrt(g wheelbase) below which slips have no meaning
SPUN = 1.1  # [rad] of sideslip beyond which the car has spun


def slowest(vehicle: VehicleParameters) -> float:
    """Speed [m/s] below which a car of this size counts as standing."""
    wheelbase = vehicle.front_axle_distance + vehicle.rear_axle_distance
    return float(SLOWEST * np.sqrt(vehicle.gravity * wheelbase))


def driven(run: Run, vehicle: VehicleParameters) -> np.ndarray:
    """Rows [rows] (bool) in which the car neither stands nor spins; without `beta`, spins cannot be seen."""
    rows: np.ndarray = run.v >= slowest(vehicle)
    return rows if run.beta is None else rows & (np.abs(run.beta) <= SPUN)
