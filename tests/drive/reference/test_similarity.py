"""Exact dynamic copies of a car are planned alike, and what a car cannot drift is said with what it can."""

import dataclasses
import math

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.car.vehicle_file import check_plausible
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.mpc.mpc import Mpc
from drift_drake.drive.mpc.ocp import OcpWeights
from drift_drake.drive.mpc.sqp import SqpOptions
from drift_drake.drive.reference.chain import NoTransitionError
from drift_drake.drive.reference.equilibrium import NoEquilibriumError, drift_equilibrium
from drift_drake.drive.reference.path import Path
from drift_drake.drive.reference.similarity import Similarity, similarity, time_step
from drift_drake.drive.reference.trajectory import Reference, figure_8, loops, straight_line

CAR = VehicleParameters()


def copy_of(p: VehicleParameters, size: float) -> VehicleParameters:
    """The exact dynamic copy of a car, `size` times as large, of the same materials: masses go with the volume."""
    return Similarity(1.0 / size, math.sqrt(1.0 / size), size**-3).usual(p)


def circle(speed: float, duration: float, curvature: float, half_width: float) -> Reference:
    """A circle of a curvature [1/m] at a speed [m/s], without sideslip or steering."""
    straight = straight_line(speed, speed, duration, half_width)
    path = Path([0.0, straight.distance], [curvature, curvature])
    bent = np.full_like(straight.s, curvature)
    return dataclasses.replace(straight, path=path, r=curvature * straight.v, curvature=bent)


def test_the_default_car_is_its_own_measure() -> None:
    units = similarity(CAR)
    assert units == (1.0, 1.0, 1.0)
    assert units.usual(CAR) == CAR


@pytest.mark.parametrize("size", [0.1, 0.4, 1.5])
def test_a_copy_is_planned_alike(size: float) -> None:
    copy = copy_of(CAR, size)
    check_plausible(copy)
    assert copy.mass == pytest.approx(size**3 * CAR.mass)
    assert copy.gravity == pytest.approx(CAR.gravity)
    one, other = figure_8(CAR), figure_8(copy)
    speed = size**0.5
    for name, unit in {"s": size, "v": speed, "omega_r": speed, "beta": 1.0, "r": speed / size, "delta": 1.0,
                       "tau": size**4, "curvature": 1.0 / size, "e_max": size}.items():  # fmt: skip
        expected = unit * getattr(one, name)
        np.testing.assert_allclose(getattr(other, name), expected, atol=1e-6 * np.abs(expected).max())
    assert other.duration == pytest.approx(speed * one.duration)


def test_loops_go_with_the_size_too() -> None:
    one, other = loops(CAR), loops(copy_of(CAR, 0.2))
    np.testing.assert_allclose(other.beta, one.beta, atol=1e-5)
    assert other.distance == pytest.approx(0.2 * one.distance)


def test_another_gravity_is_another_speed() -> None:
    one, other = figure_8(CAR), figure_8(dataclasses.replace(CAR, gravity=2.0 * CAR.gravity, front_stiffness=280e3,
                                                             rear_stiffness=440e3, torque_max=900.0,
                                                             torque_min=-100.0))  # fmt: skip
    np.testing.assert_allclose(other.v, 2.0**0.5 * one.v, rtol=1e-6)


def test_a_model_car_drifts_round_less_than_a_metre() -> None:
    found = drift_equilibrium(copy_of(CAR, 0.05), 0.9, -0.6)
    assert found.v == pytest.approx(0.05**0.5 * drift_equilibrium(CAR, 18.0, -0.6).v)


def test_too_little_friction_is_named_with_the_fix() -> None:
    ice = CAR.replace(friction=0.5)
    with pytest.raises(NoTransitionError, match=r"friction of 0\.5 is too low .* is enough\): give --transition 25"):
        figure_8(ice)
    assert figure_8(ice, transition=25.0).v.max() < figure_8(CAR).v.max()


def test_too_short_a_transition_is_said_with_one_that_is_long_enough() -> None:
    with pytest.raises(NoTransitionError, match=r"within 12 m: .*; give --transition 18") as error:
        figure_8(CAR, transition=12.0)
    assert "friction" not in str(error.value)
    figure_8(CAR, transition=18.0)


def test_a_sideslip_that_no_steering_holds_is_said_with_one_that_it_does() -> None:
    with pytest.raises(NoEquilibriumError, match=r"sideslip of -1\.3 rad .*; give --sideslip"):
        figure_8(CAR, sideslip=1.3)


@pytest.mark.parametrize("name", ["radius", "transition", "half_width", "sideslip"])
def test_a_length_that_is_none_is_refused(name: str) -> None:
    with pytest.raises(InvalidOptionError, match="give a number above 0"):
        figure_8(CAR, **{name: -1.0})


def test_a_step_goes_with_the_size_in_whole_control_periods() -> None:
    for period in (0.005, 0.01, 0.02):
        assert time_step(VehicleParameters(), period) == 0.1
    assert time_step(copy_of(VehicleParameters(), 0.1), 0.01) == pytest.approx(0.03)
    assert time_step(copy_of(VehicleParameters(), 1.5), 0.01) == pytest.approx(0.12)
    assert time_step(copy_of(VehicleParameters(), 0.01), 0.05) == 0.05


@pytest.mark.parametrize("size", [0.1, 1.5])
def test_weights_plan_for_a_copy_as_for_the_default_car(size: float) -> None:
    """A copy's plan is the default car's, in its own units."""
    plans = []
    for car in (VehicleParameters(), copy_of(VehicleParameters(), size)):
        units = similarity(car)
        dt = 0.1 * units.time
        reference = circle(12.0 * units.speed, 20.0 * units.time, 0.05 / units.length, 5.0 * units.length)
        weights, command = OcpWeights().of_size(units), tuple(reference.input(0.0))
        options = SqpOptions.converging(1e-6)
        mpc = Mpc(NominalStepModel(car, dt), car, reference, 15, weights, options, 0.0, command)
        x = reference.state(0.0) + np.array([0.0, 0.0, 0.1, 0.0, 0.3 * units.length, 0.0])
        plans.append(mpc.solve(x, 0.0, 0.0).plan.u / [1.0, units.torque])
    np.testing.assert_allclose(plans[1][:, 0], plans[0][:, 0], atol=1e-3)
    np.testing.assert_allclose(plans[1][:, 1], plans[0][:, 1], atol=1.0)
