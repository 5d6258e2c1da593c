"""The hybrid model: the identified car where nothing is learnt, and what it leaves over where something is."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.internal_states import RememberingStepModel
from drift_drake.car.known_car import known_car_model
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.step_model import StepModel
from drift_drake.drive.learnt.adapter import BayesianAdapter
from drift_drake.drive.learnt.bayesian_step import regression_points
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_varied
from drift_drake.drive.learnt.command_lag import lagged_commands
from drift_drake.drive.learnt.features import features
from drift_drake.drive.learnt.hybrid_step import (
    HybridStepModel,
    followed,
    hybrid_inputs,
    hybrid_samples,
    left_over,
    load_hybrid,
)
from drift_drake.drive.learnt.quality import learn
from drift_drake.drive.loop.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.reference.trajectory import figure_8

CAR = VehicleParameters()
LAGS = make_effects({"steering_lag": 0.04, "torque_lag": 0.12, "friction_level": -0.1})


@pytest.fixture(scope="module")
def learner(random_model: BayesianModel, physical_network) -> BayesianModel:
    return dataclasses.replace(random_model, network=physical_network)


def single() -> EffectsStepModel:
    return EffectsStepModel(CAR, LAGS)


def points(car: RememberingStepModel, count: int = 4) -> tuple[np.ndarray, ...]:
    """(x, u, u_next, curvature) in and about a drift."""
    generator = np.random.default_rng(1)
    u = np.array([-0.1, 150.0]) + generator.normal(size=(count, 2)) * [0.05, 20.0]
    state = np.array([0.7, 11.0, -0.5, 14.0, 0.3, 0.1]) + 0.1 * generator.normal(size=(count, 6))
    internal = [car.settled(x[:4], command) for x, command in zip(state, u, strict=True)]
    return np.concatenate([state, internal], axis=1), u, u + np.array([0.03, 10.0]), np.full(count, 0.05)


@pytest.mark.parametrize("car", [single(), known_car_model(CARS["coupe"], LAGS)], ids=["single", "double"])
def test_nothing_learnt_is_the_car_itself(learner: BayesianModel, car: RememberingStepModel) -> None:
    model, at = HybridStepModel(learner, np.zeros((4, 16)), car), points(car)
    np.testing.assert_array_equal(model.step(*at), car.step(*at))
    for part, own in zip(model.linearize(*at), car.linearize(*at), strict=True):
        np.testing.assert_array_equal(part, own)


@pytest.mark.parametrize(
    "effects", [{"steering_lag": 0.04, "torque_lag": 0.12}, {"aero_drag": 0.3}], ids=["lags", "none"]
)
def test_jacobians_are_those_of_the_step(learner: BayesianModel, effects: dict[str, float]) -> None:
    model = HybridStepModel(learner, 0.02 * np.ones((4, 16)), EffectsStepModel(CAR, make_effects(effects)))
    model = model.with_theta(np.append(0.02 * np.random.default_rng(0).normal(size=64), [0.1, -0.2, 0.05, 0.3]))
    at = points(model.car)
    for exact, differences in zip(model.linearize(*at), StepModel.linearize(model, *at), strict=True):
        np.testing.assert_allclose(exact, differences, rtol=2e-5, atol=2e-5)


def test_the_path_coordinates_follow_what_grows_over_the_step(learner: BayesianModel) -> None:
    """Relative to an integration of a body whose yaw rate, speed and sideslip gain g evenly over the step."""
    car, g = single(), 1e-3 * np.array([0.7, -0.9, 0.4, 0.2])
    model = HybridStepModel(learner, np.zeros((4, 16)), car)
    x, u, u_next, _ = points(car, 1)
    straight = np.zeros(1)
    moved = model.with_theta(np.append(np.zeros(64), g)).step(x, u, u_next, straight) - car.step(x, u, u_next, straight)
    v, dphi, shares, e, heading = x[0, 1], x[0, 5], (np.arange(1000) + 0.5) / 1000.0, 0.0, 0.0
    for share in shares:  # by how much it leads, over a step of 0.1 s in which the body itself goes straight on
        heading += 1e-4 * g[0] * share
        e += 1e-4 * ((v + g[1] * share) * np.sin(dphi + heading + g[2] * share) - v * np.sin(dphi))
    np.testing.assert_allclose(moved[0, :4], g, rtol=1e-9)
    assert moved[0, 5] == pytest.approx(heading + g[2], rel=1e-3)
    assert moved[0, 4] == pytest.approx(e, rel=1e-2)


def test_what_a_car_leaves_over_is_what_is_learnt(learner: BayesianModel) -> None:
    car, theta = single(), 0.05 * np.random.default_rng(2).normal(size=(4, 16))
    model = HybridStepModel(learner, theta, car)
    x, u, u_next, straight = points(car)[0], *points(car)[1:3], np.zeros(4)
    phi, y = regression_points(
        learner, *left_over(car, learner.vehicle, x, u, u_next, model.step(x, u, u_next, straight))
    )
    with_lags = learner.with_lag(np.array([0.04, 0.12])).network
    np.testing.assert_allclose(phi, features(with_lags, hybrid_inputs(car, x, u, u_next)), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(y, np.sum(theta * phi, axis=-1), rtol=1e-7, atol=1e-9)


def log(rows: int = 120) -> pd.DataFrame:
    """Of a car that holds a turn under commands that change."""
    t = 0.01 * np.arange(rows)
    columns = {"t": t, "r": 0.4 + 0.1 * np.sin(t), "v": 10.0 + t, "beta": -0.1 + 0.05 * t, "omega_r": 11.0 + t,
               "e": 0.0 * t, "dphi": 0.0 * t, "s": 10.0 * t, "delta_cmd": 0.1 * np.sin(4.0 * t),
               "tau_cmd": 100.0 + 50.0 * np.sin(3.0 * t)}  # fmt: skip
    return pd.DataFrame(columns)


def test_internal_states_follow_the_commands_of_a_log() -> None:
    table = log()
    x, u = table[["r", "v", "beta", "omega_r", "e", "dphi"]].to_numpy(), table[["delta_cmd", "tau_cmd"]].to_numpy()
    found = followed(single(), x, u)[:, :2]
    np.testing.assert_allclose(
        found, lagged_commands(table["t"].to_numpy(), u, np.array([0.04, 0.12])), rtol=1e-6, atol=1e-6
    )
    at_once = followed(EffectsStepModel(CAR, make_effects({"aero_drag": 0.3})), x, u)[:, :2]
    np.testing.assert_allclose(at_once, u, rtol=1e-9)


def test_an_adapter_in_the_loop_learns_what_the_functions_learn_of_its_log() -> None:
    learnt, car, reference = load_hybrid(), single(), figure_8(CAR)
    model, adapter = HybridStepModel(learnt, learnt.prior_mean, car), BayesianAdapter(learnt, car=car)
    loop = ClosedLoop(CAR, reference, model, LAGS, adapter=adapter)
    context = loop.initial_context(seed=0)
    run = loop.run(context, RunLimits(time_factor=0.05))
    own = adapter.GetMyContextFromRoot(context)
    taken, refused = adapter.GetOutputPort("counters").Eval(own)
    assert taken > 5
    assert refused == 0
    measured = {name: run.table[f"measured_{name}"] for name in ("r", "v", "beta", "omega_r", "e", "dphi", "s")}
    table = pd.DataFrame(
        {"t": run.table["t"], **measured, "delta_cmd": run.table["delta"], "tau_cmd": run.table["tau"]}
    )
    (samples,) = hybrid_samples(table, None, 0, 0, car, learnt.vehicle)
    expected = learn(learnt, learnt.prior(), samples.where(np.arange(int(taken))))
    found = adapter.posterior(own)
    deviation = learnt.sigma[:, None] * np.sqrt(np.diagonal(expected.covariance)).reshape(4, 16)
    # The loop's log holds the readings as they came, its adapter those that the screen let through.
    assert np.abs((found.mean - expected.mean) / deviation).max() < 0.1
    again = loop.run(loop.initial_context(seed=0), RunLimits(time_factor=0.05))
    assert again.table["delta"].equals(run.table["delta"])


def test_a_model_and_an_adapter_of_two_cars_are_refused() -> None:
    learnt, reference = load_hybrid(), figure_8(CAR)
    model, other = HybridStepModel(learnt, learnt.prior_mean, single()), BayesianAdapter(learnt, car=single())
    for adapter in (other, BayesianAdapter(learnt)):
        with pytest.raises(ValueError, match=r"of another car than the model: give both the same"):
            ClosedLoop(CAR, reference, model, adapter=adapter)
    with pytest.raises(ValueError, match="not tightened for a hybrid model"):
        ClosedLoop(CAR, reference, model, adapter=BayesianAdapter(learnt, car=model.car),
                   control=ControlConfig(tightening=1.0))  # fmt: skip


def test_the_shipped_models_of_many_structures_are_whole() -> None:
    for model in (load_hybrid(), load_varied()):
        assert model.vehicle == CAR
        assert np.linalg.eigvalsh(model.prior().covariance)[0] > 0.0
        assert ((model.sample_weight > 0.0) & (model.sample_weight <= 1.0)).all()
