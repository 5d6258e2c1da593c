"""Short simulated cases for the tests of estimation and diagnosis, made once."""

import dataclasses
import signal
from pathlib import Path

import numpy as np
import pytest

from drift_drake.benchmarks.compiled_cases import make_case
from drift_drake.benchmarks.truths import Truth
from drift_drake.estimation.normal import Normal
from drift_drake.identification import identify as identification
from drift_drake.identification.calibration import Identification
from drift_drake.logs.table import Run
from drift_drake.vehicle.parameters import VehicleParameters
from experiments.other_worlds.days import Days, first_guess, make_day
from experiments.other_worlds.drivers import DAY_ONE

TRUE_STIFFNESS = -0.25
DURATION = 3.0
LONG_TO_MAKE = ("stiffness_case", "good_cases", "identified", "other_car")  # fixtures; the last one decides
OTHER_CAR = Days(Path(), car="coupe", seed=7, duration=8.0)


def pytest_configure():
    """Ctrl-C is heard by the tests and by what they start, in the background of a shell too, which ignores it there."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(tryfirst=True)  # before xdist reads the marks
def pytest_collection_modifyitems(items):
    """With --dist loadgroup one worker has all of a module, and of the modules that share what takes long to make."""
    groups = {item.path: name for item in items for name in LONG_TO_MAKE if name in item.fixturenames}
    for item in items:
        item.add_marker(pytest.mark.xdist_group(groups.get(item.path, str(item.path))))


@dataclasses.dataclass(frozen=True)
class OtherCar:
    """A car that no single-track model follows, calibrated on a short day."""

    runs: list[Run]  # of the day of calibration
    guess: VehicleParameters
    found: Identification

    @property
    def normal(self) -> Normal:
        assert self.found.calibration.normal is not None
        return self.found.calibration.normal

    def day(self, effects: dict[str, float], index: int) -> list[Run]:
        """Runs of another day of the same car with effects."""
        return make_day(OTHER_CAR, effects, DAY_ONE, index)


@pytest.fixture(scope="session")
def other_car():
    """Some parameters known, some effects left out: which is quick."""
    runs, guess = make_day(OTHER_CAR, {}, DAY_ONE, 0), first_guess(OTHER_CAR.car)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(identification, "FURTHER", ())
        found = identification.identify(
            runs, guess, case="short", names=("tyre_relaxation", "longitudinal_load_transfer"),
            known=("mass", "front_axle_distance", "rear_axle_inertia", "steering_offset"),
            tolerances=frozenset({"yaw_inertia", "torque"}),
        )  # fmt: skip
    return OtherCar(runs, guess, found)


@pytest.fixture(scope="session")
def stiffness_case():
    """Three seconds of each manoeuvre by a car with softer rear tyres and a torque map that is off."""
    truth = Truth({"rear_stiffness_error": TRUE_STIFFNESS}, {}, {"torque": 0.02, "mass": -0.01})
    return truth, make_case(truth, VehicleParameters(), np.random.default_rng(11), DURATION)
