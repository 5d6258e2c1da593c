"""The Magic Formula tyre: slopes, peak, load, and that it never drives the contact."""

import itertools

import numpy as np
import pytest

from drift_drake.car.double_track.parameters import TireParameters
from drift_drake.car.double_track.tyres import friction_at, magic_formula, stiffness_per_load, tire_force

TIRE = TireParameters().constants()
LOAD = 4000.0


def test_slopes_at_zero_slip_are_the_stiffnesses():
    slip = 1e-6
    f_x, _ = tire_force(slip, 0.0, LOAD, TIRE)
    _, f_y = tire_force(0.0, slip, LOAD, TIRE)
    # Pacejka's K = K_max sin(2 atan(F_z / F_zk))
    share = np.sin(2.0 * np.arctan(LOAD / TIRE.stiffest_load))
    assert f_x / slip == pytest.approx(TIRE.longitudinal_stiffness * share, rel=1e-6)
    assert f_y / slip == pytest.approx(-TIRE.lateral_stiffness * share, rel=1e-6)
    assert LOAD * stiffness_per_load(TIRE.lateral_stiffness, LOAD, TIRE.stiffest_load) == pytest.approx(
        TIRE.lateral_stiffness * share
    )


def test_peak_is_friction_times_load_and_sliding_is_below_it():
    slip = np.linspace(0.0, 3.0, 20_001)
    _, f_y = tire_force(0.0 * slip, slip, LOAD, TIRE)
    peak = TIRE.lateral_friction * LOAD
    assert np.max(-f_y) == pytest.approx(peak, rel=1e-6)
    assert -f_y[-1] == pytest.approx(peak * np.sin(TIRE.shape * np.pi / 2.0), rel=0.05)


def test_friction_falls_with_load():
    assert friction_at(1.0, TIRE.nominal_load, TIRE) == 1.0
    assert friction_at(1.0, 1.5 * TIRE.nominal_load, TIRE) == pytest.approx(1.0 - 0.5 * TIRE.load_sensitivity)
    assert friction_at(1.0, 1e6, TIRE) > 0.0


def test_two_unevenly_loaded_tyres_hold_less_than_two_even_ones():
    def side_force(load):
        return -tire_force(0.0, 0.3, load, TIRE)[1]

    assert side_force(2000.0) + side_force(6000.0) < 2.0 * side_force(4000.0)


def test_combined_force_stays_within_the_friction_ellipse_and_brakes_the_contact():
    for s_x, s_y in itertools.product(np.linspace(-1.0, 1.0, 21), repeat=2):
        f_x, f_y = tire_force(s_x, s_y, LOAD, TIRE)
        assert np.hypot(f_x / TIRE.longitudinal_friction, f_y / TIRE.lateral_friction) <= LOAD * (1.0 + 1e-9)
        # The contact patch slides with the velocity (-s_x, s_y): its friction takes power, never gives it.
        assert -f_x * s_x + f_y * s_y <= 0.0


def test_a_sliding_tyre_acts_against_its_sliding_velocity():
    tire = TIRE._replace(longitudinal_friction=TIRE.lateral_friction)
    f_x, f_y = tire_force(1.5, 1.0, LOAD, tire)
    assert f_x / -f_y == pytest.approx(1.5, rel=0.02)


def test_magic_formula_has_the_slope_one_and_is_odd():
    assert magic_formula(1e-7, 1.4, -0.5) == pytest.approx(1e-7)
    assert magic_formula(-2.0, 1.4, -0.5) == -magic_formula(2.0, 1.4, -0.5)


def test_small_slips_in_both_directions_make_the_force_of_either_stiffness():
    """At slips that slide nowhere a linear tyre: each component is its own stiffness times its own slip."""
    s_x, s_y = 2e-5, -1e-5
    share = np.sin(2.0 * np.arctan(LOAD / TIRE.stiffest_load))
    expected = (TIRE.longitudinal_stiffness * share * s_x, -TIRE.lateral_stiffness * share * s_y)
    assert tire_force(s_x, s_y, LOAD, TIRE) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("curvature", [-0.8, 0.0, 0.6])
def test_magic_formula_is_pacejkas(curvature):
    """sin(C atan(B x - E (B x - atan(B x)))), whose slope at zero, B C, is one."""
    shape = 1.4
    b = 1.0 / shape
    for x in (0.1, 1.0, 5.0, 40.0):
        pacejka = np.sin(shape * np.arctan((1.0 - curvature) * b * x + curvature * np.arctan(b * x)))
        assert magic_formula(x, shape, curvature) == pytest.approx(pacejka, rel=1e-12)


def test_the_least_friction_is_a_share_of_the_nominal_one():
    least = friction_at(1.0, 1e9, TIRE)
    assert 0.0 < least < 0.5
    assert friction_at(0.4, 1e9, TIRE) == pytest.approx(0.4 * least)
