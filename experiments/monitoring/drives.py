"""Drives during which the car becomes another one: of the nominal equations and of the double-track car."""

import dataclasses
from typing import Any

import numpy as np

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.double_track.plant import LOG_STATES, advance, start
from drift_drake.car.effects.magnitudes import Effects, combined
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from experiments.benchmarks.compiled_cases import NOISE, drive_rows, sensed
from experiments.benchmarks.drivers import PERIOD, SLOWEST, SPIN, Driver
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
    rows, nominal = round(duration / PERIOD) + 1, Effects()
    delta, tau = np.zeros(rows), np.zeros(rows)
    states, accelerations = np.zeros((rows, len(LOG_STATES))), np.zeros((rows, 2))
    states[0], accelerations[0] = start(driver.start(), (0.0, 0.0), p, nominal)
    end, change = rows, round(onset / PERIOD)
    for row in range(rows - 1):
        if row == change:
            states[row, 7:9] = delta[row], tau[row]
        z = states[row]
        delta[row + 1], tau[row + 1] = driver.command(row * PERIOD, z, (delta[row], tau[row]))
        now = effects if row >= change else nominal
        states[row + 1], accelerations[row + 1] = advance(z, row, delta, tau, p, now)
        if abs(states[row + 1, 2]) > SPIN or states[row + 1, 1] < SLOWEST:
            end = row + 1
            break
    return sensed_across(states[:end], accelerations[:end], delta[:end], tau[:end], effects, onset, seed)


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
