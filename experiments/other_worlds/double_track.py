"""One run of the package's double-track car as its sensors log it."""

import numpy as np

from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.double_track.plant import LOG_STATES, PERIOD, advance, start
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from experiments.benchmarks.compiled_cases import sensed
from experiments.other_worlds.drivers import SLOWEST, SPIN, DayDriver


def simulate(car: DoubleTrackParameters, effects: Effects, driver: DayDriver, rng: np.random.Generator, name: str,
             duration: float) -> Run:  # fmt: skip
    """One run as the car's sensors log it; the driver sees the true state."""
    rows, p = round(duration / PERIOD) + 1, car.constants()
    delta, tau = np.zeros(rows), np.zeros(rows)
    states, accelerations = np.zeros((rows, len(LOG_STATES))), np.zeros((rows, 2))
    states[0], accelerations[0] = start(driver.start(), (0.0, 0.0), p, effects)
    end = rows
    for row in range(rows - 1):
        z = states[row]
        delta[row + 1], tau[row + 1] = driver.command(row * PERIOD, z, (delta[row], tau[row]))
        states[row + 1], accelerations[row + 1] = advance(z, row, delta, tau, p, effects)
        if abs(states[row + 1, 2]) > SPIN or states[row + 1, 1] < SLOWEST:
            end = row + 2
            break
    return sensed(states[:end], accelerations[:end], delta[:end], tau[:end], effects, rng, name)
