"""The T-optimal cost: exact gradients, the rival fitted anew, plans that tell two cars apart better than a straight."""

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.drive.mpc.discrimination import (
    CarHypothesis,
    DiscriminationCost,
    Rival,
    RivalsStepModel,
    gains_and_biases,
)

VEHICLE = VehicleParameters()
DEVIATION = np.array([0.002, 0.02, 0.002, 0.05])
ALPHA = 3.0
SCALE = np.concatenate([[1.0, 10.0, 0.5, 10.0, 1.0, 0.5], np.tile([0.3, 100.0, 0.3, 0.3, 1.0, 1.0, 5.0, 5.0], 2)])
INPUTS = np.array([0.3, 100.0, 0.3, 100.0])


def car_of(name: str, magnitude: float) -> CarHypothesis:
    effects = Effects(**{name: magnitude})
    biased = name in ("gyro_bias", "sideslip_bias", "wheel_radius_error")
    return CarHypothesis(VEHICLE.constants(), Effects() if biased else effects, effects)


def rival_of(name: str, magnitude: float, deviation: float) -> Rival:
    return Rival(
        lambda theta: car_of(name, float(theta[0])), np.array([magnitude]), np.array([[deviation**-2]]),
        np.array([1e-4]), np.array([-10.0]), np.array([10.0]),
    )  # fmt: skip


def cost_of(first: CarHypothesis, rival: Rival) -> DiscriminationCost:
    other = rival.car(rival.theta)
    (gain, bias), (other_gain, other_bias) = gains_and_biases(first.sensors), gains_and_biases(other.sensors)
    models = [EffectsStepModel(VEHICLE, car.effects).of_car(car.constants, car.effects) for car in (first, other)]
    model = RivalsStepModel(models[0], models[1], gain / other_gain, (bias - other_bias) / other_gain)
    return DiscriminationCost(model, first, rival, DEVIATION, ALPHA)


def stages(count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = np.zeros((count, 22))
    x[:, :6] = np.array([0.0, 12.0, 0.0, 12.5, 0.0, 0.0]) + rng.normal(size=(count, 6)) * [
        0.2,
        2.0,
        0.05,
        2.0,
        0.5,
        0.1,
    ]
    x[:, [6, 8, 9, 14, 16, 17]] = rng.normal(size=(count, 6)) * 0.1
    x[:, [7, 15]] = 100.0
    u = np.array([0.0, 120.0]) + rng.normal(size=(count + 1, 2)) * [0.1, 60.0]
    return x, u[:-1], u[1:]


def test_the_hypothesis_itself_is_no_rival() -> None:
    assert cost_of(car_of("aero_drag", 1.0), rival_of("aero_drag", 1.0, 0.1)).nats(*stages(5, 0)) < 1e-9


def test_a_rival_may_fit_its_magnitude_anew() -> None:
    held, free = (cost_of(car_of("aero_drag", 1.0), rival_of("aero_drag", 0.8, d)) for d in (1e-6, 10.0))
    assert held.nats(*stages(5, 0)) > 0.01
    assert free.nats(*stages(5, 0)) < 1e-3


@pytest.mark.parametrize(
    ("first", "rival"),
    [
        (("steering_lag", 0.08), ("yaw_inertia_error", 0.2)),
        (("friction_level", -0.1), ("steering_lag", 0.1)),
        (("gyro_bias", 0.03), ("wheel_radius_error", 0.02)),
    ],
)
def test_the_gradient_is_that_of_the_value(first: tuple[str, float], rival: tuple[str, float]) -> None:
    objective = cost_of(car_of(*first), rival_of(*rival, 1e-3))
    x, u, u_next = stages(3, 2)
    gradient = objective.expansion(x, u, u_next).gradient()
    point, scale = np.concatenate([x, u, u_next], axis=1), np.concatenate([SCALE, INPUTS])
    numeric = np.zeros_like(gradient)
    for k in range(3):
        for j in range(26):
            values = []
            for sign in (1.0, -1.0):
                moved = point.copy()
                moved[k, j] += sign * 1e-5 * scale[j]
                values.append(objective.value(moved[:, :22], moved[:, 22:24], moved[:, 24:]))
            numeric[k, j] = (values[0] - values[1]) / 2e-5
    # The rival's fit stops near its minimum, not at it.
    np.testing.assert_allclose(gradient * scale, numeric, rtol=0.02, atol=0.02 * np.abs(numeric).max())


def test_the_step_models_jacobian_is_exact() -> None:
    objective = cost_of(car_of("gyro_bias", 0.03), rival_of("tyre_relaxation", 0.5, 0.1))
    model, (x, u, u_next) = objective._model, stages(2, 3)
    x_next, a, b, b_next = model.linearize(x, u, u_next, np.zeros(2))
    np.testing.assert_allclose(x_next, model.step(x, u, u_next, np.zeros(2)))
    jacobian, point = np.concatenate([a, b, b_next], axis=2), np.concatenate([x, u, u_next], axis=1)
    for j in range(26):
        step = 1e-6 * np.concatenate([SCALE, INPUTS])[j]
        ahead, behind = point.copy(), point.copy()
        ahead[:, j] += step
        behind[:, j] -= step
        ends = [model.step(p[:, :22], p[:, 22:24], p[:, 24:], np.zeros(2)) for p in (ahead, behind)]
        np.testing.assert_allclose(jacobian[:, :, j], (ends[0] - ends[1]) / (2 * step), rtol=1e-4, atol=1e-5)
