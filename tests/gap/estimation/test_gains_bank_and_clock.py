"""Gains of steering and sensors, a banked road, the commands' clock: the twins against equations integrated here.

Each change is made in NumPy to the nominal car's commands, forces or readings, and no effect of the package's is used.
"""

import dataclasses
import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drift_drake.car.actuated import STAGES, actuated
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.log.table import Run, read_run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import motion
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.observed import observe_case
from drift_drake.gap.estimation.problem import PROCESS_NOISE, flat
from drift_drake.gap.estimation.reduction import predicted_ahead
from drift_drake.gap.estimation.usable import seen_effects
from drift_drake.gap.estimation.variants import Variant
from drift_drake.gap.estimation.windows import run_errors, windowed

CAR, PERIOD, ROWS = VehicleParameters(), 0.01, 251
TIMES = np.arange(ROWS) * PERIOD
BANK = 0.12 + 0.08 * np.sin(1.5 * TIMES)
NOISE = {"r": 0.002, "v": 0.02, "beta": 0.002, "omega_r": 0.04, "psi": 0.001, "x": 0.01, "y": 0.01, "ax": 0.05,
         "ay": 0.05}  # fmt: skip
SIZES = {"steering_ratio_error": -0.15, "gyro_gain_error": 0.06, "speed_gain_error": -0.05, "road_bank": 0.1,
         "command_clock_error": 0.04}  # fmt: skip
CASES = [*SIZES.items(), ("command_clock_error", -0.04)]
NEIGHBOURS = {
    "steering_ratio_error": ("front_stiffness_error", "steering_offset", "cg_shift"),
    "gyro_gain_error": ("gyro_bias", "speed_gain_error", "yaw_inertia_error"),
    "speed_gain_error": ("wheel_radius_error", "gyro_gain_error", "mass_error"),
    "road_bank": ("steering_offset", "sideslip_bias", "road_grade"),
    "command_clock_error": ("steering_lag", "steering_delay", "torque_lag"),
}


def steering(t):
    return 0.02 + 0.07 * np.sin(5.0 * t)


def torque(t):
    return 60.0 + 50.0 * np.sin(3.0 * t)


@functools.cache
def drive(name="", q=0.0, logged_bank=False, noise=0.0):
    """A slalom on the throttle of the nominal car with one change, as its log has it."""
    ratio = 1.0 + q * (name == "steering_ratio_error")
    bank = BANK * (1.0 + q * (name == "road_bank")) if logged_bank else np.full(ROWS, q * (name == "road_bank"))
    pull = -CAR.mass * CAR.gravity * np.sin(bank)
    p = CAR.constants()

    def at(t, x):
        return motion(x[0], x[1], x[2], x[3], ratio * steering(t), torque(t), p, 0.0, np.interp(t, TIMES, pull))

    def rates(t, x):
        m = at(t, x)
        return [m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, x[0], x[1] * np.cos(x[4] + x[2]),
                x[1] * np.sin(x[4] + x[2])]  # fmt: skip

    x = solve_ivp(rates, (0.0, TIMES[-1]), [0.0, 12.0, 0.0, 12.1, 0.1, 0.0, 0.0], "LSODA", TIMES, rtol=1e-9,
                  atol=1e-10, max_step=PERIOD).y  # fmt: skip
    accelerations = np.array([(m.a_x, m.a_y) for m in (at(t, state) for t, state in zip(TIMES, x.T, strict=True))])
    clock = q if name == "command_clock_error" else 0.0
    columns = dict(zip(("r", "v", "beta", "omega_r", "psi", "x", "y"), x, strict=True))
    columns |= {"ax": accelerations[:, 0], "ay": accelerations[:, 1]}
    columns["r"] = columns["r"] * (1.0 + q * (name == "gyro_gain_error"))
    columns["v"] = columns["v"] * (1.0 + q * (name == "speed_gain_error"))
    rng = np.random.default_rng(5)
    columns = {key: values + noise * NOISE[key] * rng.standard_normal(ROWS) for key, values in columns.items()}
    return Run("run_0", TIMES, delta_cmd=steering(TIMES - clock), tau_cmd=torque(TIMES - clock),
               bank=BANK if logged_bank else None, **columns)  # fmt: skip


def window_errors(run, effects):
    """Largest prediction errors [5], from windows that start from the columns as they are."""
    found = windowed(run)
    found = dataclasses.replace(found, start_y=found.y)
    return np.abs(run_errors(found, CAR.constants(), make_effects(effects))).max(axis=(0, 1))


@pytest.mark.parametrize(("name", "q"), CASES)
def test_windows_predict_the_changed_car(name, q):
    wrong, right = window_errors(drive(name, q), {}), window_errors(drive(name, q), {name: q})
    units = np.array([1.0, 10.0, 0.3, 10.0, 1.0])
    worst = int(np.argmax(wrong / units))
    assert wrong[worst] / units[worst] > 2e-3
    assert np.max(right / units) < 0.03 * wrong[worst] / units[worst]


def judged(run, magnitudes):
    """Half the squared innovations [nats] of a hypothesis, exactly those magnitudes, and its log determinant."""
    problem = make_problem([run], CAR, stated=NOISE)
    names = tuple(magnitudes)
    theta = np.concatenate([np.zeros(problem.nuisances), list(magnitudes.values())])
    found = filter_case(problem, theta, names)
    e = flat(problem, found.innovations)
    np.testing.assert_allclose(observe_case(problem, found, [Variant(theta, names)])[0], e, rtol=1e-9, atol=1e-9)
    return 0.5 * float(np.sum(e**2)) + 0.5 * found.filtered.logdet, float(np.mean(e**2))


@pytest.mark.parametrize(("name", "q"), CASES)
def test_the_filter_is_white_under_the_change_and_under_no_neighbour(name, q):
    run = drive(name, q, noise=1.0)
    right, mean_square = judged(run, {name: q})
    assert mean_square == pytest.approx(1.0, abs=0.12)
    assert judged(run, {})[0] > right + 20.0
    assert judged(run, {name: -q})[0] > right + 40.0
    for neighbour in NEIGHBOURS[name]:
        sizes = np.linspace(-1.0, 1.0, 9) * {"steering_lag": 0.12, "steering_delay": 0.1, "torque_lag": 0.2,
                                              "front_stiffness_error": 0.4, "mass_error": 0.2,
                                              "yaw_inertia_error": 0.4}.get(neighbour, 0.06)  # fmt: skip
        late = neighbour in ("steering_lag", "steering_delay", "torque_lag")
        others = [judged(run, {neighbour: size})[0] for size in sizes if size > 0.0 or not late]
        assert min(others) > right + 10.0, neighbour


def test_a_negative_clock_error_is_a_latency_of_all_sensors():
    """Exactly so, but for the rows before the first: no log tells them apart."""
    late, early = Effects(sensor_latency=0.04), Effects(command_clock_error=-0.04)
    run = drive("command_clock_error", -0.04)
    for one, other in zip(
        *(actuated(run.delta_cmd, run.tau_cmd, (0.0, 50.0), PERIOD, q) for q in (late, early)), strict=True
    ):
        np.testing.assert_array_equal(one, other)
    windows = [run_errors(windowed(run), CAR.constants(), q) for q in (late, early)]
    np.testing.assert_array_equal(*windows)


def test_commands_that_act_before_they_are_logged_are_held_after_the_last_row():
    command = np.sin(np.arange(60))
    delta, _ = actuated(command, command, (0.0, 0.0), PERIOD, Effects(command_clock_error=0.025))
    t = np.arange(len(delta)) * PERIOD / STAGES + 0.025
    np.testing.assert_allclose(delta, np.interp(t, np.arange(60) * PERIOD, command), atol=1e-12)


@pytest.mark.parametrize("q", [0.0, 0.2])
def test_a_logged_bank_is_known_and_its_error_is_a_share_of_it(q, tmp_path):
    run = drive("road_bank", q, logged_bank=True)
    write_run(run, tmp_path / "run_0.csv")
    np.testing.assert_allclose(read_run(tmp_path / "run_0.csv").bank, BANK, rtol=1e-8)
    flat_road, right = window_errors(run.without("bank"), {}), window_errors(run, {"road_bank": q})
    assert right[2] < 0.01 * flat_road[2]
    if q > 0.0:
        assert right[2] < 0.05 * window_errors(run, {})[2]
    noisy = drive("road_bank", q, logged_bank=True, noise=1.0)
    nats, mean_square = judged(noisy, {"road_bank": q})
    assert mean_square == pytest.approx(1.0, abs=0.12)
    for wrong in ({"road_bank": q + 0.1}, {"road_bank": q - 0.1}):
        assert judged(noisy, wrong)[0] > nats + 5.0


def test_predictions_from_the_filter_have_the_logged_bank():
    run = drive("road_bank", 0.0, logged_bank=True)
    problem = make_problem([run], CAR, stated=NOISE)
    assert problem.process.shape == PROCESS_NOISE.shape
    theta, starts, steps = np.zeros(problem.nuisances), np.array([60, 120]), np.array([50])
    found = predicted_ahead(problem, theta, (), 0, filter_case(problem, theta, ()), starts, steps)[:, 0, :4]
    np.testing.assert_allclose(found, problem.runs[0].y[starts + 50, :4], atol=2e-3)


def test_the_bank_s_magnitude_is_said_to_be_a_share_and_needs_all_runs():
    banked, plain = drive("road_bank", 0.0, logged_bank=True), drive()
    names, said = seen_effects([banked], ["road_bank", "mass_error"])
    assert names == ["road_bank", "mass_error"]
    assert said == ["column bank is known: road_bank is its relative error, the true bank (1 + road_bank) times it"]
    names, said = seen_effects([banked, plain], ["road_bank", "mass_error"])
    assert names == ["mass_error"]
    assert said == ["column bank is in some runs only: road_bank cannot be judged; give it in all runs or in none"]


def test_speeds_without_a_rim_sensor_are_those_of_the_wrong_speed_sensor():
    run = drive("speed_gain_error", -0.05).without("omega_r")
    rolling = windowed(run)
    known = rolling.read_with(Effects(speed_gain_error=-0.05, wheel_radius_error=0.02))
    assert known.wheel_radius_error == -0.05
    assert windowed(drive()).read_with(Effects(wheel_radius_error=0.02)).wheel_radius_error == 0.02
