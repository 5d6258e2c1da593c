"""The oracle of the double-track car: its step is the plant's motion, its internal states that car's own states."""

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import Multiplexer, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.car.double_track import equations
from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations_plant import EquationsPlant
from drift_drake.car.equations_step import EquationsStepModel
from drift_drake.car.internal_states import InternalStateObserver
from drift_drake.car.known_car import known_car_model, plant_of_car
from drift_drake.car.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.car.step_model import STATE_SCALE, STEP, NominalStepModel, StepModel, block_scale
from drift_drake.drive.loop.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drive.loop.metrics import RunMetrics
from drift_drake.drive.reference.trajectory import figure_8

Array = NDArray[np.float64]

X = np.array([[0.7, 12.7, -0.6, 17.5, 0.2, 0.05], [0.1, 15.0, 0.02, 15.3, -0.5, 0.1], [-0.5, 9.0, 0.3, 11.0, 0.0, 0.0]])
U = np.array([[-0.46, 168.0], [0.03, 60.0], [0.2, 120.0]])
U_NEXT = np.array([[-0.40, 190.0], [0.05, 20.0], [0.1, 150.0]])
CURVATURE = np.array([1.0 / 18.0, 0.0, -0.03])
EFFECTS = Effects(friction_level=-0.1, cg_shift=0.03, steering_lag=0.06, torque_lag=0.15, steering_offset=0.01,
                  aero_drag=1.0, drivetrain_friction=80.0, tyre_relaxation=0.3, rear_stiffness_error=0.2)  # fmt: skip
OWN_SCALE = np.array(equations.KIND.own_scale)
SCALE = np.concatenate([STATE_SCALE, OWN_SCALE])


def points(model: EquationsStepModel, unsettled: float = 0.0) -> Array:
    """X with the car's own states settled, then all states off by a random share of their scales."""
    own = [model.settled(x[:4], u) for x, u in zip(X, U, strict=True)]
    return np.hstack([X, own]) + unsettled * SCALE * np.random.default_rng(0).normal(size=(len(X), len(SCALE)))


def on_a_ramp(
    plant: EquationsPlant, u: Array, u_next: Array, duration: float
) -> tuple[DiagramBuilder, TrajectorySource]:
    """A builder that holds the plant, and the source of its input, which goes from u to u_next over a duration [s]."""
    builder = DiagramBuilder()
    builder.AddSystem(plant)
    ramp = PiecewisePolynomial.FirstOrderHold([0.0, duration], np.column_stack([u, u_next]))
    source = builder.AddSystem(TrajectorySource(ramp))
    builder.Connect(source.get_output_port(), plant.GetInputPort("actuation"))
    return builder, source


def integrated(diagram: Diagram, context: Context, duration: float) -> None:
    simulator = Simulator(diagram, context)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.01).set_target_accuracy(1e-7)
    simulator.AdvanceTo(duration)


@pytest.mark.parametrize("name", CARS)
@pytest.mark.parametrize("effects", [Effects(), EFFECTS])
@pytest.mark.parametrize("unsettled", [0.0, 0.1])
def test_a_step_is_the_plants_motion(name: str, effects: Effects, unsettled: float) -> None:
    model = EquationsStepModel(CARS[name], effects)
    x = points(model, unsettled)
    x_next = model.step(x, U, U_NEXT, CURVATURE)
    for i in range(len(X)):
        plant = EquationsPlant(CARS[name], effects)
        builder, _ = on_a_ramp(plant, U[i], U_NEXT[i], STEP)
        diagram = builder.Build()
        context = diagram.CreateDefaultContext()
        own = plant.GetMyMutableContextFromRoot(context)
        own.SetContinuousState(np.concatenate([x[i, :6], np.zeros(4), x[i, 6:]]))
        plant.GetInputPort("curvature").FixValue(own, CURVATURE[i : i + 1])
        integrated(diagram, context, STEP)
        end = plant.GetMyContextFromRoot(context).get_continuous_state_vector().CopyToVector()
        error = (x_next[i] - np.concatenate([end[:6], end[10:]])) / SCALE
        np.testing.assert_allclose(error[:6], 0.0, atol=3e-5)
        np.testing.assert_allclose(error[6:], 0.0, atol=5e-3)


@pytest.mark.parametrize("effects", [Effects(), EFFECTS])
def test_jacobians_are_of_second_order_in_the_sub_step(effects: Effects) -> None:
    model = EquationsStepModel(CARS["coupe"], effects)
    x, scale, errors = points(model, 0.05), block_scale(OWN_SCALE) / SCALE[:, None], []
    for substeps in (model.substeps, 4 * model.substeps):
        model.substeps = substeps
        value, *jacobians = model.linearize(x, U, U_NEXT, CURVATURE)
        np.testing.assert_allclose(value, model.step(x, U, U_NEXT, CURVATURE), rtol=0, atol=1e-12)
        wanted = StepModel.linearize(model, x, U, U_NEXT, CURVATURE)[1:]
        errors.append(np.abs(scale * (np.concatenate(jacobians, axis=2) - np.concatenate(wanted, axis=2))).max())
    assert errors[0] < 0.02  # entries reach 3 to 11
    assert errors[1] < errors[0] / 8.0  # second order, 16 in the limit


def test_shorter_lags_ask_for_more_sub_steps() -> None:
    assert EquationsStepModel(CARS["coupe"]).substeps == 16
    short = EquationsStepModel(CARS["coupe"], Effects(torque_lag=1.5e-3))
    assert short.substeps > 30
    assert np.isfinite(short.step(points(short), U, U_NEXT, CURVATURE)).all()


@pytest.mark.parametrize("effects", [Effects(), EFFECTS])
def test_the_observer_finds_the_cars_own_states(effects: Effects) -> None:
    """From a wrong start, along measurements without noise."""
    model, duration = EquationsStepModel(CARS["coupe"], effects), 1.0
    u, u_next = np.array([0.04, 80.0]), np.array([0.08, 160.0])
    plant = EquationsPlant(CARS["coupe"], effects)
    builder, source = on_a_ramp(plant, u, u_next, duration)
    observer = model.observer(0.01)
    assert isinstance(observer, InternalStateObserver)
    builder.AddSystem(observer)
    measured = builder.AddSystem(Multiplexer([6, 1]))
    for i, name in enumerate(("state", "path_position")):
        builder.Connect(plant.GetOutputPort(name), measured.get_input_port(i))
    builder.Connect(measured.get_output_port(), observer.GetInputPort("measured_state"))
    builder.Connect(source.get_output_port(), observer.GetInputPort("command"))
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    start = np.concatenate([[0.1, 12.0, -0.02, 12.3], np.zeros(6), model.settled(np.array([0.5, 12, -0.1, 14]), u)])
    plant.GetMyMutableContextFromRoot(context).SetContinuousState(start)
    internal = observer.get_output_port().Eval(observer.GetMyContextFromRoot(context))
    assert np.abs((internal - start[10:]) / OWN_SCALE).max() > 0.1
    integrated(diagram, context, duration)
    internal = observer.get_output_port().Eval(observer.GetMyContextFromRoot(context))
    end = plant.GetMyContextFromRoot(context).get_continuous_state_vector().CopyToVector()
    at_once = model.follows_at_once()  # what the car does not have
    assert at_once.sum() == (2 if effects == Effects() else 0)
    np.testing.assert_allclose(((internal - end[10:]) / OWN_SCALE)[~at_once], 0.0, atol=2e-3)


def test_magnitudes_are_taken_over() -> None:
    model = EquationsStepModel(CARS["coupe"]).with_theta(np.array(EFFECTS))
    wanted = EquationsStepModel(CARS["coupe"], EFFECTS)
    x = points(wanted)
    np.testing.assert_array_equal(model.step(x, U, U_NEXT, CURVATURE), wanted.step(x, U, U_NEXT, CURVATURE))


def test_effects_beyond_it_are_refused() -> None:
    with pytest.raises(ValueError, match="steering_delay cannot be part of a one-step model"):
        EquationsStepModel(CARS["coupe"], Effects(steering_delay=0.1))
    with pytest.raises(InvalidVehicleError, match="lateral_load_transfer cannot be put on a double-track car"):
        EquationsStepModel(CARS["coupe"], Effects(lateral_load_transfer=0.1))


def test_it_drives_the_double_track_car() -> None:
    """Through the first transition of the figure-8, much nearer to it than the nominal car does."""
    parameters = VehicleParameters()
    course = dataclasses.replace(figure_8(parameters), distance=58.0)
    control = ControlConfig(horizon=16, period=0.05, delay=0.05)
    found: list[RunMetrics] = []
    for model in (known_car_model(CARS["coupe"], EFFECTS), NominalStepModel(parameters)):
        plant = plant_of_car(CARS["coupe"], EFFECTS, course.path)
        loop = ClosedLoop(parameters, course, model, EFFECTS, control=control, plant=plant)
        found.append(loop.run(loop.initial_context(0)).metrics())
    oracle, nominal = found
    assert oracle.completed
    assert oracle.drifting > 0.9
    assert oracle.rms_e < 0.25
    assert not nominal.completed or nominal.rms_e > 2.0 * oracle.rms_e
