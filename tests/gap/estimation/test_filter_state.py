"""The filter's state by itself: its motion against another integrator, its derivatives, its start, its transition."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import motion
from drift_drake.car.single_track.motion_with_effects import settled_internal_states
from drift_drake.gap.estimation.filter_state import (
    MIN_FILTER_SPEED,
    SIZE,
    advance_row,
    commanded,
    first_state,
    hold_speeds,
    linearise,
    predict_measurement,
    state_rates,
    transition,
)

CORRECTED, UNRELAXED = 9, 7  # of the state, that the filter corrects; with tyres that do not relax
CAR = VehicleParameters()
P, NONE = CAR.constants(), Effects()
START = [0.3, 12.0, -0.1, 12.8, 0.7, 3.0, -2.0]
COMMAND = (0.06, 90.0)
STEADY = np.full(9, COMMAND[0]), np.full(9, COMMAND[1])
NO_WRENCH = np.zeros(3)


def state(start: list[float] = START) -> np.ndarray:
    """The seven, and internal states at rest."""
    return np.append(start, np.zeros(SIZE - 7))


def test_rates_are_the_cars_and_the_places_go_along_the_course() -> None:
    wrench = (300.0, -500.0, 700.0)
    rates = state_rates(state(), *COMMAND, P, NONE, *wrench)
    m = motion(*START[:4], *COMMAND, P, *wrench)
    course = START[4] + START[2]
    place = (START[0], START[1] * np.cos(course), START[1] * np.sin(course))
    assert rates[:7] == pytest.approx((m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, *place), rel=1e-9)
    assert rates[-2:] == pytest.approx((m.a_x, m.a_y), rel=1e-9)
    assert len(rates) == SIZE + 2


def test_commands_are_linear_between_the_grids_points() -> None:
    delta, torque = np.array([0.0, 0.4, 0.2]), np.array([10.0, 20.0, 60.0])
    for place, wanted in (
        (0.0, (0.0, 10.0)),
        (0.25, (0.1, 12.5)),
        (1.0, (0.4, 20.0)),
        (1.5, (0.3, 40.0)),
        (2.0, (0.2, 60.0)),
    ):
        assert commanded(delta, torque, place) == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("before", "after"),
    [((3.0, 4.0), (3.0, 4.0)), ((0.1, 4.0), (MIN_FILTER_SPEED, 4.0)), ((2.0, -1.0), (2.0, 0.0)),
     ((-0.1, -3.0), (-MIN_FILTER_SPEED, -3.0)), ((-2.0, 1.0), (-2.0, 0.0))],
)  # fmt: skip
def test_speeds_keep_from_standstill_and_rims_turn_with_them(before: tuple, after: tuple) -> None:
    z = state([0.1, before[0], 0.2, before[1], 0.3, 0.4, 0.5])
    hold_speeds(z)
    np.testing.assert_array_equal(z[:7], [0.1, after[0], 0.2, after[1], 0.3, 0.4, 0.5])


@pytest.mark.parametrize("inertia", [CAR.rear_axle_inertia, 0.2])
@pytest.mark.parametrize(("substeps", "near"), [(1, 1e-4), (2, 2e-5)])
def test_a_row_is_the_equations_integrated(inertia: float, substeps: int, near: float) -> None:
    """Under commands that change, a force and a moment; the rim of a light axle settles many times a row."""
    p, row, period = P._replace(rear_axle_inertia=inertia), 2, 0.01
    delta, torque = np.append(np.zeros(8), np.linspace(0.05, 0.09, 5)), np.linspace(-100.0, 140.0, 13)
    wrench, z = np.array([300.0, -900.0, 700.0]), state()
    advance_row(z, delta, torque, row, period, substeps, p, NONE, wrench, np.empty(SIZE + 2), np.empty((2, SIZE)))

    def rates(t: float, x: np.ndarray) -> list[float]:
        at = np.array([4.0 * (row + t / period)])
        command = (float(np.interp(at, np.arange(13), values)[0]) for values in (delta, torque))
        m = motion(*x[:4], *command, p, *wrench)
        course = x[4] + x[2]
        return [m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, x[0], x[1] * np.cos(course), x[1] * np.sin(course)]

    wanted = solve_ivp(rates, (0.0, period), START, "LSODA", rtol=1e-10, atol=1e-12, max_step=period / 8).y[:, -1]
    np.testing.assert_allclose(z[:7], wanted, rtol=0, atol=near)
    assert not np.allclose(z[:4], START[:4], atol=1e-3)


def test_the_first_state_is_what_is_measured_without_biases_and_settled() -> None:
    q = Effects(gyro_bias=0.05, sideslip_bias=-0.02, wheel_radius_error=0.03, tyre_relaxation=0.4)
    y, z = np.array([0.35, 12.0, -0.12, 1.03 * 12.8, 9.0, 9.0, 0.7, 3.0, -2.0]), np.empty(SIZE)
    first_state(y, np.ones(9, dtype=bool), *COMMAND, P, q, z)
    np.testing.assert_allclose(z[:7], START, rtol=1e-12)
    settled = settled_internal_states(*START[:4], *COMMAND, P, q)
    np.testing.assert_allclose(z[7:], settled[2:], rtol=1e-12)
    assert np.all(z[7:9] != 0.0)


def test_the_first_state_without_sensors_rolls_at_the_origin() -> None:
    """A sideslip that is no reading is taken as given; the rim has the car's speed; the place is the origin."""
    q, z = Effects(gyro_bias=0.05, sideslip_bias=-0.02, wheel_radius_error=0.03), np.empty(SIZE)
    first_state(np.full(9, 0.2), np.array([1, 1, 0, 0, 0, 0, 0, 0, 0], dtype=bool), *COMMAND, P, q, z)
    np.testing.assert_allclose(z[:7], [0.15, MIN_FILTER_SPEED, 0.2, MIN_FILTER_SPEED, 0.0, 0.0, 0.0], rtol=1e-12)


def test_a_measurement_is_of_the_states_the_accelerations_and_the_sensors_errors() -> None:
    q, out = Effects(gyro_gain_error=0.1, sideslip_bias=-0.02), np.empty(9)
    predict_measurement(state(), 1.5, -4.0, q, out)
    np.testing.assert_allclose(out, [0.33, 12.0, -0.12, 12.8, 1.5, -4.0, 0.7, 3.0, -2.0], rtol=1e-12)


@pytest.mark.parametrize(("effects", "relaxed", "graded"), [
    (NONE, False, False), (Effects(tyre_relaxation=0.5), True, False), (Effects(road_grade=0.1), False, True),
])  # fmt: skip
def test_derivatives_are_the_equations_slopes(effects: Effects, relaxed: bool, graded: bool) -> None:
    """By each corrected state, with a step of another size; what has no influence is left zero."""
    z, jacobian = state(), np.full((SIZE + 2, CORRECTED), np.nan)
    z[7:9] = -0.02, -0.05
    before = z.copy()
    linearise(z, *COMMAND, P, effects, relaxed, graded, np.empty(SIZE), jacobian)
    np.testing.assert_array_equal(z, before)
    for j, step in enumerate(1e-6 * np.eye(SIZE)[:CORRECTED]):
        ends = [np.array(state_rates(z + s, *COMMAND, P, effects, 0.0, 0.0, 0.0)) for s in (step, -step)]
        slope = (ends[0] - ends[1]) / 2e-6 if j < 7 or relaxed else np.zeros(SIZE + 2)
        size = np.maximum(np.abs(slope), 1.0)
        np.testing.assert_allclose(jacobian[:, j] / size, slope / size, rtol=0, atol=1e-4, err_msg=str(j))
    np.testing.assert_array_equal(jacobian[:, 5:7], 0.0)


@pytest.mark.parametrize("n", [UNRELAXED, CORRECTED])
@pytest.mark.parametrize(("fastest", "halvings"), [(30.0, 0), (240.0, 0), (900.0, 2)])
def test_a_transition_is_the_exponential_of_the_derivatives_to_fourth_order(
    n: int, fastest: float, halvings: int
) -> None:
    """The place and, without relaxing tyres, the slips move nothing; steps of a light rim are halved until stable."""
    period, jacobian = 0.01, np.zeros((SIZE + 2, CORRECTED))
    jacobian[:n, :n] = np.random.default_rng(3).normal(size=(n, n)) * 3.0
    jacobian[:, 5:7] = 0.0
    if n == UNRELAXED:
        jacobian[:, 5:] = 0.0
    jacobian[3, 3] = -fastest
    f, power, scratch = (np.full((CORRECTED, CORRECTED), np.nan) for _ in range(3))
    transition(jacobian, period, n, f, power, scratch, 0.3)
    step = jacobian[:n, :n] * period / 2**halvings
    part = sum(np.linalg.matrix_power(step, k) / math.factorial(k) for k in range(5))
    np.testing.assert_allclose(f[:n, :n], np.linalg.matrix_power(part, 2**halvings), rtol=1e-9, atol=1e-12)
    if fastest < 100.0:
        np.testing.assert_allclose(f[:n, :n], expm(jacobian[:n, :n] * period), rtol=0, atol=1e-4)
    assert np.abs(np.linalg.eigvals(f[:n, :n])).max() < 1.2
