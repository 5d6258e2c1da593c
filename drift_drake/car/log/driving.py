"""Which rows of a run a car's equations can be asked about: not those of a spin nor of standstill; reversing."""

import dataclasses
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from drift_drake.car.effects.record import wheelbase
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters

SLOWEST = 0.6  # [1] speed in sqrt(g wheelbase) below which slips have no meaning
EQUATIONS = 0.35  # [1] the same, below which the equations are not asked
FLOOR = 0.6  # [m/s] a little above the floor of their slips, which no car's size changes
SPUN = 1.1  # [rad] of sideslip beyond which the car has spun, or reverses
BACKWARDS = 0.6  # [rad] from straight backwards within which the car may be reversing
TIGHTEST = 1.5  # times the yaw rate of the tightest turn that the steering allows: more is a spin
SUSTAINED = 0.3  # [s] of reversing; a spin is faster through


class UsedStretch(NamedTuple):
    """A part of a run [s], and why it is not used; empty where it is."""

    start: float
    stop: float
    why: str

    def in_words(self) -> str:
        """When, and whether it is used."""
        return f"{self.start:.1f} to {self.stop:.1f} s {f'left out: {self.why}' if self.why else 'used'}"


def slowest(vehicle: VehicleParameters) -> float:
    """Speed [m/s] below which a car of this size counts as standing."""
    return float(SLOWEST * np.sqrt(vehicle.gravity * wheelbase(vehicle)))


def slowest_asked(vehicle: VehicleParameters) -> float:
    """Speed [m/s] below which the equations are not asked of a car of this size: a little above their slips' floor."""
    return max(float(EQUATIONS * np.sqrt(vehicle.gravity * wheelbase(vehicle))), FLOOR)


def driven(run: Run, vehicle: VehicleParameters) -> np.ndarray:
    """Rows [rows] (bool) in which the car goes forwards: it neither stands nor spins nor reverses.

    Without `beta`, spins and reversing cannot be seen.
    """
    rows: np.ndarray = run.v >= slowest_asked(vehicle)
    return rows if run.beta is None else rows & (np.abs(run.beta) <= SPUN)


def reversing(run: Run, vehicle: VehicleParameters) -> np.ndarray:
    """Rows [rows] (bool) in which the car reverses: it moves backwards along its body and turns no more than it steers.

    Whole stretches of sideslip beyond `SPUN`, of which most is reversing: what leads there is part of it.
    """
    if run.beta is None:
        return np.zeros(len(run), dtype=np.bool_)
    turn = TIGHTEST * run.v * np.tan(vehicle.steering_limit) / wheelbase(vehicle)
    backwards = (np.abs(run.beta) > np.pi - BACKWARDS) & (np.abs(run.r) <= turn)
    turned = spans((np.abs(run.beta) > SPUN) & (run.v >= slowest_asked(vehicle)))
    least = SUSTAINED / run.period
    return in_spans([(a, b) for a, b in turned if 2 * np.count_nonzero(backwards[a:b]) > b - a >= least], len(run))


def backing(run: Run, vehicle: VehicleParameters) -> np.ndarray:
    """Rows [rows] (bool) of `reversing` that the equations can be asked about: neither slow nor turned across."""
    if run.beta is None:
        return np.zeros(len(run), dtype=np.bool_)
    along = (run.v >= slowest_asked(vehicle)) & (np.abs(run.beta) >= np.pi - SPUN)
    return along & reversing(run, vehicle)


def turned_back(run: Run) -> Run:
    """A run that reverses throughout, as the equations take it: a negative speed and a small sideslip.

    A rim speed that is read without its sign gets that of the speed.
    """
    assert run.beta is not None
    beta = np.angle(-np.exp(1j * run.beta))
    omega_r = run.omega_r
    if omega_r is not None and np.median(omega_r) > 0.0:
        omega_r = -omega_r
    return dataclasses.replace(run, v=-run.v, beta=beta, omega_r=omega_r, trusted=(*run.trusted, "v"))


def in_spans(stretches: Iterable[tuple[int, int]], count: int) -> np.ndarray:
    """Which of `count` rows (bool) lie in one of the stretches, the inverse of `spans`."""
    rows = np.zeros(count, dtype=np.bool_)
    for start, stop in stretches:
        rows[start:stop] = True
    return rows


def spans(rows: np.ndarray) -> list[tuple[int, int]]:
    """Start and stop of each stretch of rows [rows] (bool) that hold."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
