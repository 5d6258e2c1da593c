"""The brush car in a closed loop: the rollout's equations, integrated by Drake."""

import numpy as np
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.on_path import PLANT_STATES
from experiments.benchmarks.rows import PERIOD
from experiments.other_worlds.brush_car import STATES, advance
from experiments.other_worlds.brush_drifters import draw_drifter
from experiments.other_worlds.brush_plant import OWN, BrushPlant
from experiments.other_worlds.brush_step import BrushStepModel

CAR, EFFECTS = draw_drifter(1, 7), Effects(steering_lag=0.06, torque_lag=0.1, friction_level=-0.1, mass_error=0.05)
ROWS = 121
TIMES = PERIOD * np.arange(ROWS)
DELTA, TAU = 0.2 * np.sin(5.0 * TIMES), 200.0 + 120.0 * np.sin(9.0 * TIMES)


def test_the_plant_is_the_rollout() -> None:
    z = np.zeros(len(STATES))
    z[STATES.index("u")] = 11.0
    z[STATES.index("rim_left")] = z[STATES.index("rim_right")] = 11.5
    z[STATES.index("steering")], z[STATES.index("torque")] = DELTA[0], TAU[0]
    start = z.copy()
    for row in range(ROWS - 1):
        z, acceleration = advance(z, row, DELTA, TAU, CAR, EFFECTS)
    builder = DiagramBuilder()
    plant = builder.AddSystem(BrushPlant(CAR, EFFECTS, None))
    source = builder.AddSystem(TrajectorySource(PiecewisePolynomial.FirstOrderHold(TIMES, np.stack([DELTA, TAU]))))
    builder.Connect(source.get_output_port(), plant.GetInputPort("actuation"))
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    own.SetContinuousState([0.0, 11.0, 0.0, 11.5, *np.zeros(6), 0.0, *start[8:]])
    simulator = Simulator(diagram, context)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.01).set_target_accuracy(1e-8)
    simulator.AdvanceTo(TIMES[-1])
    end = dict(zip((*PLANT_STATES, *OWN), own.get_continuous_state_vector().CopyToVector(), strict=True))
    u, w, r, psi, x, y, left, right = z[:8]
    expected = {"r": r, "v": np.hypot(u, w), "beta": np.arctan2(w, u), "psi": psi, "x": x, "y": y, "e": y,
                "omega_r": 0.5 * (left + right), "rim_difference": right - left,
                "dphi": psi + np.arctan2(w, u)}  # fmt: skip
    for name, value in (expected | dict(zip(STATES[8:], z[8:], strict=True))).items():
        np.testing.assert_allclose(end[name], value, rtol=1e-4, atol=1e-4, err_msg=name)
    np.testing.assert_allclose(plant.GetOutputPort("acceleration").Eval(own), acceleration, rtol=1e-3, atol=1e-3)
    assert abs(r) > 0.2


def test_a_disturbance_accelerates_and_turns_the_body() -> None:
    plant = BrushPlant(CAR, EFFECTS, None)
    context = plant.CreateDefaultContext()
    plant.set_initial(context, [0.5, 12.0, -0.1, 12.3, 0.0, 0.0], actuation=(0.05, 150.0))
    plant.GetInputPort("actuation").FixValue(context, [0.05, 150.0])
    free = plant.EvalTimeDerivatives(context).CopyToVector()
    plant.GetInputPort("disturbance").FixValue(context, [300.0, -500.0, 200.0])
    disturbed = plant.EvalTimeDerivatives(context).CopyToVector() - free
    mass = CAR.mass * (1.0 + EFFECTS.mass_error)
    along, across = 300.0 * np.cos(-0.1) - 500.0 * np.sin(-0.1), -500.0 * np.cos(-0.1) - 300.0 * np.sin(-0.1)
    np.testing.assert_allclose(
        disturbed[:3], [200.0 / CAR.yaw_inertia, along / mass, across / (12.0 * mass)], rtol=1e-6
    )


def test_it_starts_settled_in_its_turn() -> None:
    """All of the car's own states but the rims' difference stand still where they are put."""
    plant = BrushPlant(CAR, EFFECTS, None)
    context = plant.CreateDefaultContext()
    plant.set_initial(context, [0.5, 12.0, -0.1, 12.3, 0.0, 0.0], actuation=(0.05, 150.0))
    plant.GetInputPort("actuation").FixValue(context, [0.05, 150.0])
    rates = plant.EvalTimeDerivatives(context).CopyToVector()[len(PLANT_STATES) + 1 :]
    np.testing.assert_allclose(rates, 0.0, atol=0.05)
    end = context.get_continuous_state_vector().CopyToVector()
    assert end[len(PLANT_STATES)] == 0.5 * CAR.track


def test_its_oracles_step_is_the_plants_motion() -> None:
    model = BrushStepModel(CAR, EFFECTS)
    x, u, u_next = np.array([[0.7, 12.7, -0.5, 17.0, 0.2, 0.05]]), np.array([[-0.4, 168.0]]), np.array([[-0.35, 190.0]])
    x = np.hstack([x, model.settled(x[0, :4], u[0])[None]])
    plant = BrushPlant(CAR, EFFECTS, None)
    builder = DiagramBuilder()
    builder.AddSystem(plant)
    ramp = PiecewisePolynomial.FirstOrderHold([0.0, 0.1], np.column_stack([u[0], u_next[0]]))
    source = builder.AddSystem(TrajectorySource(ramp))
    builder.Connect(source.get_output_port(), plant.GetInputPort("actuation"))
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    own.SetContinuousState(np.concatenate([x[0, :6], np.zeros(4), x[0, 6:]]))
    plant.GetInputPort("curvature").FixValue(own, [0.05])
    simulator = Simulator(diagram, context)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.01).set_target_accuracy(1e-8)
    simulator.AdvanceTo(0.1)
    end = own.get_continuous_state_vector().CopyToVector()
    expected = np.concatenate([end[:6], end[10:]])
    np.testing.assert_allclose(model.step(x, u, u_next, np.full(1, 0.05))[0], expected, rtol=1e-3, atol=1e-3)


def test_every_third_car_has_an_open_differential() -> None:
    assert [draw_drifter(i, 3).lock == 0.0 for i in range(6)] == [True, False, False, True, False, False]
    assert draw_drifter(2, 3) == draw_drifter(2, 3)
    assert draw_drifter(2, 3) != draw_drifter(2, 4)
