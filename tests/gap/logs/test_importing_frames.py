"""Axes of other conventions, and rigid bodies."""

import numpy as np
import pytest

from drift_drake.gap.logs.wording.conversion import MIRRORED, PlanarMotion, at_centre_of_gravity, to_body, to_iso8855


@pytest.mark.parametrize("frame", ["ned", "sae"])
def test_a_right_turn_stays_a_right_turn(frame):
    t = np.linspace(0.0, 3.0, 50)
    # North at first, then east: clockwise from above.
    heading = 0.5 * t
    north, east = 10.0 * np.sin(heading), 10.0 * (1.0 - np.cos(heading))
    x, y, psi = (to_iso8855(name, values, frame) for name, values in (("x", north), ("y", east), ("psi", heading)))
    course = np.arctan2(np.gradient(y), np.gradient(x))
    np.testing.assert_allclose(course[1:-1], psi[1:-1], atol=1e-3)
    assert psi[-1] < -1.4
    assert np.all(to_iso8855("r", np.full(5, 0.5), frame) < 0.0)


def test_what_is_mirrored_and_what_is_not():
    values = np.array([1.0, 2.0])
    for name in ("x", "vx", "v", "ax", "omega_r", "tau_cmd", "throttle"):
        np.testing.assert_array_equal(to_iso8855(name, values, "ned"), values)
    for name in MIRRORED:
        np.testing.assert_array_equal(to_iso8855(name, values, "sae"), -values)
        np.testing.assert_array_equal(to_iso8855(name, values, "iso8855"), values)
    with pytest.raises(ValueError, match="unknown frame 'enu'"):
        to_iso8855("r", values, "enu")


def test_components_along_and_across_are_those_of_a_turned_frame():
    """Against complex numbers: a vector of the fixed frame, turned back by the heading."""
    psi, x, y = np.random.default_rng(0).normal(size=(3, 50))
    turned = (x + 1j * y) * np.exp(-1j * psi)
    np.testing.assert_allclose(to_body(psi, x, y), [turned.real, turned.imag], atol=1e-14)


def test_motion_of_the_centre_from_that_of_another_point():
    h, t = 1e-3, np.arange(0.0, 2.0, 1e-3)
    psi = 0.3 + 0.8 * t + 0.2 * np.sin(3.0 * t)
    x, y = 2.0 * t + np.sin(t), np.cos(2.0 * t)
    along, across = 0.7, -0.2

    def seen(px, py):
        vx, vy = np.gradient(px, h), np.gradient(py, h)
        return PlanarMotion(px, py, *to_body(psi, vx, vy), *to_body(psi, np.gradient(vx, h), np.gradient(vy, h)))

    point = seen(x + along * np.cos(psi) - across * np.sin(psi), y + along * np.sin(psi) + across * np.cos(psi))
    r = np.gradient(psi, h)
    centre, expected = at_centre_of_gravity(point, (along, across), psi, r, np.gradient(r, h)), seen(x, y)
    for name in PlanarMotion._fields:
        np.testing.assert_allclose(getattr(centre, name)[5:-5], getattr(expected, name)[5:-5], atol=2e-5, err_msg=name)
