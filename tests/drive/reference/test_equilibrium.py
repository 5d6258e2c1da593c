"""Drift equilibria: steady, as published for the nominal car, mirrored, and refused where there is none."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import derivatives
from drift_drake.drive.reference.equilibrium import NoEquilibriumError, drift_equilibrium

NOMINAL = VehicleParameters()


@pytest.mark.parametrize(("radius", "sideslip"), [(18.0, -0.6), (-18.0, 0.6), (18.0, -0.4), (40.0, -0.6), (-25.0, 0.3)])
def test_nothing_changes_at_an_equilibrium(radius, sideslip):
    q = drift_equilibrium(NOMINAL, radius, sideslip)
    x = np.array([q.r, q.v, q.beta, q.omega_r, 0.0, 0.0])
    x_dot = derivatives(x, np.array([q.delta, q.tau]), q.curvature, NOMINAL.constants())
    np.testing.assert_allclose(x_dot, 0.0, atol=1e-6)
    assert q.curvature == 1.0 / radius
    assert q.beta == sideslip
    assert q.omega_r > q.v  # the rear wheels spin


def test_the_drift_that_the_nominal_car_is_known_for():
    q = drift_equilibrium(NOMINAL, 18.0, -0.6)
    assert q.v == pytest.approx(12.7, abs=0.05)
    assert q.omega_r == pytest.approx(17.5, abs=0.05)
    assert q.delta == pytest.approx(-0.46, abs=0.005)
    assert q.tau == pytest.approx(168.0, abs=1.0)


def test_a_right_turn_mirrors_a_left_one():
    left, right = drift_equilibrium(NOMINAL, 18.0, -0.6), drift_equilibrium(NOMINAL, -18.0, 0.6)
    assert (right.v, right.omega_r, right.tau) == (left.v, left.omega_r, left.tau)
    assert (right.beta, right.r, right.delta, right.curvature) == (-left.beta, -left.r, -left.delta, -left.curvature)


def test_a_drift_beyond_the_steering_lock_is_refused_and_exists_with_more_lock():
    with pytest.raises(NoEquilibriumError, match=r"radius of 18 m and a sideslip of -0\.8 rad"):
        drift_equilibrium(NOMINAL, 18.0, -0.8)
    wider = drift_equilibrium(NOMINAL.replace(steering_limit=0.9), 18.0, -0.8)
    assert -0.9 < wider.delta < -0.66


def test_the_wrong_sign_is_explained():
    with pytest.raises(NoEquilibriumError, match="negative sideslip"):
        drift_equilibrium(NOMINAL, 18.0, 0.6)


def test_degrees_are_refused():
    with pytest.raises(ValueError, match="in radians"):
        drift_equilibrium(NOMINAL, 18.0, -35.0)


def test_equilibria_are_found_all_over_the_range_of_radii_and_sideslips():
    constants = NOMINAL.constants()
    for radius in (8.0, 10.0, 15.0, 25.0, 60.0):
        for sideslip in (-0.1, -0.3, -0.5, -0.7):
            q = drift_equilibrium(NOMINAL, radius, sideslip)
            x_dot = derivatives(np.array([q.r, q.v, q.beta, q.omega_r, 0.0, 0.0]), np.array([q.delta, q.tau]),
                                q.curvature, constants)  # fmt: skip
            np.testing.assert_allclose(x_dot, 0.0, atol=1e-5)
