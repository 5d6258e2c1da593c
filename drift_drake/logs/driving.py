"""Which rows of a run a single-track car can be asked about: not those of a spin, of reversing, nor of standstill."""

import numpy as np

from drift_drake.logs.table import Run
from drift_drake.vehicle.parameters import VehicleParameters

SLOWEST = 0.6  # [1] speed in sqrt(g wheelbase) below which slips have no meaning
SPUN = 1.1  # [rad] of sideslip beyond which the car has spun, or reverses
BACKWARDS = 0.6  # [rad] from straight backwards within which the car may be reversing
TIGHTEST = 1.5  # times the yaw rate of the tightest turn that the steering allows: more is a spin
SUSTAINED = 0.3  # [s] of reversing; a spin is faster through


def slowest(vehicle: VehicleParameters) -> float:
    """Speed [m/s] below which a car of this size counts as standing."""
    wheelbase = vehicle.front_axle_distance + vehicle.rear_axle_distance
    return float(SLOWEST * np.sqrt(vehicle.gravity * wheelbase))


def driven(run: Run, vehicle: VehicleParameters) -> np.ndarray:
    """Rows [rows] (bool) in which the car goes forwards: it neither stands nor spins nor reverses.

    Without `beta`, spins and reversing cannot be seen.
    """
    rows: np.ndarray = run.v >= slowest(vehicle)
    return rows if run.beta is None else rows & (np.abs(run.beta) <= SPUN)


def reversing(run: Run, vehicle: VehicleParameters) -> np.ndarray:
    """Rows [rows] (bool) in which the car reverses: it moves backwards along its body and turns no more than it steers.

    Whole stretches of sideslip beyond `SPUN`, of which most is reversing: what leads there is part of it.
    """
    rows = np.zeros(len(run), dtype=np.bool_)
    if run.beta is None:
        return rows
    wheelbase = vehicle.front_axle_distance + vehicle.rear_axle_distance
    turn = TIGHTEST * run.v * np.tan(vehicle.steering_limit) / wheelbase
    backwards = (np.abs(run.beta) > np.pi - BACKWARDS) & (np.abs(run.r) <= turn)
    for a, b in spans((np.abs(run.beta) > SPUN) & (run.v >= slowest(vehicle))):
        if 2 * np.count_nonzero(backwards[a:b]) > b - a >= SUSTAINED / run.period:
            rows[a:b] = True
    return rows


def spans(rows: np.ndarray) -> list[tuple[int, int]]:
    """Start and stop of each stretch of rows [rows] (bool) that hold."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
