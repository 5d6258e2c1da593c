"""The closed loop with the learnt model, adapting and not."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.learnt.adapter import BayesianAdapter
from drift_drake.drive.learnt.bayesian_step import BayesianStepModel
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.command_lag import lagged_commands
from drift_drake.drive.learnt.features import MEAN_COUNT
from drift_drake.drive.learnt.lag_bank import BANK
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.loop.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.loop.faults import Change
from drift_drake.drive.mpc.mpc import FOLLOWED
from drift_drake.drive.reference.trajectory import figure_8
from experiments.benchmarks.vehicles import draw_effects

CONTROL = ControlConfig(horizon=15, period=0.02, delay=0.02)


@pytest.fixture(scope="module")
def adaptive() -> tuple[ClosedLoop, BayesianAdapter]:
    learnt, parameters = load_model(), VehicleParameters()
    model = BayesianStepModel(learnt.network, learnt.prior().mean, learnt.vehicle.constants(), path_step="trapezoid")
    adapter = BayesianAdapter(learnt)
    reference = dataclasses.replace(figure_8(parameters), distance=35.0)
    effects = draw_effects("train", 0, seed=0)
    return ClosedLoop(parameters, reference, model, effects, control=CONTROL, adapter=adapter), adapter


def posterior_mean(adaptive: tuple[ClosedLoop, BayesianAdapter], frozen: bool) -> tuple[np.ndarray, pd.DataFrame]:
    """theta at the end of a drive, and the drive's table."""
    loop, adapter = adaptive
    context = loop.initial_context(seed=1)
    adapter.set_frozen(adapter.GetMyMutableContextFromRoot(context), frozen)
    run = loop.run(context)
    theta = adapter.GetOutputPort("posterior_mean").Eval(adapter.GetMyContextFromRoot(context))
    return theta.copy(), run.table.drop(columns="solve_seconds")


@pytest.fixture(scope="module")
def adapted(adaptive: tuple[ClosedLoop, BayesianAdapter]) -> tuple[np.ndarray, pd.DataFrame]:
    return posterior_mean(adaptive, frozen=False)


def test_the_controller_follows_the_adapter(
    adaptive: tuple[ClosedLoop, BayesianAdapter], adapted: tuple[np.ndarray, pd.DataFrame]
) -> None:
    prior = load_model().prior().mean.ravel()
    assert prior.size == MEAN_COUNT
    held, without = posterior_mean(adaptive, frozen=True)
    moved, with_adaptation = adapted
    np.testing.assert_array_equal(held, prior)
    assert np.abs(moved - prior).max() > 1e-3
    # The commands differ as soon as the first sample is in, and not before.
    count = min(len(without), len(with_adaptation))
    differ = (without["delta"].to_numpy()[:count] != with_adaptation["delta"].to_numpy()[:count]).nonzero()[0]
    first = without["t"].iloc[differ[0]]
    assert 0.1 < first < 0.3


def test_the_lags_follow_the_commands_in_force(adaptive: tuple[ClosedLoop, BayesianAdapter]) -> None:
    loop, _ = adaptive
    context = loop.initial_context(seed=1)
    table = loop.run(context, RunLimits(time_factor=0.1)).table
    lag = loop.diagram.GetSubsystemByName("observer")
    t, *held = lag.GetMyContextFromRoot(context).get_discrete_state_vector().value()
    command, lagged = np.array(held[:2]), np.array(held[2:])
    expected = lagged_commands(table["t"].to_numpy(), table[["delta", "tau"]].to_numpy())
    row = int(np.argmin(np.abs(table["t"] - t)))
    assert row > 10
    np.testing.assert_allclose(lagged, expected[row], rtol=1e-6)
    assert (np.abs(lagged - command) > 0.0).all()


def test_an_adapting_loop_replays_to_the_bit(
    adaptive: tuple[ClosedLoop, BayesianAdapter], adapted: tuple[np.ndarray, pd.DataFrame]
) -> None:
    (first_theta, first), (second_theta, second) = adapted, posterior_mean(adaptive, frozen=False)
    np.testing.assert_array_equal(first_theta, second_theta)
    pd.testing.assert_frame_equal(first, second, check_exact=True)


def test_a_change_of_the_car_takes_effect_at_its_time(adaptive: tuple[ClosedLoop, BayesianAdapter]) -> None:
    loop, _ = adaptive
    effects = draw_effects("train", 0, seed=0)
    slippery = Change(0.5, effects._replace(friction_level=effects.friction_level - 0.2))
    limits = RunLimits(time_factor=0.4)  # soon after the change
    same, changed = (loop.run(loop.initial_context(seed=1), limits, change=change).table for change in (None, slippery))
    columns = ["r", "v", "beta", "omega_r"]
    before = int((changed["t"] <= slippery.time).sum())
    pd.testing.assert_frame_equal(same[columns][:before], changed[columns][:before], check_exact=True)
    assert (same[columns].iloc[before + 1] != changed[columns].iloc[before + 1]).all()


def test_a_car_without_effects_cannot_change() -> None:
    parameters = VehicleParameters()
    loop = ClosedLoop(parameters, figure_8(parameters), NominalStepModel(parameters), control=CONTROL)
    with pytest.raises(ValueError, match="build it with those"):
        loop.run(loop.initial_context(seed=0), change=Change(0.5, draw_effects("train", 0, seed=0)))


def test_the_controller_plans_with_the_adapters_offset() -> None:
    """Of a resistance that no vehicle of the training had, the speed loses less."""
    learnt, parameters = load_model(), VehicleParameters()
    reference, effects = dataclasses.replace(figure_8(parameters), distance=40.0), Effects(rolling_resistance=0.05)
    model, errors = step_model(learnt, learnt.prior()), []
    for offset_time in (None, 1.0):
        adapter = BayesianAdapter(learnt, offset_time=offset_time)
        loop = ClosedLoop(parameters, reference, model, effects, control=CONTROL, adapter=adapter)
        context = loop.initial_context(seed=1)
        errors.append(loop.run(context).metrics().rms_e)
        offset = adapter.GetOutputPort("parameters").Eval(adapter.GetMyContextFromRoot(context))[
            MEAN_COUNT : MEAN_COUNT + 4
        ]
        assert (offset == 0.0).all() if offset_time is None else offset[1] < -0.01
    assert errors[1] < errors[0]


def test_a_lane_tightened_by_uncertainty() -> None:
    """A controller that trusts its model little finds the car outside what it leaves of the lane."""
    learnt, parameters = load_model(), VehicleParameters()
    reference = dataclasses.replace(figure_8(parameters), distance=4.0)
    model, tables = step_model(learnt, learnt.prior()), []
    for kappa in (0.0, 200.0):
        control = dataclasses.replace(CONTROL, tightening=kappa)
        loop = ClosedLoop(parameters, reference, model, control=control, adapter=BayesianAdapter(learnt))
        tables.append(loop.run(loop.initial_context(seed=1, error=np.array([0.0, 0.0, 0.0, 0.0, 2.5, 0.0]))).table)
    # Some iterations in: the first plans are those of a solver that has just started.
    free, tight = (table["solve_slack"].iloc[5] for table in tables)
    assert free == pytest.approx(0.0, abs=1e-3)
    assert tight > 0.1
    assert tables[1]["solve_failures"].iloc[-1] == 0.0


def test_a_tightened_lane_needs_an_adapter() -> None:
    parameters = VehicleParameters()
    control = dataclasses.replace(CONTROL, tightening=1.0)
    with pytest.raises(ValueError, match="give an adapter"):
        ClosedLoop(parameters, figure_8(parameters), NominalStepModel(parameters), control=control)


def test_a_plan_that_leads_no_further_is_left_for_one_from_a_fresh_guess() -> None:
    """With this noise the first beliefs lead the plan into a corner, from where the car spins within 1.6 s.

    Under typical lags alone: with those that this car has they do not.
    """
    learnt, parameters = load_model(), VehicleParameters()
    model, adapter = step_model(learnt, learnt.prior()), BayesianAdapter(learnt)
    loop = ClosedLoop(parameters, figure_8(parameters), model, adapter=adapter)
    run = loop.run(loop.initial_context(36, np.array([0.0, 0.0, 0.1, 0.0, 0.5, 0.0])), RunLimits(time_factor=0.1))
    assert run.outcome == "time is up"
    assert run.table["beta"].abs().max() < 0.8
    assert run.metrics().restarts > 0
    followed = run.table["solve_restart"].to_numpy() == FOLLOWED
    assert run.table["solve_cost"].to_numpy()[followed].max() < 100.0


def test_a_steering_lag_is_learnt_while_driving() -> None:
    """Within the first second of a drift; the controller then plans with it."""
    learnt, parameters = load_model(), VehicleParameters()
    reference, effects = dataclasses.replace(figure_8(parameters), distance=15.0), Effects(steering_lag=0.2)
    adapter = BayesianAdapter(learnt, lags=BANK)
    model = step_model(learnt, learnt.prior())
    loop = ClosedLoop(parameters, reference, model, effects, control=CONTROL, adapter=adapter)
    context = loop.initial_context(seed=0)
    run = loop.run(context)
    assert run.metrics().outcome == "completed"
    own = adapter.GetMyContextFromRoot(context)
    assert adapter.lags[adapter.believed(own)][0] == pytest.approx(0.2, abs=0.06)
    internal = loop.controller.GetInputPort("internal_states").Eval(loop.controller.GetMyContextFromRoot(context))
    np.testing.assert_array_equal(internal, adapter.GetOutputPort("internal_states").Eval(own))


def test_the_lane_is_tightened_under_the_lags_that_are_believed() -> None:
    learnt, parameters = load_model(), VehicleParameters()
    reference, effects = dataclasses.replace(figure_8(parameters), distance=50.0), Effects(steering_lag=0.2)
    adapter = BayesianAdapter(learnt, lags=BANK)
    loop = ClosedLoop(parameters, reference, step_model(learnt, learnt.prior()), effects, adapter=adapter,
                      control=dataclasses.replace(CONTROL, tightening=1.0))  # fmt: skip
    context = loop.initial_context(seed=0)
    run = loop.run(context)
    assert run.metrics().outcome == "completed"
    assert run.metrics().solver_failures == 0
    assert adapter.lags[adapter.believed(adapter.GetMyContextFromRoot(context))][0] > 0.1
