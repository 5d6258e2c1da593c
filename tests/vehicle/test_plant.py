"""VehiclePlant as a Drake system: ports, scalars, integrators, and its place on the path and in the world."""

import itertools
from pathlib import Path as FilePath

import numpy as np
import pandas as pd
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.symbolic import Expression, MakeVectorVariable
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.reference.path import Path
from drift_drake.vehicle.bicycle import derivatives
from drift_drake.vehicle.bicycle_jacobian import linearize
from drift_drake.vehicle.effects import Effects, motion_with_effects, settled_memory
from drift_drake.vehicle.parameters import Constants, VehicleParameters
from drift_drake.vehicle.path_plant import PLANT_STATES
from drift_drake.vehicle.plant import (
    OFF_THE_MOTION,
    PLANT_STATES_WITH_MEMORY,
    VehiclePlant,
    acts_on_motion,
    changed_rates,
    nominal_rates,
)

PARAMETERS = VehicleParameters()
MANY_EFFECTS = Effects(friction_level=-0.1, tyre_relaxation=0.4, steering_lag=0.1, torque_lag=0.2, aero_drag=1.0,
                       longitudinal_load_transfer=0.5, lateral_load_transfer=0.1, tyre_thermal_fade=0.2,
                       sliding_friction_drop=0.2, road_grade=0.05, steering_rate_limit=0.6)  # fmt: skip
STATE = (0.4, 12.0, -0.3, 14.0, 0.5, -0.1)
ACTUATION = (0.1, 120.0)
GRIP = FilePath(__file__).resolve().parents[3] / "shared" / "spec" / "nominal_check_grip.csv"


def s_bend():
    return Path([0.0, 20.0, 50.0, 80.0, 120.0], [0.0, 0.0, 0.05, -0.04, 0.0], (3.0, -2.0, 0.7))


def prepared(plant, state=STATE, s=10.0, actuation=ACTUATION):
    context = plant.CreateDefaultContext()
    plant.set_initial(context, state, s=s, actuation=actuation)
    plant.GetInputPort("actuation").FixValue(context, np.array(actuation))
    return context


def steered(plant, duration, log_period=0.01):
    """The plant under a slalom with changing torque, logged."""
    builder = DiagramBuilder()
    builder.AddNamedSystem("plant", plant)
    times = np.arange(0.0, duration + 1.0, 0.1)
    commands = np.stack([0.1 * np.sin(3.0 * times), 80.0 + 60.0 * np.sin(1.3 * times)])
    source = TrajectorySource(PiecewisePolynomial.FirstOrderHold(times, commands))
    builder.AddNamedSystem("command", source)
    builder.Connect(source.get_output_port(), plant.GetInputPort("actuation"))
    log = LogVectorOutput(plant.GetOutputPort("full_state"), builder, log_period)
    return builder.Build(), log


def simulated(diagram, context, duration, scheme="runge_kutta3", step=None, accuracy=1e-8):
    simulator = Simulator(diagram, context)
    ResetIntegratorFromFlags(simulator, scheme, step or 0.1)
    integrator = simulator.get_mutable_integrator()
    if step is None:
        integrator.set_target_accuracy(accuracy)
    else:
        integrator.set_fixed_step_mode(True)
    simulator.AdvanceTo(duration)


def test_ports_and_states_are_named():
    plant = VehiclePlant(PARAMETERS)
    inputs = [plant.get_input_port(i) for i in range(plant.num_input_ports())]
    outputs = [plant.get_output_port(i) for i in range(plant.num_output_ports())]
    assert [(port.get_name(), port.size()) for port in inputs] == [
        ("actuation", 2), ("disturbance", 3), ("curvature", 1)]  # fmt: skip
    assert [(port.get_name(), port.size()) for port in outputs] == [
        ("state", 6), ("path_position", 1), ("pose", 3), ("acceleration", 2), ("full_state", 10)]  # fmt: skip
    context = prepared(plant)
    view = plant.state_view(plant.GetOutputPort("full_state").Eval(context))
    assert (view.v, view.beta, view.s, view.e) == (12.0, -0.3, 10.0, 0.5)
    np.testing.assert_array_equal(plant.GetOutputPort("state").Eval(context), STATE)
    assert plant.GetOutputPort("path_position").Eval(context) == [10.0]
    np.testing.assert_array_equal(plant.GetOutputPort("pose").Eval(context), view[7:10])


def test_only_the_acceleration_feeds_through_and_not_from_the_curvature():
    for plant in (VehiclePlant(PARAMETERS), VehiclePlant(PARAMETERS, MANY_EFFECTS, s_bend())):
        through = {
            (plant.get_input_port(i).get_name(), plant.get_output_port(o).get_name())
            for i, o in itertools.product(range(plant.num_input_ports()), range(plant.num_output_ports()))
            if plant.HasDirectFeedthrough(i, o)
        }
        assert through == {("actuation", "acceleration"), ("disturbance", "acceleration")}


def test_memory_exists_only_for_effects_on_the_motion():
    assert not acts_on_motion(Effects(**dict.fromkeys(OFF_THE_MOTION, 0.01)))
    assert VehiclePlant(PARAMETERS).state_names == PLANT_STATES
    for name in set(Effects._fields) - set(OFF_THE_MOTION):
        assert acts_on_motion(Effects(**{name: 0.01}))
    plant = VehiclePlant(PARAMETERS, Effects(mass_error=0.1))
    assert plant.state_names == PLANT_STATES_WITH_MEMORY
    assert plant.CreateDefaultContext().num_continuous_states() == 18


def test_derivatives_are_those_of_the_equations():
    plant = VehiclePlant(PARAMETERS, path=s_bend())
    context = prepared(plant, s=30.0)
    rates = plant.EvalTimeDerivatives(context).CopyToVector()
    curvature = s_bend().curvature(30.0)
    expected = derivatives(STATE, ACTUATION, curvature, PARAMETERS.constants())
    np.testing.assert_allclose(rates[:6], expected, rtol=1e-12, atol=1e-12)
    assert rates[9] == STATE[0]


@pytest.mark.parametrize("wrench", [(0.0, 0.0, 0.0), (500.0, -300.0, 800.0)])
def test_compiled_derivatives_are_the_plain_ones(wrench):
    x = np.arange(1.0, 19.0) / 10.0
    x[1], x[3] = 12.0, 13.0
    for effects in (Effects(), MANY_EFFECTS):
        plant = VehiclePlant(PARAMETERS, effects)
        context = plant.CreateDefaultContext()
        context.SetContinuousState(x[: len(plant.state_names)])
        plant.GetInputPort("actuation").FixValue(context, np.array(ACTUATION))
        plant.GetInputPort("disturbance").FixValue(context, np.array(wrench))
        plant.GetInputPort("curvature").FixValue(context, np.array([0.03]))
        p = PARAMETERS.constants()
        plain = (
            changed_rates(x, ACTUATION, wrench, 0.03, p, effects)
            if plant.has_memory
            else nominal_rates(x, ACTUATION, wrench, 0.03, p)
        )
        rates = plant.EvalTimeDerivatives(context).CopyToVector()
        np.testing.assert_allclose(rates, plain, rtol=1e-12, atol=1e-12)
        r, v, beta = x[:3]
        body = (
            rates[1] * np.cos(beta) - v * (rates[2] + r) * np.sin(beta),
            rates[1] * np.sin(beta) + v * (rates[2] + r) * np.cos(beta),
        )
        np.testing.assert_allclose(plant.GetOutputPort("acceleration").Eval(context), body, rtol=1e-10)


def test_curvature_port_goes_before_the_path():
    plant = VehiclePlant(PARAMETERS, path=s_bend())
    context = prepared(plant, s=50.0)
    s_dot = [plant.EvalTimeDerivatives(context).CopyToVector()[6]]
    plant.GetInputPort("curvature").FixValue(context, np.array([0.0]))
    s_dot.append(plant.EvalTimeDerivatives(context).CopyToVector()[6])
    straight = 12.0 * np.cos(-0.1)
    assert s_dot == pytest.approx([straight / (1.0 - 0.05 * 0.5), straight])


def test_initial_pose_lies_on_the_path():
    plant = VehiclePlant(PARAMETERS, path=s_bend())
    context = prepared(plant, s=37.0)
    x, y, psi = plant.GetOutputPort("pose").Eval(context)
    assert (x, y) == pytest.approx(s_bend().to_world(37.0, 0.5))
    assert psi + STATE[2] - s_bend().pose(37.0)[2] == pytest.approx(STATE[5])
    with pytest.raises(ValueError, match="the pose follows from the plant's path"):
        plant.set_initial(context, STATE, pose=(0.0, 0.0, 0.0))


def test_initial_pose_without_a_path():
    plant = VehiclePlant(PARAMETERS)
    context = prepared(plant)
    np.testing.assert_allclose(plant.GetOutputPort("pose").Eval(context), [0.0, 0.5, 0.2], rtol=1e-14)
    plant.set_initial(context, STATE, pose=(1.0, 2.0, 3.0))
    np.testing.assert_array_equal(plant.GetOutputPort("pose").Eval(context), [1.0, 2.0, 3.0])


def test_initial_memory_is_settled():
    plant = VehiclePlant(PARAMETERS, MANY_EFFECTS)
    context = prepared(plant)
    view = plant.state_view(plant.GetOutputPort("full_state").Eval(context))
    memory = settled_memory(*STATE[:4], *ACTUATION, PARAMETERS.constants(), MANY_EFFECTS, view.psi)
    np.testing.assert_allclose(view[10:], memory, rtol=1e-14)
    rates = plant.state_view(plant.EvalTimeDerivatives(context).CopyToVector())
    settled = (rates.steering, rates.torque, rates.front_slip, rates.rear_slip)
    np.testing.assert_allclose(settled, 0.0, atol=1e-12)


@pytest.mark.parametrize("effects", [Effects(), MANY_EFFECTS])
def test_drakes_gradients_are_the_analytic_jacobians_or_differences(effects):
    plant = VehiclePlant(PARAMETERS, effects, s_bend())
    context = prepared(plant, s=30.0)
    gradient_plant = plant.ToAutoDiffXd()
    gradient_context = gradient_plant.CreateDefaultContext()
    gradient_context.SetTimeStateAndParametersFrom(context)
    x = context.get_continuous_state_vector().CopyToVector()
    point = InitializeAutoDiff(np.concatenate([x, ACTUATION])).ravel()
    gradient_context.SetContinuousState(point[: len(x)])
    gradient_plant.GetInputPort("actuation").FixValue(gradient_context, point[len(x) :])
    rates = gradient_plant.EvalTimeDerivatives(gradient_context).CopyToVector()
    value, gradient = ExtractValue(rates).ravel(), ExtractGradient(rates)
    np.testing.assert_allclose(value, plant.EvalTimeDerivatives(context).CopyToVector(), rtol=1e-12, atol=1e-12)
    if not effects.friction_level:
        _, a, b = linearize(np.array(STATE), np.array(ACTUATION), s_bend().curvature(30.0), PARAMETERS.constants())
        np.testing.assert_allclose(gradient[:6, :6], a, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(gradient[:6, 10:], b, rtol=1e-9, atol=1e-9)
    for j in range(len(x)):
        step = np.zeros_like(x)
        step[j] = 1e-5
        columns = []
        for sign in (1.0, -1.0):
            context.SetContinuousState(x + sign * step)
            columns.append(plant.EvalTimeDerivatives(context).CopyToVector())
        np.testing.assert_allclose(gradient[:, j], (columns[0] - columns[1]) / 2e-5, rtol=1e-4, atol=1e-4)


def test_path_curvature_has_its_slope_in_drakes_gradients():
    plant = VehiclePlant(PARAMETERS, path=s_bend()).ToAutoDiffXd()
    context = plant.CreateDefaultContext()
    r, v, beta, omega_r, e, dphi = STATE
    x = InitializeAutoDiff([r, v, beta, omega_r, e, dphi, 30.0, 0.0, 0.0, 0.0]).ravel()
    context.SetContinuousState(x)
    plant.GetInputPort("actuation").FixValue(context, x[:2] * 0.0)
    s_dot = plant.EvalTimeDerivatives(context).CopyToVector()[6]
    curvature, slope = s_bend().curvature(30.0), 0.05 / 30.0
    expected = v * np.cos(dphi) * e * slope / (1.0 - curvature * e) ** 2
    assert s_dot.derivatives()[6] == pytest.approx(expected, rel=1e-9)


def test_parameters_of_the_context_can_be_changed_and_differentiated():
    plant = VehiclePlant(PARAMETERS)
    context = prepared(plant)
    before = plant.EvalTimeDerivatives(context).CopyToVector()
    constants = list(PARAMETERS.constants())
    friction = Constants._fields.index("friction")
    constants[friction] = 0.8
    context.get_mutable_numeric_parameter(0).SetFromVector(constants)
    slippery = plant.EvalTimeDerivatives(context).CopyToVector()
    other = VehiclePlant(PARAMETERS.replace(friction=0.8))
    np.testing.assert_array_equal(slippery, other.EvalTimeDerivatives(prepared(other)).CopyToVector())

    gradient_plant = plant.ToAutoDiffXd()
    gradient_context = gradient_plant.CreateDefaultContext()
    gradient_context.SetTimeStateAndParametersFrom(prepared(plant))
    parameters = InitializeAutoDiff(PARAMETERS.constants()).ravel()
    gradient_context.get_mutable_numeric_parameter(0).SetFromVector(parameters)
    gradient_plant.GetInputPort("actuation").FixValue(gradient_context, np.array([AutoDiffXd(u) for u in ACTUATION]))
    gradient = ExtractGradient(gradient_plant.EvalTimeDerivatives(gradient_context).CopyToVector()[:4])
    assert gradient.shape == (4, len(constants))
    assert np.all(np.isfinite(gradient))
    assert not np.allclose(gradient[:, friction], 0.0)
    assert not np.allclose(before, slippery)


@pytest.mark.parametrize("effects", [Effects(), MANY_EFFECTS])
def test_symbolic_plant_evaluates_to_the_same(effects):
    plant = VehiclePlant(PARAMETERS, effects, s_bend())
    context = prepared(plant)
    plant.GetInputPort("curvature").FixValue(context, np.array([0.02]))
    symbolic = plant.ToSymbolic()
    assert symbolic.path is plant.path
    assert symbolic.effects == effects
    count = len(plant.state_names)
    variables = MakeVectorVariable(count + 3, "z")
    symbols = np.array([Expression(variable) for variable in variables])
    symbolic_context = symbolic.CreateDefaultContext()
    symbolic_context.SetContinuousState(symbols[:count])
    symbolic.GetInputPort("actuation").FixValue(symbolic_context, symbols[count : count + 2])
    symbolic.GetInputPort("curvature").FixValue(symbolic_context, symbols[count + 2 :])
    x = context.get_continuous_state_vector().CopyToVector()
    environment = dict(zip(variables, (*x, *ACTUATION, 0.02), strict=True))
    rates = [f.Evaluate(environment) for f in symbolic.EvalTimeDerivatives(symbolic_context).CopyToVector()]
    np.testing.assert_allclose(rates, plant.EvalTimeDerivatives(context).CopyToVector(), rtol=1e-12, atol=1e-12)
    acceleration = [f.Evaluate(environment) for f in symbolic.GetOutputPort("acceleration").Eval(symbolic_context)]
    np.testing.assert_allclose(acceleration, plant.GetOutputPort("acceleration").Eval(context), rtol=1e-12)


def test_expression_cannot_pass_through_a_path():
    plant = VehiclePlant(PARAMETERS, path=s_bend()).ToSymbolic()
    context = plant.CreateDefaultContext()
    plant.GetInputPort("actuation").FixValue(context, np.array([Expression(0.0), Expression(0.0)]))
    with pytest.raises(ValueError, match="connect the port 'curvature'"):
        plant.EvalTimeDerivatives(context)


@pytest.mark.parametrize("effects", [Effects(), MANY_EFFECTS])
def test_error_controlled_and_fixed_step_integrators_agree(effects):
    plant = VehiclePlant(PARAMETERS, effects, s_bend())
    diagram, log = steered(plant, 4.0)
    runs = []
    for arguments in ({"accuracy": 1e-8}, {"step": 1e-3}, {"scheme": "runge_kutta5", "accuracy": 1e-9}):
        context = diagram.CreateDefaultContext()
        plant.set_initial(plant.GetMyMutableContextFromRoot(context), (0.0, 10.0, 0.0, 10.0, 0.3, 0.05))
        simulated(diagram, context, 4.0, **arguments)
        runs.append(log.FindLog(context).data())
    assert runs[0].shape[1] == 401
    np.testing.assert_allclose(runs[1], runs[0], rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(runs[2], runs[0], rtol=0.0, atol=1e-5)


def test_world_pose_and_path_position_tell_of_the_same_place():
    path = s_bend()
    plant = VehiclePlant(PARAMETERS, path=path)
    diagram, log = steered(plant, 5.0)
    context = diagram.CreateDefaultContext()
    # Small angles, so that the car stays within a few metres of the path for the whole run.
    plant.set_initial(plant.GetMyMutableContextFromRoot(context), (0.0, 9.0, 0.0, 9.0, 0.3, 0.05), s=2.0)
    simulated(diagram, context, 2.5)
    view = plant.state_view(log.FindLog(context).data())
    assert view.s[-1] > 20.0
    x, y = path.to_world(view.s, view.e)
    np.testing.assert_allclose([view.x, view.y], [x, y], atol=1e-5)
    np.testing.assert_allclose(view.psi + view.beta - path.pose(view.s)[2], view.dphi, atol=1e-6)


def test_grip_run_of_the_specification_stays_true_from_its_first_row():
    if not GRIP.exists():
        pytest.skip(f"{GRIP} is not here")
    table = pd.read_csv(GRIP)
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", VehiclePlant(PARAMETERS))
    commands = PiecewisePolynomial.FirstOrderHold(table["t"], table[["delta_cmd", "tau_cmd"]].to_numpy().T)
    source = builder.AddNamedSystem("command", TrajectorySource(commands))
    builder.Connect(source.get_output_port(), plant.GetInputPort("actuation"))
    log = LogVectorOutput(plant.GetOutputPort("full_state"), builder, 0.01)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    first = table.iloc[0]
    plant.set_initial(
        plant.GetMyMutableContextFromRoot(context), (first.r, first.v, first.beta, first.omega_r, 0.0, first.beta)
    )
    simulated(diagram, context, table["t"].iloc[-1], scheme="runge_kutta5", step=1e-3)
    data = log.FindLog(context).data()
    for name in ("r", "v", "beta", "omega_r", "x", "y", "psi"):
        error = np.abs(data[PLANT_STATES.index(name)] - table[name]).max()
        assert error < 1e-4, f"{name} is {error:.2g} off"


def test_cloned_context_replays_to_the_bit():
    plant = VehiclePlant(PARAMETERS, MANY_EFFECTS, s_bend())
    diagram, _ = steered(plant, 3.0)
    context = diagram.CreateDefaultContext()
    plant.set_initial(plant.GetMyMutableContextFromRoot(context), (0.0, 10.0, 0.0, 10.0, 0.3, 0.05))
    simulated(diagram, context, 1.0)
    clone = context.Clone()
    ends = []
    for one in (context, clone):
        simulated(diagram, one, 2.0)
        ends.append(plant.GetMyContextFromRoot(one).get_continuous_state_vector().CopyToVector())
    np.testing.assert_array_equal(ends[0], ends[1])


def test_all_zero_effects_are_the_nominal_motion():
    memory = settled_memory(*STATE[:4], *ACTUATION, PARAMETERS.constants(), Effects())
    changed, _ = motion_with_effects(*STATE[:4], 0.3, memory, *ACTUATION, PARAMETERS.constants(), Effects())
    nominal = derivatives(STATE, ACTUATION, 0.0, PARAMETERS.constants())
    np.testing.assert_allclose(changed[:4], nominal[:4], rtol=1e-14)
