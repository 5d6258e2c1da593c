"""References: what is wanted along the straight line, the figure-8 and the loops, and horizons of it."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.reference.equilibrium import drift_equilibrium
from drift_drake.drive.reference.trajectory import figure_8, loops, straight_line

NOMINAL = VehicleParameters()


@pytest.fixture(scope="module")
def eight():
    return figure_8(NOMINAL)


def test_the_straight_line_of_section_4a():
    reference = straight_line(7.5, 20.0, 4.5)
    horizon = reference.horizon(0.0, 0.1, 45)
    assert horizon.x_ref.shape == (46, 6)
    assert horizon.u_ref.shape == (46, 2)
    assert horizon.curvature.shape == (45,)
    np.testing.assert_allclose(horizon.x_ref[:, 1], np.linspace(7.5, 20.0, 46), atol=1e-3)
    np.testing.assert_array_equal(horizon.x_ref[:, 3], horizon.x_ref[:, 1])
    np.testing.assert_array_equal(horizon.x_ref[:, [0, 2, 4, 5]], 0.0)
    assert horizon.s[-1] == pytest.approx(0.5 * (7.5 + 20.0) * 4.5, abs=1e-3)
    assert reference.duration == pytest.approx(4.5, abs=1e-4)


def test_beyond_the_straight_lines_end_the_last_speed_holds():
    reference = straight_line(7.5, 20.0, 4.5)
    horizon = reference.horizon(reference.path.length - 1.0, 0.1, 10)
    assert horizon.s[-1] == pytest.approx(reference.path.length + 19.0, abs=0.1)
    np.testing.assert_allclose(horizon.x_ref[1:, 1], 20.0)


def test_the_figure_8_closes_and_has_two_circles(eight):
    start, end = np.array(eight.path.pose(0.0)), np.array(eight.path.pose(eight.path.length - 1e-9))
    np.testing.assert_allclose(start, end, atol=1e-6)
    assert eight.path.turning == pytest.approx(0.0, abs=1e-9)
    for side, where in ((1.0, 0.0), (-1.0, 0.5)):
        centre = eight.path.to_world(where * eight.path.length, side * 18.0)
        assert centre[1] == pytest.approx(0.0, abs=1e-6)
        s = (where + np.linspace(-0.15, 0.15, 31)) * eight.path.length
        x, y, _ = eight.path.pose(s)
        np.testing.assert_allclose(np.hypot(x - centre[0], y - centre[1]), 18.0, atol=1e-6)
    assert 25.0 < eight.duration < 30.0


def test_the_figure_8_drifts_steadily_on_both_circles(eight):
    left = drift_equilibrium(NOMINAL, 18.0, -0.6)
    for side, s in ((1.0, 0.0), (-1.0, 0.5 * eight.path.length)):
        wanted = [side * left.r, left.v, side * left.beta, left.omega_r, 0.0, 0.0]
        np.testing.assert_allclose(eight.state(s), wanted, atol=1e-9)
        np.testing.assert_allclose(eight.input(s), [side * left.delta, left.tau], atol=1e-9)
        assert not eight.transition(s)
    lengths = np.diff(np.flatnonzero(np.diff(eight.in_transition.astype(int))))[::2] * eight.s[1]
    np.testing.assert_allclose(lengths, 20.0, atol=0.4)


def test_lookups_wrap_on_a_closed_path(eight):
    s = np.linspace(0.0, eight.path.length, 57, endpoint=False)
    np.testing.assert_allclose(eight.state(s + eight.path.length), eight.state(s), atol=1e-9)
    np.testing.assert_allclose(eight.time(s + eight.path.length), eight.time(s) + eight.time(eight.path.length))
    np.testing.assert_allclose(eight.position(eight.time(3.0 * s)), 3.0 * s, atol=1e-9)


@pytest.mark.parametrize("s0", [0.0, 40.0, 220.0, 500.0])
def test_a_horizon_integrates_the_speed_along_the_path(eight, s0):
    horizon = eight.horizon(s0, 0.1, 25)
    solution = solve_ivp(lambda _, s: eight.state(s[0])[1], (0.0, 2.5), [s0], t_eval=0.1 * np.arange(26), max_step=0.01)
    np.testing.assert_allclose(horizon.s, solution.y[0], atol=1e-3)
    np.testing.assert_allclose(horizon.x_ref, eight.state(horizon.s), atol=1e-12)
    turned = np.diff(eight.path.heading(horizon.s))
    np.testing.assert_allclose(horizon.curvature * np.diff(horizon.s), turned, atol=2e-4)
    np.testing.assert_array_equal(horizon.e_min, -3.0)
    np.testing.assert_array_equal(horizon.e_max, 3.0)


def test_course_yaw_rate_and_sideslip_agree_along_the_figure_8(eight):
    s = np.linspace(0.0, eight.path.length, 4000)
    r, v, beta = eight.state(s).T[:3]
    pace = r / v
    turned = np.concatenate([[0.0], np.cumsum(np.diff(s) * 0.5 * (pace[1:] + pace[:-1]))]) + beta - beta[0]
    np.testing.assert_allclose(turned, eight.path.heading(s) - eight.path.heading(0.0), atol=0.01)


def test_loops_go_from_grip_to_drift_and_swing_from_side_to_side():
    reference = loops(NOMINAL, count=3)
    left = drift_equilibrium(NOMINAL, 18.0, -0.6)
    np.testing.assert_allclose(reference.state(0.0), [0.0, 8.0, 0.0, 8.0, 0.0, 0.0], atol=1e-9)
    on_straight = reference.s < 65.0
    np.testing.assert_allclose(reference.beta[on_straight], 0.0, atol=1e-9)
    assert (np.diff(reference.v[on_straight]) > -1e-9).all()
    steady = ~reference.in_transition & ~on_straight & (np.abs(reference.beta) > 0.1)
    np.testing.assert_allclose(np.abs(reference.beta[steady]), 0.6, atol=1e-9)
    np.testing.assert_allclose(reference.v[steady], left.v, atol=1e-9)
    sides = np.sign(reference.beta[steady])
    assert np.count_nonzero(np.diff(sides)) == 2
    assert sides[0] == -1.0
    # Loops follow each other along x.
    headings = reference.path.heading(reference.s)
    assert headings.max() == pytest.approx(2.0, abs=0.2)
    assert headings.min() == pytest.approx(-2.0, abs=0.2)


def test_a_reference_must_make_sense(eight):
    with pytest.raises(ValueError, match="speed must be positive"):
        dataclasses.replace(eight, v=eight.v - 20.0)
    with pytest.raises(ValueError, match="within its lane"):
        dataclasses.replace(eight, e_min=eight.e_max)
    with pytest.raises(ValueError, match="reference's beta"):
        dataclasses.replace(eight, beta=eight.beta * np.nan)
    with pytest.raises(ValueError, match="uniform"):
        dataclasses.replace(eight, s=eight.s**2 / eight.s[-1])
    with pytest.raises(ValueError, match="positive"):
        straight_line(0.0, 20.0, 4.5)
