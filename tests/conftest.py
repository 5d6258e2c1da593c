"""One short simulated case for the tests of estimation and diagnosis, made once."""

import numpy as np
import pytest

from drift_drake.vehicle.parameters import VehicleParameters
from experiments.gap_cases import Truth, make_case

TRUE_STIFFNESS = -0.25
DURATION = 3.0


@pytest.fixture(scope="session")
def stiffness_case():
    """Three seconds of each manoeuvre by a car with softer rear tyres and a torque map that is off."""
    truth = Truth({"rear_stiffness_error": TRUE_STIFFNESS}, {}, {"torque": 0.02, "mass": -0.01})
    return truth, make_case(truth, VehicleParameters(), np.random.default_rng(11), DURATION)
