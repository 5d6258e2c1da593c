"""Drives during which the car becomes another one: of the nominal equations and of the double-track car."""

import dataclasses
from typing import Any

import numpy as np

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects, combined
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from experiments.benchmarks.compiled_cases import NOISE, drive_rows, sensed
from experiments.benchmarks.drivers import PERIOD, SLOWEST, SPIN, Driver
from experiments.benchmarks.rows import advance, by_rows, logged, start
from experiments.benchmarks.strange_effects import make_strange
from experiments.benchmarks.truths import true_constants
from experiments.other_worlds.drivers import DayDriver


def changed_drive(
    kind: str, effects: Effects, onset: float, seed: int, duration: float = 20.0,
    vehicle: VehicleParameters | None = None, deviations: dict[str, float] | None = None, until: float = np.inf,
) -> Run:  # fmt: skip
    """A drive of the nominal car that has `effects` on its motion from `onset` [s] on, and no more `until` [s].

    It ends early where the car spins.

    Args:
        kind: of `drivers.MANOEUVRES`; deviations: of the car from the vehicle, within its tolerances.
    """
    vehicle = vehicle or VehicleParameters()
    driver = Driver(kind, np.random.default_rng([seed, 0]), vehicle)
    constants, offset = true_constants(vehicle, deviations or {})
    nominal, change = Effects(steering_offset=offset), round(onset / PERIOD)
    changed = combined(nominal, effects)
    motion = drive_rows(driver, constants, lambda row: changed if change <= row < until / PERIOD else nominal,
                    make_strange({}), duration, settles_at=change)  # fmt: skip
    return sensed_across(*motion, changed, onset, seed)


def changed_double_track_drive(
    kind: str, effects: Effects, onset: float, seed: int, duration: float = 20.0, car: str = "coupe"
) -> Run:
    """The same of a double-track car (`CARS`); `kind`: of `drivers.DAY_ONE` or `drivers.OTHER`."""
    parameters = CARS[car]
    driver, p = DayDriver(kind, np.random.default_rng([seed, 0]), parameters), parameters.constants()
    change, resting, nominal = round(onset / PERIOD), (0.0, 0.0), Effects()

    def advanced(z: np.ndarray, row: int, delta: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if row == change:  # actuators that begin to lag do so from the commands
            z = np.concatenate([z[:5], [delta[row], tau[row]], z[7:]])
        return advance(z, row, delta, tau, p, effects if row >= change else nominal)

    motion = by_rows(start(driver.start(), resting, p, nominal), resting, duration, driver.command, advanced,
                     lambda _, z: abs(z[2]) > SPIN or z[1] < SLOWEST, with_end=False)  # fmt: skip
    return sensed_across(*logged(motion), effects, onset, seed)


def sensed_across(
    states: np.ndarray, accelerations: np.ndarray, delta: np.ndarray, tau: np.ndarray, effects: Effects, onset: float,
    seed: int,
) -> Run:  # fmt: skip
    """What sensors log of true states that get `effects` at `onset` [s]: the same noise before and after."""
    runs = [sensed(states, accelerations, delta, tau, q, np.random.default_rng([seed, 1]), "run_0")
            for q in (Effects(), effects)]  # fmt: skip
    late = runs[0].t >= onset
    before, after = ({name: np.asarray(run.column(name)) for name in NOISE} for run in runs)
    columns: dict[str, Any] = {name: np.where(late, after[name], before[name]) for name in NOISE}
    return dataclasses.replace(runs[0], **columns)
