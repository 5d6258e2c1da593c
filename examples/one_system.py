"""One system without the others: an actuator under a forced update, and the plant under a Simulator."""

import numpy as np
from pydrake.systems.analysis import Simulator

from drift_drake import LinearInterpolationActuator, Plan, VehicleParameters, VehiclePlant


def refused_plans(car: VehicleParameters) -> float:
    """How many plans the actuator refused, of one that is finite and one that is not."""
    actuator = LinearInterpolationActuator(car, steps=2)  # plans of two steps of 0.1 s
    context = actuator.CreateDefaultContext()
    plan = Plan(0.0, np.array([[0.0, 0.0], [0.1, 50.0], [0.2, 50.0]]))  # (delta [rad], tau [N m]) each 0.1 s
    actuator.GetInputPort("plan").FixValue(context, plan.vector())
    discrete = actuator.AllocateDiscreteVariables()
    actuator.CalcForcedDiscreteVariableUpdate(context, discrete)
    assert actuator.GetOutputPort("plan_age").Eval(context) == [np.inf]  # the Context is as it was
    context.SetDiscreteState(discrete)
    context.SetTime(0.1)
    np.testing.assert_allclose(actuator.GetOutputPort("command").Eval(context), [0.1, 50.0])
    actuator.GetInputPort("plan").FixValue(context, np.append(0.1, np.full(6, np.inf)))
    context.SetDiscreteState(actuator.EvalUniquePeriodicDiscreteUpdate(context))
    return float(actuator.GetOutputPort("refused").Eval(context)[0])


def turned(car: VehicleParameters) -> float:
    """The plant's yaw rate [rad/s] after half a second with the wheels turned to the left."""
    plant = VehiclePlant(car)  # its state is continuous: derivatives are evaluated, or time runs
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    plant.set_initial(context, [0.0, 15.0, 0.0, 15.0, 0.0, 0.0], 0.0)
    plant.GetInputPort("actuation").FixValue(context, [0.05, 0.0])
    simulator.AdvanceTo(0.5)
    return float(plant.GetOutputPort("state").Eval(context)[0])


if __name__ == "__main__":
    print(refused_plans(VehicleParameters()), turned(VehicleParameters()))
