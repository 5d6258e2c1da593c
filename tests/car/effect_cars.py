"""Cars with effects in states in which one of them shows, for the tests of their physical meaning."""

import math
from functools import cache

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensors import NoiseLevels
from drift_drake.car.single_track.plant import VehiclePlant
from drift_drake.drive.loop.car import Car

P = VehicleParameters()
WHEELBASE = P.front_axle_distance + P.rear_axle_distance
WEIGHT = P.mass * P.gravity
ROLLING_MASS = P.mass + P.rear_axle_inertia / P.wheel_radius**2  # the rear wheels' inertia moves along

# Speeds chosen so that nothing is at a floor.
COASTING = (0.0, 12.0, 0.0, 12.0, 0.0, 0.0)  # straight on, wheels rolling freely
WHEELSPIN = (0.0, 10.0, 0.0, 25.0, 0.0, 0.0)  # the rear axle slides forwards, the front rolls freely
SIDEWAYS = (0.0, 10.0, 0.5 * math.pi, 0.0, 0.0, 0.5 * math.pi)  # rear wheels locked: both axles slide to the left
DRIFTING = (0.7, 12.7, -0.6, 17.5, 0.0, 0.0)
HEAVY = P.replace(mass=1e9, yaw_inertia=1e9)  # a car on rails: forces show, motion does not change


def plant_of(effects, parameters=P):
    return VehiclePlant(parameters, make_effects(effects))


def at_rest_of(plant, state, actuation=(0.0, 0.0), wrench=None, internal=None, pose=None):
    """A Context of the plant in a state, its internal states settled or as given."""
    context = plant.CreateDefaultContext()
    plant.set_initial(context, state, pose=pose, actuation=actuation)
    plant.GetInputPort("actuation").FixValue(context, np.array(actuation, dtype=float))
    if wrench is not None:
        plant.GetInputPort("disturbance").FixValue(context, np.array(wrench))
    for name, value in (internal or {}).items():
        context.get_mutable_continuous_state_vector()[plant.state_names.index(name)] = value
    return context


def rates_of(effects, state, actuation=(0.0, 0.0), parameters=P, **keywords):
    plant = plant_of(effects, parameters)
    context = at_rest_of(plant, state, actuation, **keywords)
    return plant.state_view(plant.EvalTimeDerivatives(context).CopyToVector())


def acceleration_of(effects, state, actuation=(0.0, 0.0), parameters=P, **keywords):
    plant = plant_of(effects, parameters)
    return plant.GetOutputPort("acceleration").Eval(at_rest_of(plant, state, actuation, **keywords))


def simulate(effects, state, duration, actuation=(0.0, 0.0), parameters=P, settled=None, **keywords):
    """(state, a_x, a_y) after `duration` under a constant actuation, internal states settled at `settled` before."""
    plant = plant_of(effects, parameters)
    context = at_rest_of(plant, state, actuation if settled is None else settled, **keywords)
    plant.GetInputPort("actuation").FixValue(context, np.array(actuation, dtype=float))
    simulator = Simulator(plant, context)
    simulator.get_mutable_integrator().set_target_accuracy(1e-8)
    simulator.AdvanceTo(duration)
    view = plant.state_view(context.get_continuous_state_vector().CopyToVector())
    return view, *plant.GetOutputPort("acceleration").Eval(context)


def driven_car(effects, commands, duration):
    """Logs each millisecond of a noiseless car: true states and measured columns, under (t, delta, tau) rows."""
    return _driven_car(make_effects(effects), tuple(commands), duration)


@cache
def _driven_car(effects, commands, duration):
    builder = DiagramBuilder()
    car = builder.AddNamedSystem("car", Car(P, effects, noise=NoiseLevels.none()))
    times, *columns = np.array(commands, dtype=float).T
    source = builder.AddNamedSystem("command", TrajectorySource(PiecewisePolynomial.FirstOrderHold(times, columns)))
    builder.Connect(source.get_output_port(), car.GetInputPort("command"))
    names = ("measured_state", "log_row", "state", "pose", "path_position", "acceleration")
    logs = {name: LogVectorOutput(car.GetOutputPort(name), builder, 0.001) for name in names}
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    car.plant.set_initial(car.plant.GetMyMutableContextFromRoot(context), COASTING)
    simulator = Simulator(diagram, context)
    simulator.get_mutable_integrator().set_target_accuracy(1e-9)
    simulator.AdvanceTo(duration)
    return {name: log.FindLog(context).data() for name, log in logs.items()}
