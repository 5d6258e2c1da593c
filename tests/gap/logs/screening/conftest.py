"""Simulated cases that are good logs, made once."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth, drawn_deviations

VEHICLE = VehicleParameters()
# At the ends of their ranges: what is most like another unit, a wrong clock, a bad sample or another car.
TRUTHS = {
    "nominal": {},
    "weak": {"torque_gain_error": -0.3, "mass_error": 0.2},
    "late": {"steering_delay": 0.15, "sensor_latency": 0.12},
    "slow to steer": {"steering_rate_limit": 0.3, "torque_lag": 0.4},
    "biased": {"gyro_bias": 0.04, "wheel_radius_error": 0.05},
    "slippery": {"friction_level": -0.35, "sliding_friction_drop": 0.35},
    "uphill": {"road_grade": 0.06, "aero_drag": 2.5},
}


@pytest.fixture(scope="session")
def good_cases():
    """Runs of twelve seconds by cars with strong effects."""
    cases = {}
    for seed, (name, effects) in enumerate(TRUTHS.items()):
        rng = np.random.default_rng(seed)
        cases[name] = make_case(Truth(effects, {}, drawn_deviations(rng, VEHICLE.tolerance)), VEHICLE, rng)
    return cases


@pytest.fixture(scope="session")
def case(good_cases):
    """One of them: slalom, power, transients, drift."""
    return good_cases["weak"]
