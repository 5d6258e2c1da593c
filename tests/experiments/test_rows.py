"""The compiled rollout is the plant, integrated by another solver; and its delay is a shift of the commands."""

import numpy as np
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations_plant import EquationsPlant
from experiments.benchmarks.rows import PERIOD, advance, row_states, start

CAR = CARS["roadster"]
ROWS = 81
TIMES = PERIOD * np.arange(ROWS)
DELTA, TAU = 0.15 * np.sin(8.0 * TIMES), 40.0 + 100.0 * np.sin(9.0 * TIMES)
START = np.array([0.0, 12.0, 0.0, 12.0])


def rolled(effects, delta=DELTA):
    p = CAR.constants()
    z, _ = start(START, (delta[0], TAU[0]), p, effects)
    for row in range(ROWS - 1):
        z, acceleration = advance(z, row, delta, TAU, p, effects)
    return z, acceleration


def test_agrees_with_the_plant_in_drake():
    effects = Effects(steering_lag=0.06, torque_lag=0.1, road_grade=0.03, rear_stiffness_error=-0.2)
    z, acceleration = rolled(effects)
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", EquationsPlant(CAR, effects))
    commands = PiecewisePolynomial.FirstOrderHold(TIMES, np.stack([DELTA, TAU]))
    source = builder.AddNamedSystem("commands", TrajectorySource(commands))
    builder.Connect(source.get_output_port(), plant.GetInputPort("actuation"))
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    plant.set_initial(own, [*START, 0.0, 0.0], pose=(0.0, 0.0, 0.0), actuation=(DELTA[0], TAU[0]))
    simulator = Simulator(diagram, context)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.01).set_target_accuracy(1e-7)
    simulator.AdvanceTo(TIMES[-1])
    view = plant.state_view(plant.GetOutputPort("full_state").Eval(own))
    expected = [getattr(view, name) for name in row_states(CAR.constants())]
    np.testing.assert_allclose(z, expected, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(acceleration, plant.GetOutputPort("acceleration").Eval(own), rtol=1e-4, atol=1e-4)


def test_a_steering_delay_shifts_the_commands():
    late, _ = rolled(Effects(steering_delay=3 * PERIOD))
    shifted, _ = rolled(Effects(), np.concatenate([np.full(3, DELTA[0]), DELTA[:-3]]))
    np.testing.assert_allclose(late, shifted, rtol=1e-9, atol=1e-12)


def test_a_run_straight_on_starts_settled():
    p = CAR.constants()
    z, acceleration = start(np.array([0.0, 12.0, 0.0, 12.0]), (0.0, 0.0), p, Effects())
    later, later_acceleration = advance(z, 0, np.zeros(2), np.zeros(2), p, Effects())
    assert np.all(acceleration[0] < 0.0)
    np.testing.assert_allclose(later_acceleration, acceleration, atol=0.05)
    assert later[1] < z[1]
