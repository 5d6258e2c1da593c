"""One system without the others: actuator and adapter under forced updates, and the plant under a Simulator."""

import numpy as np
from pydrake.systems.analysis import Simulator

from drift_drake import BayesianAdapter, LinearInterpolationActuator, Plan, VehicleParameters, VehiclePlant, load_model


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
    np.testing.assert_allclose(actuator.GetOutputPort("command").Eval(context), [0.1, 50.0])
    (refused,) = actuator.GetOutputPort("refused").Eval(context)
    return float(refused)


def turned(car: VehicleParameters) -> float:
    """The plant's yaw rate [rad/s] after half a second with the wheels turned to the left."""
    plant = VehiclePlant(car)  # its state is continuous: derivatives are evaluated, or time runs
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    plant.set_initial(context, [0.0, 15.0, 0.0, 15.0, 0.0, 0.0], 0.0)
    plant.GetInputPort("actuation").FixValue(context, [0.05, 0.0])
    assert plant.EvalTimeDerivatives(context).CopyToVector()[0] > 0.0  # it begins to turn to the left
    simulator.AdvanceTo(0.5)
    return float(plant.GetOutputPort("state").Eval(context)[0])


def learnt_samples() -> float:
    """How many samples the adapter takes of two readings 0.1 s apart, from which its belief changes."""
    adapter = BayesianAdapter(load_model())
    context = adapter.CreateDefaultContext()
    prior = adapter.GetOutputPort("posterior_mean").Eval(context)
    for t, v in ((0.0, 15.0), (0.1, 14.9)):
        context.SetTime(t)
        adapter.GetInputPort("measured_state").FixValue(context, [0.0, v, 0.0, v, 0.0, 0.0, 15.0 * t])
        adapter.GetInputPort("command").FixValue(context, [0.0, 0.0])
        adapter.GetInputPort("lagged_command").FixValue(context, [0.0, 0.0])
        adapter.ExecuteForcedEvents(context)
    assert not np.array_equal(adapter.GetOutputPort("posterior_mean").Eval(context), prior)
    return float(adapter.GetOutputPort("counters").Eval(context)[0])


def main() -> tuple[float, float, float]:
    """What each of the three gives."""
    car = VehicleParameters()
    return refused_plans(car), turned(car), learnt_samples()


if __name__ == "__main__":
    print(main())
