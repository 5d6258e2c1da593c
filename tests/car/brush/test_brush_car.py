"""The brush car as a plant, as a step model, in a file, and as a simulator of its own logs."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.car.brush.parameters import BrushParameters
from drift_drake.car.car_file import read_car
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations_plant import EquationsPlant
from drift_drake.car.equations_step import EquationsStepModel
from drift_drake.car.known_car import known_car_model
from drift_drake.car.parameters import InvalidVehicleError
from drift_drake.car.vehicle_file import read_vehicle, write_vehicle

CAR, EFFECTS = BrushParameters(), Effects(steering_lag=0.06, torque_lag=0.1, friction_level=-0.1, mass_error=0.05)


def test_a_car_takes_a_gentle_turn_as_its_single_track_says() -> None:
    """Its wheels yielding to nothing, its differential open."""
    car = CAR.replace(front_compliance=0.0, rear_compliance=0.0, roll_steer=0.0, lock=0.0, lock_least=0.0)
    p, length = car.single_track(), car.front_axle_distance + car.rear_axle_distance
    plant = EquationsPlant(car)
    context = plant.CreateDefaultContext()
    plant.set_initial(context, [0.0, 6.0, 0.0, 6.0, 0.0, 0.0])
    thrust = (car.rolling_resistance * car.mass * car.gravity + car.aero_drag * 36.0) * car.wheel_radius
    plant.GetInputPort("actuation").FixValue(context, [0.01, thrust / car.gear_ratio])
    simulator = Simulator(plant, context)
    simulator.AdvanceTo(4.0)
    r, v = context.get_continuous_state_vector().CopyToVector()[:2]
    understeer = p.mass / length * (p.rear_axle_distance / p.front_stiffness - p.front_axle_distance / p.rear_stiffness)
    assert r == pytest.approx(v * 0.01 / (length + understeer * v * v), rel=0.01)


def test_its_step_is_the_plants_motion_with_its_slopes() -> None:
    model = EquationsStepModel(CAR, EFFECTS)
    x, u, u_next = np.array([[0.7, 12.7, -0.5, 17.0, 0.2, 0.05]]), np.array([[-0.4, 168.0]]), np.array([[-0.35, 190.0]])
    x, curvature = np.hstack([x, model.settled(x[0, :4], u[0])[None]]), np.full(1, 0.05)
    plant = EquationsPlant(CAR, EFFECTS)
    builder = DiagramBuilder()
    builder.AddSystem(plant)
    ramp = PiecewisePolynomial.FirstOrderHold([0.0, 0.1], np.column_stack([u[0], u_next[0]]))
    source = builder.AddSystem(TrajectorySource(ramp))
    builder.Connect(source.get_output_port(), plant.GetInputPort("actuation"))
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    own.SetContinuousState(np.concatenate([x[0, :6], np.zeros(4), x[0, 6:]]))
    plant.GetInputPort("curvature").FixValue(own, curvature)
    simulator = Simulator(diagram, context)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.01).set_target_accuracy(1e-8)
    simulator.AdvanceTo(0.1)
    end = own.get_continuous_state_vector().CopyToVector()
    expected = np.concatenate([end[:6], end[10:]])
    np.testing.assert_allclose(model.step(x, u, u_next, curvature)[0], expected, rtol=1e-3, atol=1e-3)
    x_next, by_x, by_u, by_u_next = model.linearize(x, u, u_next, curvature)
    np.testing.assert_allclose(x_next[0], expected, rtol=1e-3, atol=1e-3)
    _, *differences = super(EquationsStepModel, model).linearize(x, u, u_next, curvature)
    for found, wanted in zip((by_x, by_u, by_u_next), differences, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=0.05, atol=0.01 * np.abs(wanted).max())


def test_a_step_is_as_long_as_it_is_asked_to_be() -> None:
    """A small car's plan has short steps: as the motion of a long step's model over that time."""
    car = known_car_model(CAR, EFFECTS, 0.04)
    assert car.dt == car.with_effects(EFFECTS).dt == 0.04
    x, u, u_next = np.array([[0.7, 12.7, -0.5, 17.0, 0.2, 0.05]]), np.array([[-0.4, 168.0]]), np.array([[-0.35, 190.0]])
    x = np.hstack([x, car.settled(x[0, :4], u[0])[None]])
    expected = EquationsStepModel(CAR, EFFECTS).run_on(x[0], u[0], u_next[0], 0.04)
    np.testing.assert_allclose(car.step(x, u, u_next, np.zeros(1))[0], expected, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(car.linearize(x, u, u_next, np.zeros(1))[0][0], expected, rtol=1e-4, atol=1e-5)


def test_a_file_is_read_back_to_the_same_car(tmp_path: Path) -> None:
    car = CAR.replace(cg_height=0.45, vectoring=1500.0)
    write_vehicle(tmp_path / "car.yaml", car, EFFECTS)
    assert read_car(tmp_path / "car.yaml") == (car, EFFECTS)
    with pytest.raises(InvalidVehicleError, match="holds a brush car, which 'drift-drake identify'"):
        read_vehicle(tmp_path / "car.yaml")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"track": 9.0}, "track is 9 m; no vehicle's of this wheelbase is outside 0.25 to 7.4 m"),
        ({"lock_share": 1.2e1}, "lock_share is 12, 12 times the axle's torque; no vehicle's is more than 10 times"),
        ({"pitch_time": 1e-6}, "with this pitch_time the car settles in 1 microseconds"),
        ({"sliding_friction": 1.5}, "brush: sliding_friction is 1.5; give a share, 1 at most"),
        ({"cg_height": -0.1}, "brush: cg_height is -0.1; give zero or more"),
        ({"mass": "heavy"}, "mass (m) is 'heavy'; give a finite number in kg"),
        ({"wing": 1.0}, "unknown key 'wing'"),
    ],
)
def test_what_no_car_has_is_refused_with_the_place(tmp_path: Path, changes: dict[str, object], said: str) -> None:
    data = {"brush": {**dataclasses.asdict(CAR), **changes}}
    (tmp_path / "car.yaml").write_text(yaml.safe_dump(data))
    with pytest.raises(InvalidVehicleError) as error:
        read_car(tmp_path / "car.yaml")
    assert str(error.value).startswith(f"{tmp_path / 'car.yaml'}: ")
    assert said in str(error.value)


def test_an_effect_that_it_cannot_have_is_refused(tmp_path: Path) -> None:
    write_vehicle(tmp_path / "car.yaml", CAR, Effects(lateral_load_transfer=0.1))
    with pytest.raises(InvalidVehicleError, match="lateral_load_transfer cannot be put on a brush car"):
        read_car(tmp_path / "car.yaml")
