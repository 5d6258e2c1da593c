"""One-step models against independent integration and finite differences."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import STATE_SIZE, EffectsStepModel
from drift_drake.car.single_track.motion import derivatives
from drift_drake.car.single_track.motion_with_effects import settled_internal_states
from drift_drake.car.step_model import NominalStepModel, StepModel

Array = NDArray[np.float64]

PARAMETERS = VehicleParameters()
X = np.array([[0.7, 12.7, -0.6, 17.5, 0.2, 0.05], [0.1, 15.0, 0.02, 15.3, -0.5, 0.1], [-0.5, 9.0, 0.3, 11.0, 0.0, 0.0]])
U = np.array([[-0.46, 168.0], [0.03, 60.0], [0.2, 120.0]])
U_NEXT = np.array([[-0.40, 190.0], [0.05, 20.0], [0.1, 150.0]])
CURVATURE = np.array([1.0 / 18.0, 0.0, -0.03])


def check_jacobians(model: StepModel, x: Array, tolerance: float = 1e-6) -> None:
    """Central differences of `step` are the Jacobians of `linearize`, and both give the same value."""
    value, *jacobians = model.linearize(x, U, U_NEXT, CURVATURE)
    np.testing.assert_allclose(value, model.step(x, U, U_NEXT, CURVATURE), rtol=0, atol=1e-12)
    arguments = [x, U, U_NEXT]
    for which, jacobian in enumerate(jacobians):
        for j in range(arguments[which].shape[1]):
            step = 1e-6 * max(1.0, np.abs(arguments[which][:, j]).max())
            shifted = [a.copy() for a in arguments]
            shifted[which][:, j] += step
            high = model.step(*shifted, CURVATURE)
            shifted[which][:, j] -= 2.0 * step
            low = model.step(*shifted, CURVATURE)
            np.testing.assert_allclose(jacobian[:, :, j], (high - low) / (2.0 * step), rtol=tolerance, atol=tolerance)


def test_nominal_step_agrees_with_an_adaptive_integrator() -> None:
    model = NominalStepModel(PARAMETERS)
    constants = PARAMETERS.constants()
    x_next = model.step(X, U, U_NEXT, CURVATURE)
    for i in range(len(X)):

        def rates(t: float, x: Array, i: int = i) -> Array:
            return derivatives(x, U[i] + t / 0.1 * (U_NEXT[i] - U[i]), CURVATURE[i], constants)

        exact = solve_ivp(rates, (0.0, 0.1), X[i], rtol=1e-10, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(x_next[i], exact, rtol=0, atol=2e-4)


def test_nominal_jacobians() -> None:
    check_jacobians(NominalStepModel(PARAMETERS), X)


def with_internal_states(effects: Effects) -> Array:
    constants = PARAMETERS.constants()
    internal = [settled_internal_states(*x[:4], *u, constants, effects) for x, u in zip(X, U, strict=True)]
    return np.concatenate([X, np.array(internal, dtype=float)], axis=1)


def test_effects_jacobians_and_carry_of_internal_states() -> None:
    effects = make_effects({
        "friction_level": -0.1, "steering_lag": 0.06, "torque_lag": 0.15, "tyre_relaxation": 0.4, "aero_drag": 1.0,
        "longitudinal_load_transfer": 0.45, "tyre_thermal_fade": 0.2})  # fmt: skip
    model = EffectsStepModel(PARAMETERS, effects)
    x = with_internal_states(effects)
    assert x.shape[1] == STATE_SIZE
    check_jacobians(model, x, 1e-5)
    # A ramp of 0.1 s seen through a lag of T: the road wheel ends T (1 - exp(-0.1 / T)) of the slope behind.
    lag = 0.06
    behind = (U_NEXT[:, 0] - U[:, 0]) / 0.1 * lag * (1.0 - np.exp(-0.1 / lag))
    np.testing.assert_allclose(model.step(x, U, U_NEXT, CURVATURE)[:, 6], U_NEXT[:, 0] - behind, rtol=0, atol=1e-5)


@pytest.mark.parametrize("drag", [0.0, 1e-12])
def test_effects_that_are_off_leave_the_nominal_step(drag: float) -> None:
    """By the constants alone, and by all equations at once, whose differences are then the exact Jacobians."""
    effects = Effects(aero_drag=drag)
    found = EffectsStepModel(PARAMETERS, effects).linearize(with_internal_states(effects), U, U_NEXT, CURVATURE)
    exact = NominalStepModel(PARAMETERS).linearize(X, U, U_NEXT, CURVATURE)
    np.testing.assert_allclose(found[0][:, :6], exact[0], rtol=0, atol=1e-12)
    for jacobian, wanted in zip(found[1:], exact[1:], strict=True):
        np.testing.assert_allclose(jacobian[:, :6, : wanted.shape[2]], wanted, rtol=0, atol=2e-6)


def test_states_without_the_models_own_are_refused() -> None:
    with pytest.raises(ValueError, match="give 14 columns: the six, then the model's own 8"):
        EffectsStepModel(PARAMETERS, make_effects({"aero_drag": 1.0})).step(X, U, U_NEXT, CURVATURE)


def test_many_stages_are_stepped_as_each_alone() -> None:
    """More than the numbers that are computed at once, and no multiple of them."""
    effects = make_effects({"steering_lag": 0.06, "aero_drag": 1.0})
    model, rng = EffectsStepModel(PARAMETERS, effects), np.random.default_rng(0)
    rows = rng.integers(0, len(X), 21)
    x, u, u_next, curvature = with_internal_states(effects)[rows], U[rows], U_NEXT[rows], CURVATURE[rows]
    x[:, 1] += rng.uniform(-1.0, 1.0, len(x))
    together = model.step(x, u, u_next, curvature)
    alone = [model.step(x[i : i + 1], u[i : i + 1], u_next[i : i + 1], curvature[i : i + 1])[0] for i in range(len(x))]
    np.testing.assert_array_equal(together, alone)


@pytest.mark.parametrize("name", ["steering_delay", "gyro_bias", "sensor_latency"])
def test_effects_beyond_a_one_step_model_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} cannot be part of a one-step model"):
        EffectsStepModel(PARAMETERS, make_effects({name: 0.03}))


class StepAlone(StepModel):
    """What a user's own model has to have."""

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        return NominalStepModel(PARAMETERS).step(x, u, u_next, curvature)


def test_a_model_that_only_steps_is_linearised_by_differences() -> None:
    exact = NominalStepModel(PARAMETERS).linearize(X, U, U_NEXT, CURVATURE)
    for found, wanted in zip(StepAlone().linearize(X, U, U_NEXT, CURVATURE), exact, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-5)
    assert StepAlone().observer(0.01) is None


@pytest.mark.parametrize("name", ["steering_lag", "torque_lag"])
def test_a_lag_of_half_a_millisecond_is_next_to_none(name: str) -> None:
    """Its settling asks for shorter steps than the car's own."""
    models = [EffectsStepModel(PARAMETERS, make_effects({name: lag, "aero_drag": 0.5})) for lag in (5e-4, 0.0)]
    ends = []
    for model in models:
        internal = [
            settled_internal_states(*x[:4], *u, model.constants, model.effects) for x, u in zip(X, U, strict=True)
        ]
        ends.append(model.step(np.concatenate([X, np.array(internal)], axis=1), U, U_NEXT, CURVATURE)[:, :6])
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=0.02)
