"""A simulator as one may have it in Drake: a Diagram, here actuators that lag round a car on four wheels.

See drake_car.yaml. `make` builds it from its parameters, `set_state` puts what is measured into a Context.
"""

from collections.abc import Mapping

from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import FirstOrderLowPassFilter, PassThrough

from drift_drake.car.double_track.parameters import DoubleTrackParameters, TireParameters
from drift_drake.car.equations_plant import EquationsPlant

COUPE = DoubleTrackParameters()


def make(
    mass: float, yaw_inertia: float, front_axle: float, rear_axle: float, friction: float, front_tire: float,
    rear_tire: float, height: float, engine_lag: float,
) -> Diagram:  # fmt: skip
    """The Diagram: input ports commands (road-wheel angle [rad], engine torque [N m]) and wrench; output port state."""

    def tire(stiffness: float, of: TireParameters) -> TireParameters:
        return TireParameters(
            lateral_stiffness=stiffness, longitudinal_stiffness=of.longitudinal_stiffness * stiffness
            / of.lateral_stiffness, lateral_friction=of.lateral_friction * friction,
            longitudinal_friction=of.longitudinal_friction * friction,
        )  # fmt: skip

    car = COUPE.replace(
        mass=mass, yaw_inertia=yaw_inertia, front_axle_distance=front_axle, rear_axle_distance=rear_axle,
        cg_height=height, front_tire=tire(front_tire, COUPE.front_tire), rear_tire=tire(rear_tire, COUPE.rear_tire),
    )  # fmt: skip
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("car", EquationsPlant(car))
    actuators = builder.AddNamedSystem("actuators", FirstOrderLowPassFilter([0.02, engine_lag]))
    wrench = builder.AddNamedSystem("wrench", PassThrough(3))
    builder.ExportInput(actuators.get_input_port(), "commands")
    builder.ExportInput(wrench.get_input_port(), "wrench")
    builder.Connect(actuators.get_output_port(), plant.GetInputPort("actuation"))
    builder.Connect(wrench.get_output_port(), plant.GetInputPort("disturbance"))
    builder.ExportOutput(plant.GetOutputPort("state"), "state")
    builder.ExportOutput(plant.GetOutputPort("pose"), "pose")
    return builder.BuildDiagram() if hasattr(builder, "BuildDiagram") else builder.Build()


def set_state(system: Diagram, context: Context, start: Mapping[str, float]) -> None:
    """What is measured; the rest (roll, loads, slips) is where it is at the first instant, or as it has come to be."""
    plant, actuators = system.GetSubsystemByName("car"), system.GetSubsystemByName("actuators")
    of_plant = plant.GetMyMutableContextFromRoot(context)
    state = [start["r"], start["v"], start["beta"], start["omega_r"], 0.0, 0.0]
    if context.get_time() == 0.0:
        commands = system.GetInputPort("commands").Eval(context)
        actuators.set_initial_output_value(actuators.GetMyMutableContextFromRoot(context), commands)
        plant.set_initial(of_plant, state, actuation=commands)
    else:
        vector = of_plant.get_mutable_continuous_state_vector()
        for i, value in enumerate(state[:4]):
            vector.SetAtIndex(i, value)
