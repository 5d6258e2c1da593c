"""The brush tyre against its formula, its limits and its symmetries."""

import math

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd

from drift_drake.car.tyre import brush_secant, tyre_force

C, MU, F_Z = 2.2e5, 0.9, 8000.0
FULL_SLIDE = 3.0 * MU * F_Z / C  # slip from which the whole patch slides


def force_of(sigma_x, sigma_y):
    return tyre_force(sigma_x, sigma_y, C, MU * F_Z, 0.0)


def published_force(sigma):
    """The force as the nominal model's specification writes it."""
    q = C * sigma
    if q < 3.0 * MU * F_Z:
        return q - q**2 / (3.0 * MU * F_Z) + q**3 / (27.0 * MU**2 * F_Z**2)
    return MU * F_Z


@pytest.mark.parametrize("sigma", [1e-4, 0.01, 0.05, 0.5 * FULL_SLIDE, 0.999 * FULL_SLIDE, FULL_SLIDE, 0.3, 2.0])
@pytest.mark.parametrize("angle", [0.0, 0.4, 1.5, 2.9, -1.0])
def test_force_is_the_published_one_and_opposes_the_slip(sigma, angle):
    f_x, f_y = force_of(sigma * math.cos(angle), sigma * math.sin(angle))
    force = published_force(sigma)
    assert f_x == pytest.approx(force * math.cos(angle), rel=1e-9, abs=1e-9)
    assert f_y == pytest.approx(-force * math.sin(angle), rel=1e-9, abs=1e-9)


def test_slope_at_zero_slip_is_the_stiffness():
    derivative = force_of(AutoDiffXd(0.0, np.array([1.0])), AutoDiffXd(0.0, np.array([0.0])))[0]
    assert derivative.derivatives()[0] == pytest.approx(C, rel=1e-6)


def test_force_never_exceeds_friction_and_grows_until_full_slide():
    sigma = np.linspace(0.0, 2.0 * FULL_SLIDE, 2001)
    force = -force_of(0.0 * sigma, sigma)[1]
    assert force.max() <= MU * F_Z * (1.0 + 1e-12)
    gripping = sigma < FULL_SLIDE
    assert np.all(np.diff(force[gripping]) > 0.0)
    np.testing.assert_allclose(force[~gripping], MU * F_Z, rtol=1e-12)


def test_secant_and_its_slope_are_continuous_at_full_slide():
    below, above = (brush_secant(FULL_SLIDE * (1.0 + step), C, MU * F_Z) for step in (-1e-9, 1e-9))
    np.testing.assert_allclose(below, above, rtol=1e-7)


@pytest.mark.parametrize("sigma", [1e-6, 0.03, 0.2])
def test_slope_of_the_secant_is_its_derivative(sigma):
    secant, slope = brush_secant(complex(sigma, 1e-30), C, MU * F_Z)
    assert slope.real == pytest.approx(secant.imag / 1e-30, rel=1e-12)


def test_batches_of_any_shape():
    sigma = np.linspace(-0.3, 0.3, 24)
    flat = force_of(sigma, 0.5 * sigma)
    shaped = force_of(sigma.reshape(2, 3, 4), 0.5 * sigma.reshape(2, 3, 4))
    for one, other in zip(flat, shaped, strict=True):
        np.testing.assert_array_equal(one.reshape(2, 3, 4), other)
    one_by_one = [force_of(float(s), float(0.5 * s))[0] for s in sigma]
    np.testing.assert_allclose(flat[0], one_by_one, rtol=1e-14)
