"""One short drive of the simulator's car whose rear tyres become softer, and the monitor that watches it."""

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.monitoring.monitor import Monitor, make_monitor
from experiments.monitoring.drives import changed_drive

ONSET = 2.5


@pytest.fixture(scope="session")
def monitor() -> Monitor:
    return make_monitor(VehicleParameters())


@pytest.fixture(scope="session")
def changed_run() -> Run:
    effects = make_effects({"rear_stiffness_error": -0.25})
    return changed_drive("slalom", effects, ONSET, seed=4, duration=5.0)


@pytest.fixture(scope="session")
def commands(changed_run: Run) -> np.ndarray:
    return np.stack([changed_run.delta_cmd, np.asarray(changed_run.tau_cmd)], axis=1)
