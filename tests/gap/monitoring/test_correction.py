"""The policy: what the controller believes after a verdict, and what readings lose."""

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import COUNT, Effects, make_effects
from drift_drake.gap.monitoring.correction import GapCorrection, corrected


def posterior(monitor, **probabilities: float) -> np.ndarray:
    return np.array([probabilities.get(name, 0.0) for name in monitor.labels])


def test_the_most_probable_cause_is_taken_until_the_simulator_is_believed_again(monitor):
    nothing = np.zeros(COUNT)
    assert not corrected(nothing, monitor.labels, posterior(monitor, friction_level=0.9, none=0.1), -0.2).any()
    taken = corrected(nothing, monitor.labels, posterior(monitor, friction_level=0.4, unknown=0.3), -0.2)
    assert Effects(*taken) == make_effects({"friction_level": -0.2})
    doubted = corrected(taken, monitor.labels, posterior(monitor, friction_level=0.4, unknown=0.6), -0.3)
    np.testing.assert_array_equal(doubted, taken)
    followed = corrected(taken, monitor.labels, posterior(monitor, friction_level=0.9), -0.25)
    assert Effects(*followed).friction_level == -0.25
    assert not corrected(taken, monitor.labels, posterior(monitor, none=0.9, mass_error=0.1), 0.1).any()


@pytest.mark.parametrize("name", ["steering_delay", "sensor_latency", "unknown"])
def test_what_no_model_can_take_changes_nothing(monitor, name):
    assert not corrected(np.zeros(COUNT), monitor.labels, posterior(monitor, **{name: 1.0}), 0.1).any()


def test_a_correction_comes_to_what_a_calibrated_car_has(monitor):
    system = GapCorrection(monitor, make_effects({"steering_lag": 0.05, "friction_level": -0.1}))
    context = system.CreateDefaultContext()
    system.GetInputPort("posterior").FixValue(context, posterior(monitor, friction_level=1.0))
    system.GetInputPort("magnitude").FixValue(context, [-0.2, -0.3, -0.1])
    context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    found = Effects(*system.GetOutputPort("effects").Eval(context))
    assert found.steering_lag == 0.05
    assert found.friction_level == pytest.approx(-0.3)


def test_the_system_holds_a_correction(monitor):
    system = GapCorrection(monitor)
    context = system.CreateDefaultContext()
    system.GetInputPort("posterior").FixValue(context, posterior(monitor, sideslip_bias=0.96, none=0.04))
    system.GetInputPort("magnitude").FixValue(context, [0.02, 0.01, 0.03])
    system.GetInputPort("measured_state").FixValue(context, [0.5, 11.0, -0.4, 14.0, 0.1, 0.05, 3.0])
    assert system.GetOutputPort("corrected_state").Eval(context)[2] == -0.4
    context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    assert system.GetOutputPort("corrected_state").Eval(context)[2] == pytest.approx(-0.42)
    assert not system.GetOutputPort("effects").Eval(context).any()
