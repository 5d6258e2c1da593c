"""Transitions: motions that the nominal car can follow, within its limits."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import derivatives
from drift_drake.drive.reference.chain import NoTransitionError, other_side, plan_transition, steady_straight
from drift_drake.drive.reference.equilibrium import drift_equilibrium

NOMINAL = VehicleParameters()
LEFT = drift_equilibrium(NOMINAL, 18.0, -0.6)
RIGHT = other_side(LEFT)


def worst_departure(transition, stretch: float = 0.25) -> np.ndarray:
    """Largest departure of the paper's six states from the plan, the car restarted on it every `stretch` [s]."""
    t = np.concatenate([[0.0], np.cumsum(np.diff(transition.s) * 0.5 * (
        1.0 / transition.state[1:, 1] + 1.0 / transition.state[:-1, 1]))])  # fmt: skip
    worst = np.zeros(6)
    for begin in np.arange(0.0, t[-1] - stretch, stretch):

        def rates(time, x):
            # x: the paper's six states and the path position.
            u = np.array([np.interp(time, t, transition.input[:, k]) for k in range(2)])
            curvature = np.interp(x[6], transition.s, transition.curvature)
            s_dot = x[1] * np.cos(x[5]) / (1.0 - curvature * x[4])
            return np.append(derivatives(x[:6], u, curvature, NOMINAL.constants()), s_dot)

        def planned(time):
            states = [np.interp(time, t, transition.state[:, k]) for k in range(4)]
            return np.array([*states, 0.0, 0.0, np.interp(time, t, transition.s)])

        result = solve_ivp(rates, (begin, begin + stretch), planned(begin), max_step=0.01, rtol=1e-8)
        worst = np.maximum(worst, np.abs(result.y[:, -1] - planned(begin + stretch))[:6])
    return worst


@pytest.mark.parametrize(
    ("start", "end", "length"),
    [(LEFT, RIGHT, 20.0), (RIGHT, LEFT, 25.0), (steady_straight(LEFT.v), LEFT, 30.0)],
)
def test_the_car_follows_the_plan_on_its_own(start, end, length):
    transition = plan_transition(NOMINAL, start, end, length)
    departure = worst_departure(transition)
    # Per 0.25 s; in the transitions the yaw rate swings by 3 rad/s and the rim speed by 5 m/s.
    assert departure[0] < 0.06
    assert departure[1] < 0.02
    assert departure[2] < 0.01
    assert departure[3] < 0.2
    assert departure[4] < 0.005
    assert departure[5] < 0.005


def test_ends_are_the_steady_states_and_inputs_stay_within_limits():
    transition = plan_transition(NOMINAL, LEFT, RIGHT, 20.0)
    for index, q in ((0, LEFT), (-1, RIGHT)):
        np.testing.assert_array_equal(transition.state[index], [q.r, q.v, q.beta, q.omega_r])
        np.testing.assert_array_equal(transition.input[index], [q.delta, q.tau])
        assert transition.curvature[index] == q.curvature
    assert transition.s[-1] == 20.0
    assert np.abs(transition.input[:, 0]).max() < NOMINAL.steering_limit
    assert transition.input[:, 1].min() > NOMINAL.torque_min
    assert transition.input[:, 1].max() < NOMINAL.torque_max


def test_the_mirrored_transition_is_the_mirror_image():
    there, back = plan_transition(NOMINAL, LEFT, RIGHT, 20.0), plan_transition(NOMINAL, RIGHT, LEFT, 20.0)
    np.testing.assert_allclose(back.curvature, -there.curvature, atol=1e-9)
    np.testing.assert_allclose(back.state, there.state * [-1.0, 1.0, -1.0, 1.0], atol=1e-7)


def test_yaw_rate_sideslip_and_curvature_are_consistent():
    transition = plan_transition(NOMINAL, LEFT, RIGHT, 20.0)
    r, v, beta, _ = transition.state.T
    # Over each interval: course = heading + sideslip turns with the path.
    pace = r / v
    turned = np.cumsum(0.1 * (pace[1:] + pace[:-1])) + beta[1:] - beta[0]
    path_turned = np.cumsum(0.1 * (transition.curvature[1:] + transition.curvature[:-1]))
    np.testing.assert_allclose(turned, path_turned, atol=2e-3)


def test_too_short_a_transition_is_refused_with_the_reason():
    with pytest.raises(NoTransitionError, match=r"steering angle of 0\.7.* give more distance"):
        plan_transition(NOMINAL, LEFT, RIGHT, 16.0)
