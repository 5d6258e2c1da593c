"""Paths: geometry against direct integration, projection against construction."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from drift_drake.drive.reference.path import Path

NODES = [0.0, 40.0, 60.0, 130.0, 150.0, 300.0]
CURVATURE = [0.0, 0.0, 0.055, 0.055, -0.04, -0.01]


def test_the_pose_is_the_integral_of_the_curvature():
    path = Path(NODES, CURVATURE, start=(3.0, -2.0, 0.7))

    def heading(s: float) -> float:
        breaks = [node for node in NODES if node < s] + [s]
        values = np.interp(breaks, NODES, CURVATURE)
        return 0.7 + float(np.sum(np.diff(breaks) * (values[1:] + values[:-1]) / 2.0))

    for s in (0.0, 17.3, 40.0, 51.1, 133.3, 300.0):
        kinks = [node for node in NODES if 0.0 < node < s] or None
        options = {"points": kinks, "limit": 400, "epsabs": 1e-11, "epsrel": 1e-12}
        x = 3.0 + quad(lambda q: math.cos(heading(q)), 0.0, s, **options)[0]
        y = -2.0 + quad(lambda q: math.sin(heading(q)), 0.0, s, **options)[0]
        np.testing.assert_allclose(path.pose(s), (x, y, heading(s)), rtol=0.0, atol=1e-9)


def test_a_circle_comes_back():
    radius = 18.0
    path = Path([0.0, 2.0 * math.pi * radius], [1.0 / radius] * 2, start=(radius, 0.0, math.pi / 2.0), closed=True)
    angle = np.linspace(0.1, 6.1, 7)
    s, distance = radius * angle, np.linspace(9.0, 30.0, 7)
    polar = distance * np.cos(angle), distance * np.sin(angle)
    np.testing.assert_allclose(path.to_world(s, radius - distance), polar, atol=1e-9)
    x, y, heading = path.pose(s + 3.0 * path.length)
    np.testing.assert_allclose(np.stack([x, y]), np.stack(path.pose(s)[:2]), atol=1e-9)
    np.testing.assert_allclose(heading, path.heading(s) + 6.0 * math.pi, atol=1e-9)
    assert path.turning == pytest.approx(2.0 * math.pi)


def test_curvature_of_a_float_an_array_and_beyond_the_ends_agree():
    path = Path(NODES, CURVATURE)
    s = np.array([-5.0, 0.0, 12.0, 55.0, 60.0, 144.0, 300.0, 310.0])
    expected = np.interp(s, NODES, CURVATURE)
    np.testing.assert_allclose(path.curvature(s), expected, atol=1e-15)
    scalars = [path.curvature(float(value)) for value in s]
    assert all(type(value) is float for value in scalars)
    np.testing.assert_allclose(scalars, expected, atol=1e-15)


def test_an_open_path_goes_on_with_its_end_curvatures():
    path = Path([0.0, 20.0], [0.0, 0.05])
    longer = Path([0.0, 20.0, 60.0], [0.0, 0.05, 0.05])
    np.testing.assert_allclose(path.pose(57.0), longer.pose(57.0), atol=1e-10)
    np.testing.assert_allclose(path.pose(-4.0), (-4.0, 0.0, 0.0), atol=1e-12)


@pytest.mark.parametrize(
    ("s", "curvature", "sentence"),
    [
        ([0.0, 1.0], [0.0], "equally long"),
        ([0.0, 1.0], [0.0, math.nan], "finite"),
        ([1.0, 2.0], [0.0, 0.0], "start at 0"),
        ([0.0, 2.0, 2.0], [0.0, 0.0, 0.0], "ascend"),
    ],
)
def test_what_is_no_path_is_refused(s, curvature, sentence):
    with pytest.raises(ValueError, match=sentence):
        Path(s, curvature)


def test_a_closed_path_must_close():
    with pytest.raises(ValueError, match="misses its start"):
        Path([0.0, 10.0], [0.1, 0.1], closed=True)
