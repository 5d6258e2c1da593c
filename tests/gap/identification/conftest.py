"""One short simulated car and its identification, made once."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.identification.identify import identify
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth, true_constants

TRUTH = Truth(
    {"steering_lag": 0.06},
    {},
    {"yaw_inertia": 0.2, "friction": -0.1, "rear_stiffness": -0.2, "front_axle_distance": 0.03, "torque": 0.05},
)


@pytest.fixture(scope="session")
def strange_car_runs():
    """Three seconds of each manoeuvre by a car that the default vehicle file describes badly."""
    return make_case(TRUTH, VehicleParameters(), np.random.default_rng(5), 3.0)


@pytest.fixture(scope="session")
def strange_car_truth():
    """Its parameters and effects by name."""
    return true_constants(VehicleParameters(), TRUTH.deviations)[0]._asdict() | TRUTH.effects


@pytest.fixture(scope="session")
def identified(strange_car_runs):
    effects = ("steering_lag", "aero_drag")
    return identify(strange_car_runs, VehicleParameters(), case="short", effects=effects, watching=False)
