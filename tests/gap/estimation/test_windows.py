"""Windows: predictions against independent integrations of the same car, internal states, fed speeds, rows left out."""

import dataclasses
import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import motion
from drift_drake.gap.estimation import windows
from drift_drake.gap.estimation.windows import (
    HORIZONS,
    LARGEST_ERROR,
    errors,
    errors_of_all,
    regimes,
    run_errors,
    windowed,
)
from experiments.benchmarks.compiled_cases import simulate_run
from experiments.benchmarks.drivers import PERIOD, Driver
from experiments.benchmarks.truths import Truth

CAR = VehicleParameters()


class Silent:
    """A generator without noise."""

    def standard_normal(self, count):
        return np.zeros(count)


def exact(run):
    """The run as windows that start from its columns as they are: no noise is to be smoothed away."""
    found = windowed(run)
    return dataclasses.replace(found, start_y=found.y)


def slalom(effects):
    """Two seconds of a car with effects, without noise."""
    return simulate_run(Driver("slalom", np.random.default_rng(2), CAR), Truth(effects), CAR, Silent(), "run_0", 2.0)


@functools.cache
def integrated(vehicle):
    """1.5 s of the nominal car by an adaptive integrator for stiff equations: slalom on the throttle, no noise."""
    t = np.arange(151) * PERIOD
    delta, tau = 0.08 * np.sin(5.0 * t), 60.0 + 50.0 * np.sin(3.0 * t)
    p = vehicle.constants()

    def rates(at, x):
        m = motion(x[0], x[1], x[2], x[3], np.interp(at, t, delta), np.interp(at, t, tau), p)
        return [m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, x[0]]

    x = solve_ivp(rates, (0.0, t[-1]), [0.0, 12.0, 0.0, 12.1, 0.0], "LSODA", t, rtol=1e-9, atol=1e-10,
                  max_step=PERIOD).y  # fmt: skip
    return Run("run_0", t, x[0], x[1], delta, tau_cmd=tau, beta=x[2], omega_r=x[3], psi=x[4])


@pytest.mark.parametrize("inertia", [CAR.rear_axle_inertia, 3.4])
def test_predictions_are_the_nominal_equations_integrated(inertia):
    vehicle = CAR.replace(rear_axle_inertia=inertia)
    run = exact(integrated(vehicle))
    e = run_errors(run, vehicle.constants(), Effects())
    assert e.shape == (len(run.starts), HORIZONS, 5)
    np.testing.assert_allclose(e, 0.0, atol=2e-5)


@pytest.mark.parametrize(
    "effects",
    [
        {"tyre_relaxation": 0.6},
        {"longitudinal_stiffness_error": 1.0},
        {"steering_lag": 0.1},
        {"steering_delay": 0.06},
        {"command_clock_error": 0.06},
        {"command_clock_error": -0.06},
        {"steering_ratio_error": -0.2, "steering_lag": 0.1},
        {"road_bank": 0.1},
        {"steering_rate_limit": 0.3},
        {"torque_lag": 0.2},
        {"longitudinal_load_transfer": 0.5},
        {"tyre_thermal_fade": 0.4, "sliding_friction_drop": 0.1},
    ],
)
def test_internal_states_are_carried_as_in_a_simulation_of_the_whole_run(effects):
    run, p = exact(slalom(effects)), CAR.constants()
    without, with_it = (np.abs(run_errors(run, p, make_effects(q))).max(axis=(0, 1)) for q in ({}, effects))
    worst = int(np.argmax(without / np.array([1.0, 10.0, 0.3, 10.0, 1.0])))
    assert with_it[worst] < 0.05 * without[worst]


def test_biases_of_sensors_are_taken_out_of_what_is_compared():
    biases = {"gyro_bias": 0.03, "sideslip_bias": -0.02, "wheel_radius_error": 0.04, "gyro_gain_error": 0.06,
              "speed_gain_error": -0.05}  # fmt: skip
    plain, biased = (exact(slalom(q)) for q in ({}, biases))
    e = run_errors(biased, CAR.constants(), make_effects(biases))
    np.testing.assert_allclose(e, run_errors(plain, CAR.constants(), Effects()), atol=1e-9)


def test_a_run_without_torque_feeds_the_speeds():
    run = slalom({})
    fed = exact(run.without("tau_cmd"))
    assert fed.fed
    e = np.abs(run_errors(fed, CAR.constants(), Effects())).max(axis=(0, 1))
    coasting = np.abs(run_errors(dataclasses.replace(fed, fed=False), CAR.constants(), Effects())).max(axis=(0, 1))
    assert np.all(e[[1, 3]] == 0.0)  # what is fed is no prediction
    assert np.all(e[[0, 2]] < coasting[[0, 2]])
    assert np.all(e[[0, 2]] < 0.02 * np.ptp(fed.y[:, [0, 2]], axis=0))


def test_missing_columns_are_filled_and_a_heading_is_integrated():
    run = integrated(CAR)
    found = windowed(run.without("omega_r", "psi"))
    np.testing.assert_array_equal(found.y[:, 3], run.v)
    np.testing.assert_allclose(found.y[:, 4], run.psi, atol=1e-4)


def test_no_window_touches_rows_that_are_left_out():
    run = slalom({})
    bad = np.zeros(len(run), dtype=bool)
    bad[90:95] = True
    kept, every = windowed(run, bad).starts, windowed(run).starts
    assert set(kept) < set(every)
    ends = kept + HORIZONS * windowed(run).stride_rows
    assert np.all((ends < 90) | (kept > 95))


@pytest.mark.parametrize("every", [1, 2])
def test_horizons_are_the_same_times_at_any_rate(every):
    run = exact(integrated(CAR).thinned(every))
    assert run.stride_rows * run.period == pytest.approx(windows.STRIDE)
    assert np.diff(run.starts)[0] * run.period == pytest.approx(windows.START_EVERY * windows.STRIDE)
    # Commands are linear between rows that are further apart: only nearly the ones that were driven.
    assert np.abs(run_errors(run, CAR.constants(), Effects())[..., 0]).max() < 0.02 * np.ptp(run.y[:, 0])


def test_a_small_car_is_judged_sooner_as_the_square_root_of_its_length():
    small = CAR.replace(front_axle_distance=0.05, rear_axle_distance=0.04)
    stride = windows.stride_of(small)
    assert stride == pytest.approx(0.3 * windows.STRIDE)
    assert windows.stride_of(CAR) == windows.STRIDE
    run = windowed(integrated(CAR), stride=stride)
    np.testing.assert_allclose(run.horizons, 0.03 * np.arange(1, HORIZONS + 1))
    assert np.diff(run.starts)[0] * run.period == pytest.approx(0.06)
    whole = windowed(integrated(CAR)).starts
    assert len(run.starts) > 3 * len(whole)
    assert run.starts[-1] > whole[-1]


def test_rows_too_far_apart_for_a_small_car_are_its_horizons():
    assert windowed(integrated(CAR).thinned(3), stride=0.012).horizons[0] == pytest.approx(0.03)


def test_a_parabola_passes_the_smoothing_and_noise_shrinks():
    t = np.arange(300) * PERIOD
    curve = 0.3 + t - 0.4 * t**2
    np.testing.assert_allclose(windows.smoothed(curve, PERIOD), curve, atol=1e-12)
    noise = np.random.default_rng(0).standard_normal(3000)
    assert np.std(windows.smoothed(noise, PERIOD)) < 0.5


def test_a_prediction_that_diverges_is_a_large_number():
    run = exact(integrated(CAR))
    e = run_errors(run, CAR.constants()._replace(yaw_inertia=1e-9), Effects())
    assert np.all(np.isfinite(e))
    assert np.abs(e).max() == LARGEST_ERROR


def test_cars_at_once_are_the_cars_one_by_one():
    runs, p = [exact(integrated(CAR))], CAR.constants()
    cars = [Effects(), make_effects({"mass_error": 0.1})]
    together = errors_of_all(runs, [(p, car) for car in cars])
    for car, found in zip(cars, together, strict=True):
        np.testing.assert_array_equal(found, errors(runs, p, car))


def test_regimes_are_the_hardest_of_each_window():
    t = np.arange(200) * PERIOD
    still = np.zeros(200)
    run = windowed(Run("run_0", t, still + 0.5, still + 10.0, still, still, still - 0.1, still + 11.0, psi=0.5 * t))
    slip = (11.0 - 10.0 * np.cos(0.1)) / 10.0
    np.testing.assert_allclose(regimes(run), np.tile([10.0, 5.0, 0.1, slip], (len(run.starts), 1)))
