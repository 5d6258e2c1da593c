"""Which rows of a run a single-track car can be asked about: not those of a spin, nor of standstill."""

import numpy as np

from drift_drake.logs.table import Run
from drift_drake.vehicle.parameters import VehicleParameters

SLOWEST = 0.6  # [1] speed in sqrt(g wheelbase) below which slips have no meaning
SPUN = 1.1  # [rad] of sideslip beyond which the car has spun


def driven(run: Run, vehicle: VehicleParameters) -> np.ndarray:
    """Rows [rows] (bool) in which the car neither stands nor spins; without `beta`, spins cannot be seen."""
    wheelbase = vehicle.front_axle_distance + vehicle.rear_axle_distance
    rows: np.ndarray = run.v >= SLOWEST * np.sqrt(vehicle.gravity * wheelbase)
    return rows if run.beta is None else rows & (np.abs(run.beta) <= SPUN)
