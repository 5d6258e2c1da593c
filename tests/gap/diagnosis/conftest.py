"""Other days of the calibrated double-track car, diagnosed once."""

import dataclasses

import numpy as np
import pytest

from drift_drake.gap.diagnosis.calibrated.diagnose_change import diagnose_change, search_of
from drift_drake.gap.estimation.usable import admit

CONSIDERED = (
    "friction_level",
    "rear_stiffness_error",
    "mass_error",
    "steering_delay",
    "torque_gain_error",
    "gyro_bias",
)


@pytest.fixture(scope="session")
def diagnosed(other_car):
    """A function: runs of a later day to their diagnosis, with few effects considered.

    lost: blocks of its baseline whose predictions are taken to have been lost, in one stretch.
    """

    def diagnosis(runs, case="day", catalogue=CONSIDERED, lost=0):
        normal = other_car.normal
        if lost:
            counts = np.array([[normal.blocks - lost - 1, 1], [1, lost - 1]])
            normal = dataclasses.replace(normal, lost=counts)
        car = other_car.found
        return diagnose_change(runs, car.vehicle, normal, car.effects, case, 1, catalogue=catalogue)

    return diagnosis


@pytest.fixture(scope="session")
def searched(other_car):
    """A function: runs of a later day to the search for causes among these effects, of which no answer is made."""

    def search(runs, catalogue):
        car = other_car.found
        return search_of(admit(runs, car.vehicle).runs, car.vehicle, other_car.normal, car.effects, catalogue, "day", 1)

    return search


@pytest.fixture(scope="session")
def late_day(other_car, diagnosed):
    """A day whose steering is late by 0.08 s."""
    return diagnosed(other_car.day({"steering_delay": 0.08}, 1), "late")


@pytest.fixture(scope="session")
def plain_day(other_car, diagnosed):
    """The day of calibration without its first run."""
    return diagnosed(other_car.runs[1:], "plain")


@pytest.fixture(scope="session")
def strange_day(other_car, diagnosed):
    """Half a day whose yaw rate is logged in another unit, which no effect of the catalogue is."""
    runs = [dataclasses.replace(run, r=1.4 * run.r) for run in other_car.day({}, 2)[:2]]
    return diagnosed(runs, "strange")
