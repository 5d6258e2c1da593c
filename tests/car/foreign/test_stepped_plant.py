"""A stepped car's place on its path, its clones and replays, against a car whose motion is known."""

import math

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.primitives import ConstantVectorSource

from drift_drake.car.foreign.stepped_plant import PERIOD, SteppedPlant, WorldMotion
from drift_drake.car.on_path import PLANT_STATES
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.path_plant import MotionError
from drift_drake.drive.loop.car import Car
from drift_drake.drive.loop.drive import Drive
from drift_drake.drive.mpc.plan import Plan
from drift_drake.drive.reference.path import Path
from drift_drake.drive.reference.trajectory import figure_8

SPEED, RATE = 9.0, 0.5  # [m/s], [rad/s] of a car that goes round a circle with a constant sideslip
SIDESLIP = -0.4


class Rounding:
    """A car on a circle whatever its command; it speeds up by the steering as an acceleration."""

    state_names = ("x", "y", "psi", "v")

    def start(self, state, pose, _actuation):
        return np.array([*pose, state[1]])

    def step(self, own, actuation, _wrench, duration):
        x, y, psi, v = own
        v_next, course = v + float(actuation[0]) * duration, psi + SIDESLIP + 0.5 * RATE * duration
        mean = 0.5 * (v + v_next)
        return np.array([x + mean * math.cos(course) * duration, y + mean * math.sin(course) * duration,
                         psi + RATE * duration, v_next])  # fmt: skip

    def motion(self, own):
        x, y, psi, v = own
        v_x, v_y = v * math.cos(psi + SIDESLIP), v * math.sin(psi + SIDESLIP)
        return WorldMotion(x, y, math.remainder(psi, 2.0 * math.pi), RATE, v_x, v_y, v)


def driven(path, seconds, steering=0.0, s=0.0, e=0.3):
    plant = SteppedPlant(Rounding(), path)
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    plant.set_initial(context, [RATE, SPEED, SIDESLIP, SPEED, e, 0.0], s)
    plant.GetInputPort("actuation").FixValue(context, [steering, 0.0])
    simulator.AdvanceTo(seconds)
    return plant, context, dict(zip(PLANT_STATES, plant.GetOutputPort("full_state").Eval(context), strict=False))


def test_a_circle_is_driven_within_a_circle() -> None:
    """The path's circle has the car's centre, so that e stays, and s grows by the ratio of the radii."""
    radius = SPEED / RATE
    path = Path([0.0, 400.0], [1.0 / (radius + 0.3)] * 2)
    _, _, end = driven(path, 20.0)
    assert end["e"] == pytest.approx(0.3, abs=1e-3)
    assert end["dphi"] == pytest.approx(0.0, abs=1e-3)
    assert end["s"] == pytest.approx(20.0 * SPEED * (radius + 0.3) / radius, rel=1e-4)
    assert end["beta"] == pytest.approx(SIDESLIP, abs=1e-9)
    assert end["psi"] == pytest.approx(-SIDESLIP + 20.0 * RATE, abs=1e-3)  # without jumps
    assert (end["r"], end["v"], end["omega_r"]) == (RATE, pytest.approx(SPEED), pytest.approx(SPEED))


def test_accelerations_are_those_of_the_body() -> None:
    plant, context, end = driven(None, 1.0, steering=2.0, e=0.0)
    along, across = 2.0, (RATE * end["v"])
    expected = [along * math.cos(SIDESLIP) - across * math.sin(SIDESLIP),
                along * math.sin(SIDESLIP) + across * math.cos(SIDESLIP)]  # fmt: skip
    np.testing.assert_allclose(plant.GetOutputPort("acceleration").Eval(context), expected, atol=0.02)
    assert end["s"] == end["x"]


def test_a_clone_goes_on_as_the_original_does() -> None:
    reference = figure_8(VehicleParameters())
    plant, context, _ = driven(reference.path, 1.0)
    ends = []
    for one in (context, context.Clone()):
        simulator = Simulator(plant, one)
        simulator.AdvanceTo(2.0)
        ends.append(one.get_discrete_state(0).CopyToVector())
    np.testing.assert_array_equal(*ends)
    np.testing.assert_array_equal(ends[0], driven(reference.path, 2.0)[1].get_discrete_state(0).CopyToVector())


def test_it_is_a_car_with_sensors() -> None:
    car = Car(VehicleParameters(), plant=SteppedPlant(Rounding(), None))
    assert car.GetOutputPort("measured_state").size() == 7
    assert car.plant.state_names == (*PLANT_STATES, *Rounding.state_names)


def test_a_state_that_is_lost_ends_the_simulation() -> None:
    with pytest.raises(MotionError, match="no longer finite at 0 s"):
        driven(None, 1.0, steering=math.nan)
    assert PERIOD < 0.01


class Lost(Rounding):
    """The same, whose program loses its state where it has gone 3 m."""

    def step(self, own, actuation, wrench, duration):
        return super().step(own, actuation, wrench, duration) if own[0] < 3.0 else np.full_like(own, np.nan)


def test_a_drive_of_a_car_that_is_lost_keeps_what_came_before() -> None:
    driver = ConstantVectorSource(Plan(0.0, np.zeros((2, 2)), 0.1).vector())
    drive = Drive(VehicleParameters(), driver, 1, 0.1, None, (0.0, 0.0), plant=SteppedPlant(Lost(), None))
    table, ending = drive.run(np.array([RATE, SPEED, SIDESLIP, SPEED, 0.0, 0.0]), 0.0, 1.0, seed=0)
    assert ending == "simulation failed"
    assert 0.3 < table["t"].iloc[-1] < 0.5
    assert np.isfinite(table["v"]).all()
