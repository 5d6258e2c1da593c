"""Other programs' cars that are stepped: what they are against their own programs, and that they are driven."""

import dataclasses
import math

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.foreign.stepped_plant import SteppedPlant, WorldMotion
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.loop.closed_loop import ClosedLoop
from drift_drake.drive.reference.trajectory import figure_8
from experiments.other_worlds.changing_car import ChangingCar
from experiments.other_worlds.true_cars import effects_in, oracle, true_car, true_plant

START, POSE, COMMAND = (0.3, 11.0, -0.15, 11.4), (3.0, -2.0, 2.5), np.array([0.1, 120.0])
WORLDS = ("multi_body", "mujoco")


def made(world, vehicle=0):
    pytest.importorskip("vehiclemodels" if world == "multi_body" else "mujoco", reason="an extra: worlds")
    return true_car(world, vehicle, 5).made()


@pytest.mark.parametrize("world", WORLDS)
def test_a_car_starts_where_it_is_put(world: str) -> None:
    car = made(world)
    motion = car.motion(car.start(START, POSE, COMMAND))
    r, v, beta, omega_r = START
    np.testing.assert_allclose((motion.x, motion.y, motion.psi), POSE, atol=1e-9)
    assert math.hypot(motion.v_x, motion.v_y) == pytest.approx(v)
    assert math.atan2(motion.v_y, motion.v_x) - motion.psi == pytest.approx(beta)
    assert (motion.r, motion.omega_r) == (pytest.approx(r), pytest.approx(omega_r))


@pytest.mark.parametrize("world", WORLDS)
def test_a_step_depends_on_its_arguments_alone(world: str) -> None:
    car, other = made(world), made(world)
    own = car.start(START, POSE, COMMAND)
    for _ in range(50):
        own = car.step(own, COMMAND, np.zeros(3), 0.002)
    first = car.step(own, COMMAND, np.zeros(3), 0.002)
    car.step(car.start((0.0, 20.0, 0.0, 20.0), POSE, COMMAND), -COMMAND, np.ones(3), 0.01)
    np.testing.assert_array_equal(car.step(own, COMMAND, np.zeros(3), 0.002), first)
    np.testing.assert_array_equal(other.step(own, COMMAND, np.zeros(3), 0.002), first)


@pytest.mark.parametrize("world", WORLDS)
def test_a_wrench_acts_on_the_body(world: str) -> None:
    """The velocity of the body, in its own frame, changes by force over mass, after what the suspension takes."""
    car = made(world)
    motions = {}
    for name, wrench in {"none": (0, 0, 0), "along": (4000.0, 0, 0), "turning": (0, 0, 3000.0)}.items():
        own = car.start((0.0, 15.0, 0.0, 15.0), (0.0, 0.0, 0.0), np.zeros(2))
        for _ in range(100):
            own = car.step(own, np.zeros(2), np.array(wrench, dtype=float), 0.002)
        motions[name] = car.motion(own)
    faster = motions["along"].v_x - motions["none"].v_x
    assert 0.1 * 4000.0 / 1650.0 < faster < 0.25 * 4000.0 / 1650.0  # wheels have to be sped up too
    assert 0.0 < motions["turning"].r < 0.25 * 3000.0 / 2350.0  # the tyres hold against it


def test_the_multi_body_car_is_its_packages() -> None:
    car = made("multi_body", 1)
    from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

    from experiments.other_worlds import multi_body as mb

    own = car.start(START, POSE, COMMAND)
    p, expected = car._p, own.copy()

    def rates(x):
        f = np.array(vehicle_dynamics_mb(list(x), [(0.1 - x[mb.STEERING]) / mb.RACK, 120.0 * 10.6 / (p.m * p.R_w)], p))
        lock = np.clip(mb.LOCK * (x[25] - x[26]), -mb.LOCK_LIMIT, mb.LOCK_LIMIT) / p.I_y_w
        return f + np.concatenate([np.zeros(25), [-lock, lock], np.zeros(2)])

    for _ in range(20):
        k = rates(expected)
        expected = expected + 0.0005 * (k + rates(expected + 0.001 * k))
    found = own
    for _ in range(10):
        found = car.step(found, COMMAND, np.zeros(3), 0.002)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_a_wheel_that_stood_turns_again() -> None:
    car = made("multi_body", 1)
    from experiments.other_worlds import multi_body as mb

    ahead = np.array([0.0, 20.0])
    own = car.start((0.0, 11.0, 0.0, 11.0), POSE, ahead)
    own[list(mb.WHEELS)] = -1e-9  # as a step leaves a wheel that has lifted and stops
    for _ in range(300):
        own = car.step(own, ahead, np.zeros(3), 0.002)
    np.testing.assert_allclose(car._p.R_w * own[list(mb.WHEELS)], own[mb.V_X], rtol=0.05)


@pytest.mark.parametrize("world", WORLDS)
def test_the_nominal_car_drives_it_for_a_while(world: str) -> None:
    made(world)
    parameters = VehicleParameters()
    reference = dataclasses.replace(figure_8(parameters), distance=8.0)
    plant = true_plant(true_car(world, 0, 5), Effects(), reference.path)
    assert isinstance(plant, SteppedPlant)
    loop = ClosedLoop(parameters, reference, NominalStepModel(parameters), plant=plant)
    runs = [loop.run(loop.initial_context(seed=1)) for _ in range(2)]
    assert runs[0].outcome == "completed", runs[0].error
    kept = [run.table.drop(columns="solve_seconds") for run in runs]
    assert kept[0].equals(kept[1])  # a run replays to the bit


def test_what_nobody_knows_of_it_is_said() -> None:
    assert effects_in("mujoco", Effects(friction_level=-0.1, gyro_bias=0.01)) == Effects(gyro_bias=0.01)
    with pytest.raises(InvalidOptionError, match="nobody has the equations"):
        oracle(true_car("mujoco", 0, 5), VehicleParameters(), Effects())


@dataclasses.dataclass(frozen=True)
class Glider:
    """A car that moves as the command says: along by the torque, and turned to the steering."""

    factor: float = 1.0
    state_names = ("x", "steering")

    def start(self, _state, pose, actuation):
        return np.array([pose[0], actuation[0]])

    def step(self, own, actuation, _wrench, duration):
        return np.array([own[0] + self.factor * actuation[1] * duration, actuation[0]])

    def motion(self, own):
        return WorldMotion(own[0], 0.0, own[1], 0.0, 0.0, 0.0, 0.0)


def test_a_car_changes_for_a_while_and_back() -> None:
    car = ChangingCar(Glider(), Glider(10.0), 1.0, 2.0, torque=0.5, steering_rate=0.2)
    own, motions = car.start(START, (0.0, 0.0, 0.0), np.zeros(2)), []
    for k in range(24):
        own = car.step(own, np.array([0.1 if k < 8 else 0.4, 1.0]), np.zeros(3), 0.125)
        motions.append(car.motion(own))
    assert len(own) == len(car.state_names)
    assert [motions[k].x for k in (7, 15, 23)] == [1.0, 1.0 + 10.0 * 0.5, 6.0 + 1.0]
    np.testing.assert_allclose([motions[k].psi for k in (7, 8, 15, 16)], [0.1, 0.125, 0.3, 0.4])


@pytest.mark.parametrize("world", WORLDS)
def test_less_friction_stops_a_sliding_car_later(world: str) -> None:
    made(world)
    speeds = {}
    for factor in (1.0, 0.7):
        car = true_car(world, 0, 5).made(factor)
        own = car.start((0.0, 15.0, 0.0, 0.0), (0.0, 0.0, 0.0), np.zeros(2))
        for _ in range(100):
            own = car.step(own, np.array([0.0, -2000.0]), np.zeros(3), 0.002)
        speeds[factor] = 15.0 - car.motion(own).v_x
    assert 0.6 < speeds[0.7] / speeds[1.0] < 0.8
