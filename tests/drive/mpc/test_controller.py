"""MpcController alone: ports, plans, failures, replay."""

import dataclasses

import numpy as np
import pytest
from pydrake.systems.framework import Context

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.step_model import INPUT_SCALE, NominalStepModel
from drift_drake.drive.learnt.bayesian_step import BayesianStepModel
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.command_lag import LAGGED, lag_factors
from drift_drake.drive.learnt.features import FEATURE_COUNT, STATE_COUNT
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.mpc.controller import MpcController
from drift_drake.drive.mpc.mpc import Mpc, SolveStatistics
from drift_drake.drive.mpc.plan import interpolate_plan
from drift_drake.drive.mpc.sqp import SqpOptions
from drift_drake.drive.reference.trajectory import Reference

PARAMETERS = VehicleParameters()
HORIZON = 10
START = 20.0  # [m] along the figure-8
SECONDS = SolveStatistics._fields.index("seconds")


@pytest.fixture(scope="module")
def controller(references: dict[str, Reference]) -> MpcController:
    reference = references["figure_8"]
    command = (float(reference.input(START)[0]), float(reference.input(START)[1]))
    return MpcController(Mpc(NominalStepModel(PARAMETERS), PARAMETERS, reference, HORIZON, initial_command=command))


def measured(controller: MpcController, s: float = START, e: float = 0.3) -> np.ndarray:
    state = controller.mpc.reference.state(s)
    state[4] = e
    return np.append(state, s)


def tick(controller: MpcController, context: Context, t: float, measurement: np.ndarray) -> None:
    """One periodic update at time t."""
    context.SetTime(t)
    controller.get_input_port(0).FixValue(context, measurement)
    update = controller.EvalUniquePeriodicDiscreteUpdate(context)
    context.get_mutable_discrete_state().SetFrom(update)


def statistics(controller: MpcController, context: Context) -> SolveStatistics:
    return SolveStatistics(*controller.GetOutputPort("statistics").Eval(context))


def plan(controller: MpcController, context: Context) -> np.ndarray:
    return controller.GetOutputPort("plan").Eval(context)


def test_ports(controller: MpcController) -> None:
    assert [controller.get_input_port(i).get_name() for i in range(controller.num_input_ports())] == ["measured_state"]
    outputs = [controller.get_output_port(i).get_name() for i in range(controller.num_output_ports())]
    assert outputs == ["plan", "statistics", "prediction"]
    assert not controller.HasAnyDirectFeedthrough()
    assert np.isnan(plan(controller, controller.CreateDefaultContext())).all()


def test_a_model_with_internal_states_or_theta_has_a_port_for_it(references: dict[str, Reference]) -> None:
    model = EffectsStepModel(PARAMETERS, make_effects({"steering_lag": 0.05}))
    mpc = Mpc(model, PARAMETERS, references["figure_8"], 2)
    oracle = MpcController(mpc)
    assert oracle.GetInputPort("internal_states").size() == 8
    adaptive = MpcController(mpc, theta_size=STATE_COUNT * FEATURE_COUNT)
    assert adaptive.GetInputPort("theta").size() == 64
    assert hasattr(BayesianStepModel, "with_theta")
    learnt = load_model()
    controller = MpcController(Mpc(step_model(learnt, learnt.prior()), PARAMETERS, references["figure_8"], 2))
    assert controller.GetInputPort("internal_states").size() == 2
    assert controller.GetOutputPort("prediction").size() == 3 * 8


def test_a_learnt_plan_starts_from_the_lagged_commands(references: dict[str, Reference]) -> None:
    learnt, reference = load_model(), references["figure_8"]
    model = step_model(learnt, learnt.prior())
    command = reference.input(START)
    controller = MpcController(Mpc(model, PARAMETERS, reference, HORIZON, initial_command=(command[0], command[1])))
    context = controller.CreateDefaultContext()
    lagged = command - np.array([0.05, 20.0])
    controller.GetInputPort("internal_states").FixValue(context, lagged)
    tick(controller, context, 0.0, measured(controller))
    assert statistics(controller, context).failed == 0.0
    prediction = controller.GetOutputPort("prediction").Eval(context).reshape(HORIZON + 1, 8)
    # On the way to the command since the measurement, and what the plan's own commands make of it from there.
    share = (prediction[0, LAGGED] - lagged) / (command - lagged)
    assert ((share > 0.03) & (share < 0.3)).all()
    u = plan(controller, context)[1:].reshape(HORIZON + 1, 2)
    keep, by_now, by_next = lag_factors(0.1)
    expected = keep * prediction[:-1, LAGGED] + by_now * u[:-1] + by_next * u[1:]
    np.testing.assert_allclose(prediction[1:, LAGGED] / INPUT_SCALE, expected / INPUT_SCALE, atol=1e-3)


def test_the_plan_begins_after_the_delay_with_the_command_in_force(controller: MpcController) -> None:
    context = controller.CreateDefaultContext()
    tick(controller, context, 0.0, measured(controller))
    first = plan(controller, context).copy()
    assert first[0] == pytest.approx(controller.mpc.delay)
    np.testing.assert_allclose(first[1:3] / INPUT_SCALE, controller.mpc.reference.input(START) / INPUT_SCALE, atol=1e-3)
    tick(controller, context, 0.01, measured(controller, START + 0.127))
    second = plan(controller, context)
    assert second[0] == pytest.approx(0.02)
    # Where the second plan takes over, the command does not jump.
    expected = interpolate_plan(first, 0.02, 0.1)[:2]
    np.testing.assert_allclose(second[1:3] / INPUT_SCALE, expected / INPUT_SCALE, atol=1e-3)


def test_the_prediction_starts_at_the_state_predicted_for_the_plans_start(controller: MpcController) -> None:
    context = controller.CreateDefaultContext()
    state = measured(controller)
    tick(controller, context, 0.0, state)
    prediction = controller.GetOutputPort("prediction").Eval(context).reshape(HORIZON + 1, 6)
    # 10 ms at 12.7 m/s with the course 0: e stays, the others move little.
    np.testing.assert_allclose(prediction[0], state[:6], atol=0.02)
    assert abs(prediction[-1, 4]) < 0.3 * abs(prediction[0, 4])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_measurement_that_is_not_finite_keeps_the_plan_and_is_counted(controller: MpcController, bad: float) -> None:
    context = controller.CreateDefaultContext()
    tick(controller, context, 0.0, measured(controller))
    before = plan(controller, context).copy()
    broken = measured(controller)
    broken[2] = bad
    for count in (1, 2):
        tick(controller, context, 0.01 * count, broken)
        np.testing.assert_array_equal(plan(controller, context), before)
        assert statistics(controller, context).failed == 1.0
        assert statistics(controller, context).failures == count
    tick(controller, context, 0.03, measured(controller, START + 0.38))
    assert statistics(controller, context).failed == 0.0
    assert statistics(controller, context).failures == 2.0
    assert plan(controller, context)[0] == pytest.approx(0.04)


def test_a_cloned_context_replays_to_the_bit(controller: MpcController) -> None:
    context = controller.CreateDefaultContext()
    for k in range(3):
        tick(controller, context, 0.01 * k, measured(controller, START + 0.127 * k))
    clone = context.Clone()
    for _ in range(2):  # the other context moves on in between, so that nothing kept in the system would go unseen
        tick(controller, context, 0.03, measured(controller, START + 5.0, -0.5))
    again = clone.Clone()
    for one in (clone, again):
        tick(controller, one, 0.03, measured(controller, START + 0.38))
    for index in range(clone.num_discrete_state_groups()):
        first, second = (c.get_discrete_state(index).value().copy() for c in (clone, again))
        if first.size == len(SolveStatistics._fields):
            first[SECONDS] = second[SECONDS] = 0.0
        np.testing.assert_array_equal(first, second)


def test_it_runs_at_its_period(controller: MpcController) -> None:
    events = controller.GetUniquePeriodicDiscreteUpdateAttribute()
    assert events.period_sec() == pytest.approx(0.01)
    assert events.offset_sec() == 0.0


class BrokenOnceMoved(NominalStepModel):
    """A model whose Jacobian is not finite but where it is asked for it first."""

    calls = 0

    def linearize(self, *arguments: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        self.calls += 1
        x_next, a, b, b_next = super().linearize(*arguments)
        return x_next, (np.nan * a if self.calls > 1 else a), b, b_next

    def step(self, *arguments: np.ndarray) -> np.ndarray:
        return super().linearize(*arguments)[0]


def test_a_later_iteration_that_fails_leaves_the_plan_of_those_before(references: dict[str, Reference]) -> None:
    command = references["figure_8"].input(START)
    options = dataclasses.replace(SqpOptions.real_time(3), defect_tolerance=0.0)
    mpc = Mpc(BrokenOnceMoved(PARAMETERS), PARAMETERS, references["figure_8"], HORIZON, options=options,
              initial_command=(float(command[0]), float(command[1])))  # fmt: skip
    controller = MpcController(mpc)
    context = controller.CreateDefaultContext()
    tick(controller, context, 0.0, measured(controller))
    assert np.isfinite(plan(controller, context)).all()
    assert statistics(controller, context).failed == 0.0
    assert statistics(controller, context).iterations == 1.0
    before = plan(controller, context).copy()
    tick(controller, context, 0.01, measured(controller))  # now the first one fails
    np.testing.assert_array_equal(plan(controller, context), before)
    assert statistics(controller, context).failures == 1.0
