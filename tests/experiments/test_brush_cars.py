"""Cars of other sizes: their equations against hand figures, their drives, and what differs from day to day."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import Effects, make_effects
from experiments.benchmarks.rows import advance, row_states
from experiments.other_worlds.brush_cars import (
    BRUSH_CARS,
    VARIES_BY_DAY,
    day_runs,
    noisy,
    of_the_day,
    scaled,
    simulate,
)
from experiments.other_worlds.days import Days, drawn_effects, first_guess, make_day
from experiments.other_worlds.drivers import DAY_ONE, OTHER

SMALL, TRUCK = BRUSH_CARS["small"], BRUSH_CARS["truck"]
NAMES = row_states(SMALL.constants())


def rolled(car, effects, steering, thrust, seconds, speed):
    """States [rows, 15] (`NAMES`) under constant commands; `thrust` is the acceleration asked for [m/s^2]."""
    rows = round(seconds / 0.01)
    delta = np.full(rows + 1, steering)
    tau = np.full(rows + 1, thrust * car.mass * car.wheel_radius / car.gear_ratio)
    z = np.zeros((rows + 1, len(NAMES)))
    z[0, [1, 3]] = speed
    for row in range(rows):
        z[row + 1], _ = advance(z[row], row, delta, tau, car.constants(), effects)
    return z


@pytest.mark.parametrize("name", BRUSH_CARS)
def test_a_car_takes_a_gentle_turn_as_its_single_track_says_and_keeps_its_balance_of_forces(name):
    car = BRUSH_CARS[name].replace(front_compliance=0.0, rear_compliance=0.0, roll_steer=0.0, rear_steer=0.0, lock=0.0,
                                    lock_least=0.0, lock_share=0.0, vectoring=0.0)  # fmt: skip
    p, speed = car.single_track(), 6.0 * np.sqrt((car.front_axle_distance + car.rear_axle_distance) / 2.5)
    z = rolled(car, Effects(), 0.01, 0.1, 3.0, speed)
    r, u = z[-1, :2]
    length = p.front_axle_distance + p.rear_axle_distance
    weight = p.mass * p.gravity / length
    understeer = weight / p.gravity * (p.rear_axle_distance / p.front_stiffness
                                       - p.front_axle_distance / p.rear_stiffness)  # fmt: skip
    assert r == pytest.approx(u * 0.01 / (length + understeer * u * u), rel=0.02)
    assert z[-1, NAMES.index("a_y")] == pytest.approx(u * r, rel=0.02)


@pytest.mark.parametrize("name", BRUSH_CARS)
@pytest.mark.parametrize("kind", DAY_ONE + OTHER)
def test_every_driver_keeps_every_car_on_its_wheels(name, kind):
    run = simulate(BRUSH_CARS[name], Effects(), kind, 1.0, np.random.default_rng(1), "run_0", 12.0)
    assert run.t[-1] == pytest.approx(12.0)
    assert 0.2 < np.max(np.abs(run.ay)) / 9.81 < 1.2


def test_effects_act_as_the_catalogue_says():
    plain = rolled(TRUCK, Effects(), 0.02, 0.3, 2.0, 12.0)
    offset = rolled(TRUCK, make_effects({"steering_offset": 0.01}), 0.01, 0.3, 2.0, 12.0)
    np.testing.assert_allclose(offset, plain, atol=1e-12)
    heavier = rolled(TRUCK, make_effects({"mass_error": 0.2}), 0.02, 0.3, 2.0, 12.0)
    assert heavier[-1, 1] < plain[-1, 1]
    lagging = rolled(TRUCK, make_effects({"steering_lag": 0.2}), 0.02, 0.3, 0.2, 12.0)
    assert lagging[-1, NAMES.index("steering")] == pytest.approx(0.02 * (1.0 - np.exp(-1.0)), rel=1e-3)


def test_magnitudes_are_of_the_cars_size():
    assert scaled("friction_level", -0.2, SMALL.single_track()) == pytest.approx(-0.2)
    length = (SMALL.front_axle_distance + SMALL.rear_axle_distance) / 2.4
    assert scaled("cg_shift", 0.1, SMALL.single_track()) == pytest.approx(0.1 * length, rel=0.1)
    assert scaled("aero_drag", 1.0, TRUCK.single_track()) > 1.0


def test_a_car_is_not_quite_the_same_on_any_day():
    rng = np.random.default_rng(0)
    days = [of_the_day(SMALL, make_effects({"mass_error": 0.1}), rng) for _ in range(200)]
    masses = [day.mass_error for day in days]
    assert np.mean(masses) == pytest.approx(0.1, abs=0.003)
    assert np.std(masses) == pytest.approx(VARIES_BY_DAY["mass_error"] * 0.2, rel=0.2)
    assert all(day.steering_lag == 0.0 for day in days)


def test_noise_is_half_coloured_and_of_the_stated_size():
    rng = np.random.default_rng(0)
    run = simulate(SMALL, Effects(), "slalom", 1.0, rng, "run_0", 12.0)
    error = noisy(run, rng).r - run.r
    assert np.std(error) == pytest.approx(0.002, rel=0.15)
    assert np.corrcoef(error[1:], error[:-1])[0, 1] == pytest.approx(0.48, abs=0.1)


def test_days_of_such_a_car(tmp_path):
    config = Days(tmp_path, car="truck", none=1, count=3, duration=1.0)
    effects = drawn_effects(config)
    assert [list(e) for e in effects] == [[], ["friction_level"], ["mass_error"], ["yaw_inertia_error"]]
    runs, again = (make_day(config, effects[2], DAY_ONE, 1) for _ in range(2))
    assert len(runs) == len(DAY_ONE)
    np.testing.assert_array_equal(runs[0].r, again[0].r)
    smooth = make_day(dataclasses.replace(config, smooth=8.0), effects[2], DAY_ONE, 1)
    assert np.std(np.diff(smooth[0].r, 3)) < 0.5 * np.std(np.diff(runs[0].r, 3))
    guess = first_guess("truck")
    assert guess.mass == TRUCK.mass
    assert guess.front_stiffness != pytest.approx(TRUCK.single_track().front_stiffness, rel=0.05)
    assert len(day_runs(SMALL, Effects(), ("circle",), 1.0, np.random.default_rng(0), 1.0)) == 1
