"""Your own diagram: a system of yours drives `Car`, whose command must be a state."""

from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from drift_drake import Car, VehicleParameters, make_effects


class HoldCourse(LeafSystem):  # against the yaw rate, at 15 m/s
    def __init__(self) -> None:
        super().__init__()
        self.measured = self.DeclareVectorInputPort("measured_state", 7)
        self.DeclareStateOutputPort("command", self.DeclareDiscreteState(2))
        self.DeclarePeriodicDiscreteUpdateEvent(0.01, 0.0, self.update)

    def update(self, context: Any, discrete: Any) -> None:
        r, v, *_ = self.measured.Eval(context)
        discrete.set_value([np.clip(-0.5 * r, -0.3, 0.3), np.clip(40.0 * (15.0 - v), -50.0, 300.0)])


def main(seconds: float = 3.0) -> Any:
    """The state (r, v, beta, omega_r) at the end."""
    builder = DiagramBuilder()
    driver = builder.AddNamedSystem("driver", HoldCourse())
    real = builder.AddNamedSystem("car", Car(VehicleParameters(), make_effects({"steering_delay": 0.05})))
    builder.Connect(real.GetOutputPort("measured_state"), driver.GetInputPort("measured_state"))
    builder.Connect(driver.GetOutputPort("command"), real.GetInputPort("command"))
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    real.plant.set_initial(real.plant.GetMyMutableContextFromRoot(context), [0.3, 12.0, 0.0, 12.0, 0.0, 0.0], 0.0)
    real.sensors.set_seed(context, 1)
    simulator.AdvanceTo(seconds)
    return real.GetOutputPort("state").Eval(real.GetMyContextFromRoot(context))[:4]


if __name__ == "__main__":
    print(main())
