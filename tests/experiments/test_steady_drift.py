"""Steady drifts of one-step models, and the response to inputs there."""

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.reference.equilibrium import drift_equilibrium
from experiments.drifting.steady_drift import INPUT_STEP, RADIUS, SIDESLIP, STEPS, report, steady_drift

PARAMETERS = VehicleParameters()
START = drift_equilibrium(PARAMETERS, RADIUS, -SIDESLIP)


def test_the_nominal_cars_is_the_references() -> None:
    found = steady_drift(NominalStepModel(PARAMETERS), START)
    assert found.residual < 1e-6
    assert (found.v, found.omega_r, found.delta, found.tau) == pytest.approx(
        (START.v, START.omega_r, START.delta, START.tau), rel=1e-5
    )


def test_the_response_is_that_of_a_rollout() -> None:
    model = NominalStepModel(PARAMETERS)
    x = np.array([[START.r, START.v, START.beta, START.omega_r, 0.0, 0.0]])
    small = 1e-4
    for column, name in ((0, "yaw_rate_by_steering"), (1, "yaw_rate_by_torque")):
        u = np.array([[START.delta, START.tau]])
        u[0, column] += small * INPUT_STEP[column]
        driven = x
        for _ in range(STEPS):
            driven = model.step(driven, u, u, np.array([START.curvature]))
        expected = (driven[0, 0] - START.r) / small
        assert getattr(steady_drift(model, START), name) == pytest.approx(expected, rel=1e-2)


def test_a_cars_own_states_are_steady_too() -> None:
    """Less friction: slower, and lags that hold what is commanded."""
    effects = make_effects({"friction_level": -0.1, "steering_lag": 0.05, "torque_lag": 0.1, "tyre_relaxation": 0.3})
    found = steady_drift(EffectsStepModel(PARAMETERS, effects), START)
    assert found.residual < 1e-6
    assert found.v == pytest.approx(START.v * np.sqrt(0.9), rel=0.02)


def test_a_state_that_is_none_is_counted_and_left_out() -> None:
    state = steady_drift(NominalStepModel(PARAMETERS), START)
    rows = [{"model": "true", "vehicle": 0} | state._asdict(),
            {"model": "true", "vehicle": 1} | state._replace(residual=0.1, delta=9.0)._asdict()]  # fmt: skip
    text = report(pd.DataFrame(rows))
    assert "| 1 of 2 |" in text
    assert "9" not in text.splitlines()[-1].split("|")[3]
