"""VehiclePlant as a Drake system: ports, states, equations, and its place on the path and in the world."""

import itertools

import numpy as np
import pytest
from plant_bench import ACTUATION, MANY_EFFECTS, PARAMETERS, STATE, prepared, s_bend, simulated, steered

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.on_path import PLANT_STATES
from drift_drake.car.single_track.motion import derivatives
from drift_drake.car.single_track.motion_with_effects import settled_internal_states
from drift_drake.car.single_track.plant import (
    OFF_THE_MOTION,
    PLANT_STATES_WITH_INTERNAL,
    VehiclePlant,
    acts_on_motion,
    changed_rates,
    nominal_rates,
)


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


def test_internal_states_exist_only_for_effects_on_the_motion():
    assert not acts_on_motion(Effects(**dict.fromkeys(OFF_THE_MOTION, 0.01)))
    assert VehiclePlant(PARAMETERS).state_names == PLANT_STATES
    for name in set(Effects._fields) - set(OFF_THE_MOTION):
        assert acts_on_motion(Effects(**{name: 0.01}))
    plant = VehiclePlant(PARAMETERS, Effects(mass_error=0.1))
    assert plant.state_names == PLANT_STATES_WITH_INTERNAL
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
            if plant.has_internal_states
            else nominal_rates(x, ACTUATION, wrench, 0.03, p)
        )
        rates = plant.EvalTimeDerivatives(context).CopyToVector()
        np.testing.assert_allclose(rates, plain[:-2], rtol=1e-12, atol=1e-12)
        r, v, beta = x[:3]
        body = (
            rates[1] * np.cos(beta) - v * (rates[2] + r) * np.sin(beta),
            rates[1] * np.sin(beta) + v * (rates[2] + r) * np.cos(beta),
        )
        acceleration = plant.GetOutputPort("acceleration").Eval(context)
        np.testing.assert_allclose(acceleration, plain[-2:], rtol=1e-12)
        np.testing.assert_allclose(acceleration, body, rtol=1e-10)


@pytest.mark.parametrize("rates", [nominal_rates, lambda *given: changed_rates(*given, Effects(steering_lag=0.1))])
def test_a_disturbance_moves_the_car_as_newton_and_euler_say(rates):
    """Forces over mass, the moment over the yaw inertia, and nothing else changes at once."""
    x = np.array([*STATE, 10.0, 0.0, 0.0, 0.2, *np.zeros(8)])
    force_x, force_y, moment = 500.0, -300.0, 800.0
    p, beta = PARAMETERS.constants(), STATE[2]
    before, after = (
        np.array(rates(x, ACTUATION, wrench, 0.03, p)) for wrench in (np.zeros(3), (force_x, force_y, moment))
    )
    along, across = force_x * np.cos(beta) + force_y * np.sin(beta), force_y * np.cos(beta) - force_x * np.sin(beta)
    turn = across / (p.mass * STATE[1])
    wanted = np.zeros(len(before))
    wanted[[0, 1, 2, 5]] = moment / p.yaw_inertia, along / p.mass, turn, turn
    wanted[-2:] = force_x / p.mass, force_y / p.mass
    if len(wanted) > 12:
        wanted[16:18] = after[16:18] - before[16:18]  # the filtered accelerations, of which other tests tell
    np.testing.assert_allclose(after - before, wanted, atol=1e-9)


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


def test_initial_internal_states_are_settled():
    plant = VehiclePlant(PARAMETERS, MANY_EFFECTS)
    context = prepared(plant)
    view = plant.state_view(plant.GetOutputPort("full_state").Eval(context))
    internal = settled_internal_states(*STATE[:4], *ACTUATION, PARAMETERS.constants(), MANY_EFFECTS, view.psi)
    np.testing.assert_allclose(view[10:], internal, rtol=1e-14)
    rates = plant.state_view(plant.EvalTimeDerivatives(context).CopyToVector())
    settled = (rates.steering, rates.torque, rates.front_slip, rates.rear_slip)
    np.testing.assert_allclose(settled, 0.0, atol=1e-12)


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
