"""EquationsPlant as a Drake system: ports, scalars, replay, and that it is the equations."""

import itertools

import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff
from pydrake.symbolic import MakeVectorVariable
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

from drift_drake.car.double_track.constants import flattened, unflattened
from drift_drake.car.double_track.motion import OwnStates, double_track_motion
from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters
from drift_drake.car.effects.magnitudes import NOT_ON_FOUR_WHEELS, Effects
from drift_drake.car.equations_plant import EquationsPlant
from drift_drake.car.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.car.single_track.plant import VehiclePlant
from drift_drake.drive.reference.path import Path

CAR = DoubleTrackParameters()
EFFECTS = Effects(friction_level=-0.1, cg_shift=0.05, steering_lag=0.1, torque_lag=0.2, steering_rate_limit=0.5,
                  aero_drag=1.0, road_grade=0.04, drivetrain_friction=80.0, tyre_relaxation=0.3)  # fmt: skip
STATE, ACTUATION = (0.4, 12.0, -0.3, 14.0, 0.5, -0.1), (0.1, 120.0)


def s_bend():
    return Path([0.0, 20.0, 50.0, 80.0, 120.0], [0.0, 0.0, 0.05, -0.04, 0.0], (3.0, -2.0, 0.7))


def prepared(plant, s=10.0):
    context = plant.CreateDefaultContext()
    plant.set_initial(context, STATE, s=s, actuation=ACTUATION)
    plant.GetInputPort("actuation").FixValue(context, np.array(ACTUATION))
    return context


def moved(plant, context, duration):
    simulator = Simulator(plant, context)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.01).set_target_accuracy(1e-6)
    simulator.AdvanceTo(duration)
    return context.get_continuous_state_vector().CopyToVector()


def ports(plant):
    inputs = [plant.get_input_port(i) for i in range(plant.num_input_ports())]
    outputs = [plant.get_output_port(i) for i in range(plant.num_output_ports())]
    return [(port.get_name(), port.size()) for port in inputs + outputs if port.get_name() != "full_state"]


def test_has_the_ports_and_the_feedthrough_of_the_single_track_plant():
    plant, single = EquationsPlant(CAR, EFFECTS, s_bend()), VehiclePlant(VehicleParameters(), EFFECTS, s_bend())
    assert ports(plant) == ports(single)
    for i, o in itertools.product(range(plant.num_input_ports()), range(plant.num_output_ports())):
        assert plant.HasDirectFeedthrough(i, o) == single.HasDirectFeedthrough(i, o)


def test_ports_give_what_the_state_says():
    path = s_bend()
    plant = EquationsPlant(CAR, path=path)
    context = prepared(plant, s=30.0)
    view = plant.state_view(plant.GetOutputPort("full_state").Eval(context))
    np.testing.assert_array_equal(plant.GetOutputPort("state").Eval(context), STATE)
    assert plant.GetOutputPort("path_position").Eval(context) == [30.0]
    np.testing.assert_array_equal(plant.GetOutputPort("pose").Eval(context), [view.x, view.y, view.psi])
    np.testing.assert_allclose([view.x, view.y], path.to_world(30.0, 0.5))
    rates = plant.EvalTimeDerivatives(context).CopyToVector()
    r, v, beta = STATE[:3]
    body = (rates[1] * np.cos(beta) - v * (rates[2] + r) * np.sin(beta),
            rates[1] * np.sin(beta) + v * (rates[2] + r) * np.cos(beta))  # fmt: skip
    np.testing.assert_allclose(plant.GetOutputPort("acceleration").Eval(context), body, rtol=1e-10)
    s_dot = v * np.cos(STATE[5]) / (1.0 - path.curvature(30.0) * STATE[4])
    assert rates[6] == pytest.approx(s_dot)


def test_disturbance_and_curvature_ports_act():
    plant = EquationsPlant(CAR)
    context = prepared(plant)
    before = plant.EvalTimeDerivatives(context).CopyToVector()
    still = plant.GetOutputPort("acceleration").Eval(context).copy()
    plant.GetInputPort("disturbance").FixValue(context, np.array([CAR.mass, -CAR.mass, CAR.yaw_inertia]))
    plant.GetInputPort("curvature").FixValue(context, np.array([0.05]))
    after = plant.EvalTimeDerivatives(context).CopyToVector()
    np.testing.assert_allclose(plant.GetOutputPort("acceleration").Eval(context) - still, [1.0, -1.0], atol=1e-12)
    assert after[0] - before[0] == pytest.approx(1.0)
    assert after[6] == pytest.approx(before[6] / (1.0 - 0.05 * STATE[4]))


@pytest.mark.parametrize("effects", [Effects(), EFFECTS])
def test_compiled_derivatives_are_the_plain_ones(effects):
    plant = EquationsPlant(CAR, effects, s_bend())
    context = prepared(plant, s=30.0)
    x = context.get_continuous_state_vector().CopyToVector()
    x[10:] += 0.01 * np.arange(13)
    context.SetContinuousState(x)
    plant.GetInputPort("disturbance").FixValue(context, np.array([500.0, -300.0, 800.0]))
    wrench, curvature = (500.0, -300.0, 800.0), float(s_bend().curvature(30.0))
    plain = plant.rates(x, ACTUATION, wrench, curvature, CAR.constants(), effects)
    rates = plant.EvalTimeDerivatives(context).CopyToVector()
    np.testing.assert_allclose(rates, np.array(plain[:-2], dtype=float), rtol=1e-12, atol=1e-12)
    m, own = double_track_motion(*x[:4], x[9], OwnStates(*x[10:]), *ACTUATION, CAR.constants(), effects, *wrench)
    np.testing.assert_allclose(rates[:4], m[:4], rtol=1e-12)
    np.testing.assert_allclose(rates[10:], own, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(plant.GetOutputPort("acceleration").Eval(context), [m.a_x, m.a_y], rtol=1e-12)


def test_a_clone_of_a_context_replays_to_the_bit():
    plant = EquationsPlant(CAR, EFFECTS, s_bend())
    context = prepared(plant)
    clone = context.Clone()
    np.testing.assert_array_equal(moved(plant, context, 0.5), moved(plant, clone, 0.5))


def test_a_run_starts_settled():
    """The car's own states stay where they are while its motion hardly changes."""
    plant = EquationsPlant(CAR)
    context = prepared(plant)
    own = plant.EvalTimeDerivatives(context).CopyToVector()[10:]
    names = plant.state_names[10:]
    rates = dict(zip(names, own, strict=True))
    assert rates["roll"] == 0.0
    # The sliding rear tyres differ in drive force, which is what turns the wheels against each other.
    for name in set(names) - {"rim_difference"}:
        assert abs(rates[name]) < 0.02, name


def test_effects_are_parameters_of_the_context():
    plain, changed = EquationsPlant(CAR), EquationsPlant(CAR, EFFECTS)
    contexts = prepared(plain), prepared(changed)
    contexts[0].get_mutable_numeric_parameter(1).SetFromVector(EFFECTS)
    contexts[1].SetContinuousState(contexts[0].get_continuous_state_vector().CopyToVector())
    first, second = (p.EvalTimeDerivatives(c).CopyToVector() for p, c in zip((plain, changed), contexts, strict=True))
    np.testing.assert_array_equal(first, second)


def test_autodiff_gives_the_slopes_of_the_derivatives():
    plant = EquationsPlant(CAR, EFFECTS, s_bend())
    context = prepared(plant, s=30.0)
    x = context.get_continuous_state_vector().CopyToVector()
    converted = plant.ToAutoDiffXd()
    ad_context = converted.CreateDefaultContext()
    ad_context.SetContinuousState(InitializeAutoDiff(x)[:, 0])
    converted.GetInputPort("actuation").FixValue(ad_context, np.array(ACTUATION))
    jacobian = ExtractGradient(converted.EvalTimeDerivatives(ad_context).CopyToVector())
    step = 1e-6
    for i in (0, 2, 3, 13, 17, 21):
        sides = []
        for sign in (1.0, -1.0):
            shifted = x.copy()
            shifted[i] += sign * step
            context.SetContinuousState(shifted)
            sides.append(plant.EvalTimeDerivatives(context).CopyToVector())
        slope = (sides[0] - sides[1]) / (2.0 * step)
        np.testing.assert_allclose(jacobian[:, i], slope, rtol=1e-5, atol=1e-4 * np.abs(slope).max())


def test_converts_to_expressions():
    plant = EquationsPlant(CAR).ToSymbolic()
    context = plant.CreateDefaultContext()
    names = MakeVectorVariable(len(plant.state_names), "x")
    context.SetContinuousState(names)
    plant.GetInputPort("actuation").FixValue(context, np.array(ACTUATION))
    values = prepared(EquationsPlant(CAR)).get_continuous_state_vector().CopyToVector()
    rate = plant.EvalTimeDerivatives(context).CopyToVector()[0].Evaluate(dict(zip(names, values, strict=True)))
    numeric = EquationsPlant(CAR)
    assert rate == pytest.approx(numeric.EvalTimeDerivatives(prepared(numeric)).CopyToVector()[0], rel=1e-10)


@pytest.mark.parametrize("name", NOT_ON_FOUR_WHEELS)
def test_an_effect_that_it_cannot_have_is_refused(name):
    with pytest.raises(InvalidVehicleError, match=f"{name} cannot be put on a double-track car"):
        EquationsPlant(CAR, Effects(**{name: 0.1}))


@pytest.mark.parametrize("car", CARS.values())
def test_constants_come_back_from_their_row(car):
    assert unflattened(flattened(car.constants())) == car.constants()
