"""What every simulated drive shares: the integrator's steps and the logs."""

import numpy as np
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, ZeroOrderHold

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.plant import VehiclePlant
from drift_drake.drive.loop.runner import make_simulator


def test_no_step_of_the_integrator_is_a_rest_of_rounding() -> None:
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", VehiclePlant(VehicleParameters()))
    command, held = builder.AddSystem(ConstantVectorSource([0.02, 40.0])), builder.AddSystem(ZeroOrderHold(0.01, 2))
    builder.Connect(command.get_output_port(), held.get_input_port())
    builder.Connect(held.get_output_port(), plant.GetInputPort("actuation"))
    diagram, times = builder.Build(), []
    context = diagram.CreateDefaultContext()
    plant.set_initial(plant.GetMyMutableContextFromRoot(context), [0.0, 12.0, 0.0, 12.0, 0.0, 0.0])
    make_simulator(diagram, context, (plant, lambda root: times.append(root.get_time()))).AdvanceTo(20.0)
    assert np.diff(times).min() > 1e-6
