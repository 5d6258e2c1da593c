"""Readings that are late, run on to the present."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Demultiplexer

from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.known_car import known_car_model, plant_of_car
from drift_drake.car.latency import LatencyCompensation, at_present
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.car.sensor_errors import sensor_errors
from drift_drake.car.sensors import TransportDelay
from drift_drake.car.step_model import NominalStepModel
from drift_drake.common.arrays import Array
from drift_drake.drive.loop.closed_loop import ClosedLoop
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.reference.trajectory import Reference, figure_8
from experiments.benchmarks.vehicles import draw_effects

CAR = VehicleParameters()
EFFECTS = Effects(steering_lag=0.06, torque_lag=0.1, tyre_relaxation=0.3, friction_level=-0.05)
COMMAND = np.array([-0.05, 150.0])


@pytest.fixture(scope="module")
def course() -> Reference:
    return figure_8(CAR)


@pytest.mark.parametrize("latency", [0.004, 0.03, 0.047, 0.1])
@pytest.mark.parametrize("car", [CAR, DoubleTrackParameters()])
def test_the_present_is_the_plants(course: Reference, car: CarParameters, latency: float) -> None:
    """A plant on a bend, its position on the path too, after its commands have changed."""
    path = course.path
    builder = DiagramBuilder()
    plant = builder.AddSystem(plant_of_car(car, EFFECTS, path))
    command = builder.AddSystem(ConstantVectorSource(COMMAND))
    late = builder.AddSystem(TransportDelay(7, latency))
    ahead = builder.AddSystem(LatencyCompensation(known_car_model(car, EFFECTS), latency, path))
    builder.Connect(command.get_output_port(), plant.GetInputPort("actuation"))
    builder.Connect(command.get_output_port(), ahead.GetInputPort("command"))
    state = plant.GetOutputPort("full_state")
    split = builder.AddSystem(Demultiplexer([7, state.size() - 7]))
    builder.Connect(state, split.get_input_port())
    builder.Connect(split.get_output_port(0), late.get_input_port())
    builder.Connect(late.get_output_port(), ahead.GetInputPort("measured_state"))
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    start = course.state(0.0) + np.array([0.0, 0.0, 0.0, 0.0, 0.3, 0.05])
    plant.set_initial(plant.GetMyMutableContextFromRoot(context), start, 0.0, actuation=tuple(COMMAND))
    simulator = Simulator(diagram, context)
    simulator.get_mutable_integrator().set_target_accuracy(1e-8)
    simulator.AdvanceTo(0.6)
    true = state.Eval(plant.GetMyContextFromRoot(context))[:7]
    seen = late.get_output_port().Eval(late.GetMyContextFromRoot(context))
    found = ahead.get_output_port().Eval(ahead.GetMyContextFromRoot(context))
    assert np.abs(found - true).max() < 0.02 * np.abs(seen - true).max()


def test_no_reading_stays_none_and_what_follows_is_as_ever(course: Reference) -> None:
    model = known_car_model(CAR, EFFECTS)
    system, bad = LatencyCompensation(model, 0.03, course.path), np.full(7, np.nan)
    fresh, after = system.CreateDefaultContext(), system.CreateDefaultContext()
    reading = np.append(course.state(0.0), 1.0)

    def present(context: Context, measured: Array, t: float) -> Array:
        context.SetTime(t)
        system.GetInputPort("measured_state").FixValue(context, measured)
        system.GetInputPort("command").FixValue(context, COMMAND)
        return np.array(system.get_output_port().Eval(context))

    assert np.isnan(present(after, bad, 0.0)).all()
    after.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(after))
    np.testing.assert_array_equal(present(after, reading, 0.01), present(fresh, reading, 0.0))


def test_a_car_that_nobody_knows_has_its_reading_as_it_is(course: Reference) -> None:
    builder = DiagramBuilder()
    port = builder.AddSystem(ConstantVectorSource(np.zeros(7))).get_output_port()
    command = builder.AddSystem(ConstantVectorSource(COMMAND)).get_output_port()
    assert at_present(builder, port, command, 0.1, NominalStepModel(CAR), course.path, 0.01) is port
    assert at_present(builder, port, command, 0.0, known_car_model(CAR, EFFECTS), course.path, 0.01) is port


def test_a_latency_that_is_known_is_driven_with(course: Reference) -> None:
    """Of 0.1 s: the car spins with readings as they come."""
    effects = draw_effects("validation", 0, 31)._replace(sensor_latency=0.1)
    outcomes = []
    for known in (Effects(), sensor_errors(effects)):
        loop = ClosedLoop(CAR, course, known_car_model(CAR, effects), effects, sensor_errors=known)
        run = loop.run(loop.initial_context(0), RunLimits(time_factor=0.35))
        outcomes.append((run.outcome, float(run.table["e"].abs().max())))
    assert outcomes[0][0] == "spin"
    assert outcomes[1][0] == "time is up"
    assert outcomes[1][1] < 0.3
