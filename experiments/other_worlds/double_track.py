"""One run of the package's double-track car as its sensors log it."""

from functools import partial

import numpy as np

from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from experiments.benchmarks.compiled_cases import sensed
from experiments.benchmarks.rows import advance, by_rows, logged, start
from experiments.other_worlds.drivers import SLOWEST, SPIN, DayDriver


def simulate(car: DoubleTrackParameters, effects: Effects, driver: DayDriver, rng: np.random.Generator, name: str,
             duration: float) -> Run:  # fmt: skip
    """One run as the car's sensors log it; the driver sees the true state."""
    p, resting = car.constants(), (0.0, 0.0)
    motion = by_rows(
        start(driver.start(), resting, p, effects), resting, duration, driver.command,
        partial(advance, p=p, q=effects), lambda _, z: abs(z[2]) > SPIN or z[1] < SLOWEST,
    )  # fmt: skip
    return sensed(*logged(motion), effects, rng, name)
