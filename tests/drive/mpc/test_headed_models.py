"""A road's grade in the plan: step models on a path of some heading, and a drift held up and down hill."""

import dataclasses

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from drift_drake.car.brush.parameters import BrushParameters
from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.known_car import known_car_model, plant_of_car
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.drive.learnt.hybrid_step import HybridStepModel, load_hybrid
from drift_drake.drive.loop.closed_loop import ClosedLoop
from drift_drake.drive.reference.path import Path
from drift_drake.drive.reference.trajectory import figure_8

SLOPE = Effects(road_grade=0.06, steering_lag=0.05)
BEND = Path([0.0, 100.0], [0.04, 0.04], (0.0, 0.0, 1.0))
S, STATE, COMMAND = 20.0, np.array([0.5, 12.0, -0.3, 14.0, 0.2, 0.05]), np.array([-0.1, 150.0])
KINDS = [VehicleParameters(), CARS["coupe"], BrushParameters()]
BY_KIND = pytest.mark.parametrize("car", KINDS, ids=["single track", "double track", "brush"])


def points(car: CarParameters, count: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States, settled, with commands and curvatures of the bend."""
    own = known_car_model(car, SLOPE).settled(STATE[:4], COMMAND)
    return np.tile([*STATE, *own], (count, 1)), np.tile(COMMAND, (count, 1)), np.full(count, 0.04)


@BY_KIND
def test_a_step_on_a_slope_is_the_plants_motion(car: CarParameters) -> None:
    plant = plant_of_car(car, SLOPE, BEND)
    context = plant.CreateDefaultContext()
    plant.set_initial(context, STATE, s=S, actuation=COMMAND)
    plant.GetInputPort("actuation").FixValue(context, COMMAND)
    x, u, curvature = points(car)
    x[0, 6:] = context.get_continuous_state_vector().CopyToVector()[10:]  # settled on the slope
    simulator = Simulator(plant, context)
    simulator.get_mutable_integrator().set_target_accuracy(1e-8)
    simulator.AdvanceTo(0.1)
    end = context.get_continuous_state_vector().CopyToVector()[:6]
    model = known_car_model(car, SLOPE)
    assert model.headed
    on_slope = model.along(np.array([BEND.heading(S + 0.6)])).step(x, u, u, curvature)[0, :6]
    np.testing.assert_allclose(on_slope, end, atol=1.5e-3)
    assert abs(model.step(x, u, u, curvature)[0, 1] - end[1]) > 0.05  # as if the path went along the fixed frame's x


@BY_KIND
def test_its_slopes_are_those_of_each_stages_heading(car: CarParameters) -> None:
    x, u, curvature = points(car, 3)
    x += 1e-3 * np.random.default_rng(0).standard_normal(x.shape)
    model = known_car_model(car, SLOPE).along(np.array([0.0, 1.5, 3.0]))
    _, *found = model.linearize(x, u, u, curvature)
    _, *wanted = super(type(model), model).linearize(x, u, u, curvature)
    for a, b in zip(found, wanted, strict=True):
        np.testing.assert_allclose(a, b, atol=0.01 * np.abs(b).max())
    uphill = model.step(x, u, u, curvature)[:, 1]
    assert uphill[0] < uphill[1] < uphill[2]  # up, across, down


def test_a_hybrid_model_hands_the_heading_to_its_car() -> None:
    car, learnt = known_car_model(VehicleParameters(), SLOPE), load_hybrid()
    model = HybridStepModel(learnt, learnt.prior_mean, car)
    x, u, curvature = points(VehicleParameters())
    assert model.headed
    up, down = (model.along(np.array([heading])).step(x, u, u, curvature)[0, 1] for heading in (0.0, np.pi))
    alone = [car.along(np.array([heading])).step(x, u, u, curvature)[0, 1] for heading in (0.0, np.pi)]
    assert up - down == pytest.approx(alone[0] - alone[1])


def test_internal_states_are_run_on_without_what_depends_on_the_heading() -> None:
    car = VehicleParameters()
    x, u, _ = points(car)
    flat = known_car_model(car, Effects(steering_lag=0.05)).run_on(x[0], u[0], u[0], 0.05)
    np.testing.assert_array_equal(known_car_model(car, SLOPE).run_on(x[0], u[0], u[0], 0.05), flat)


def test_a_drift_on_a_slope_is_held_as_on_the_flat() -> None:
    car, slope = VehicleParameters(), Effects(road_grade=0.06)
    errors, course = [], dataclasses.replace(figure_8(VehicleParameters()), distance=180.0)
    for effects, believed in ((Effects(), Effects()), (slope, slope), (slope, Effects())):
        loop = ClosedLoop(car, course, model=known_car_model(car, believed), effects=effects)
        run = loop.run(loop.initial_context(seed=0))
        assert run.outcome == "completed"
        errors.append(run.metrics().rms_e)
    flat, planned, left_out = errors
    assert planned < 1.3 * flat
    assert left_out > 1.5 * flat
