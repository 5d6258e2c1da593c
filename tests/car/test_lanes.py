"""Eight numbers at once in compiled code: each lane is what one number gives."""

import math

import numpy as np
import pytest

from drift_drake.car import equations, scalar
from drift_drake.car.compilation import compiled
from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.lanes import LANES, load_lanes, load_lanes_tuple, store_lanes
from drift_drake.common.arrays import Array

UNARY = (math.sin, math.cos, math.atan, math.exp, math.tanh, math.sqrt)
EFFECTS = Effects(mass_error=0.1, aero_drag=0.8, drivetrain_friction=30.0, road_grade=0.03, friction_level=-0.1)


@compiled
def _unary(x: Array, out: Array) -> None:
    v = load_lanes(x, 0)
    store_lanes(out, 0, scalar.sin(v))
    store_lanes(out, 1, scalar.cos(v))
    store_lanes(out, 2, scalar.atan(v))
    store_lanes(out, 3, scalar.exp(v))
    store_lanes(out, 4, scalar.tanh(v))
    store_lanes(out, 5, scalar.sqrt(scalar.absolute(v)))


@compiled
def _arithmetic(x: Array, y: Array, out: Array) -> None:
    a, b = load_lanes(x, 0), load_lanes(y, 0)
    store_lanes(out, 0, 2.0 * a - b / 3.0 + 1)
    store_lanes(out, 1, -(a / b) + 1.0 / b - 4.0)
    store_lanes(out, 2, scalar.select(a, b, a, 0.5))
    store_lanes(out, 3, scalar.maximum(a, 0.0) + scalar.minimum(1.0, b) + scalar.absolute(a))
    store_lanes(out, 4, scalar.select(0.0, 1.0, a, b))
    store_lanes(out, 5, 7.0)
    store_lanes(out, 6, a**2 + abs(b) ** 0.5 + 2.0**a)


@compiled
def _rates(z: Array, command: Array, constants: tuple[float, ...], effects: Effects, wrench: Array,
           out: Array) -> None:  # fmt: skip
    commands = load_lanes(command, 0), load_lanes(command, 1)
    equations.settle(z, commands[0], commands[1], constants, effects)
    equations.rates(z, commands, (constants, effects, load_lanes_tuple(wrench, 0, 3)), out)


def test_elementary_functions_are_those_of_one_number() -> None:
    rng, out = np.random.default_rng(0), np.empty(6 * LANES)
    for _ in range(200):
        x = rng.normal(size=LANES) * 10.0 ** rng.uniform(-6.0, 1.5)
        _unary(x, out)
        found = out.reshape(6, LANES)
        expected = [[function(abs(q) if function is math.sqrt else q) for q in x] for function in UNARY]
        np.testing.assert_allclose(found, expected, rtol=4e-15, atol=4e-15)


def test_ends_and_what_is_no_number() -> None:
    x, out = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0, 1e-30, 300.0, -300.0]), np.empty(6 * LANES)
    _unary(x, out)
    found = out.reshape(6, LANES)
    assert np.isnan(found[:5, 0]).all()
    assert np.isnan(found[:2, 1:3]).all()
    assert found[2, 1:3] == pytest.approx([0.5 * np.pi, -0.5 * np.pi], rel=1e-15)
    assert found[4, 1:3].tolist() == [1.0, -1.0]
    np.testing.assert_allclose(found[[0, 2], 3:6], [[0.0, 0.0, 1e-30]] * 2, rtol=4e-15)
    assert found[3, 6:] == pytest.approx([math.exp(300.0), math.exp(-300.0)], rel=1e-14)


def test_arithmetic_takes_a_number_for_all_lanes() -> None:
    rng, out = np.random.default_rng(1), np.empty(7 * LANES)
    a, b = rng.normal(size=(2, LANES))
    _arithmetic(a, b, out)
    expected = [2.0 * a - b / 3.0 + 1, -(a / b) + 1.0 / b - 4.0, np.where(a < b, a, 0.5),
                np.maximum(a, 0.0) + np.minimum(1.0, b) + np.abs(a), a, np.full(LANES, 7.0),
                a**2 + np.abs(b) ** 0.5 + 2.0**a]  # fmt: skip
    np.testing.assert_allclose(out.reshape(7, LANES), expected, rtol=1e-14, atol=1e-15)


def test_cars_side_by_side_move_as_each_alone() -> None:
    """Every lane another state and command of the double-track car: sliding, braking, at a walking pace."""
    constants, size = CARS["coupe"].constants(), equations.size_of(CARS["coupe"].constants())
    rng = np.random.default_rng(2)
    states, commands = np.zeros((size, LANES)), rng.normal(size=(2, LANES)) * [[0.3], [150.0]]
    states[:5] = rng.normal(size=(5, LANES)) * [[0.5], [0.0], [0.4], [3.0], [1.0]]
    states[1], states[3] = rng.uniform(1.0, 25.0, LANES), np.abs(states[3]) + rng.uniform(1.0, 25.0, LANES)
    wrench = rng.normal(size=(3, LANES)) * 200.0
    z, out = states.ravel().copy(), np.empty(size * LANES)
    _rates(z, commands.ravel(), constants, EFFECTS, wrench.ravel(), out)
    for lane in range(LANES):
        alone, rates = states[:, lane].copy(), np.empty(size)
        equations.settle(alone, *commands[:, lane], constants, EFFECTS)
        np.testing.assert_allclose(z.reshape(size, LANES)[:, lane], alone, rtol=1e-9, atol=1e-12)
        equations.rates(alone, tuple(commands[:, lane]), (constants, EFFECTS, wrench[:, lane]), rates)
        np.testing.assert_allclose(out.reshape(size, LANES)[:, lane], rates, rtol=1e-8, atol=1e-8)
