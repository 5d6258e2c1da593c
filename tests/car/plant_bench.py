"""Plants in a state, under commands and integrated, for their tests."""

from pathlib import Path as FilePath

import numpy as np
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.reference.path import Path

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
