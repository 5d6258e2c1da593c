"""A closed track: it closes with a continuous curvature, and its speed keeps to its accelerations."""

import math
from typing import Any

import numpy as np
import pytest

from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.reference.stadium import Stadium, speed_profile, stadium, stadium_path


@pytest.mark.parametrize("track", [Stadium(), Stadium(10.0, 12.0, 30.0), Stadium(5.0, 15.0, math.pi * 15.0)])
def test_it_closes_with_a_continuous_curvature(track: Stadium) -> None:
    path = stadium_path(track)  # which raises unless its end meets its start
    assert path.turning == pytest.approx(2.0 * math.pi)
    s = np.linspace(0.0, 2.0 * path.length, 20_001)
    curvature = path.curvature(s)
    assert np.abs(np.diff(curvature)).max() <= 1.01 * (s[1] - s[0]) / (track.radius * track.transition)
    assert (curvature.min(), curvature.max()) == (0.0, pytest.approx(1.0 / track.radius, rel=1e-3))
    assert path.length == pytest.approx(2.0 * (track.straight + track.transition + math.pi * track.radius))


def test_its_straights_are_parallel_and_opposite() -> None:
    track = Stadium()
    path = stadium_path(track)
    x, y, heading = path.pose(np.array([0.0, track.straight, 0.5 * path.length, 0.5 * path.length + track.straight]))
    np.testing.assert_allclose(y[:2], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.diff(heading)[1], math.pi)
    np.testing.assert_allclose([x[3] - x[2], y[3] - y[2]], [-track.straight, 0.0], atol=1e-6)
    assert y[2] > 2.0 * track.radius


def test_its_speed_is_bounded_across_and_along_and_goes_round() -> None:
    track = Stadium()
    course = stadium(track, 20.0, 3.0)
    v, across = course.v, course.curvature * course.v**2
    assert across.max() == pytest.approx(track.lateral)
    along = np.diff(v**2) / (2.0 * np.diff(course.s))
    assert -track.braking - 1e-9 <= along.min() < -0.6
    assert 2.0 < along.max() <= track.accelerating + 1e-9
    assert v[0] == v[-1] > v.min() == pytest.approx(math.sqrt(track.lateral * track.radius))
    np.testing.assert_allclose(course.r, course.curvature * v)


def test_a_slow_car_drives_all_of_it_alike() -> None:
    v = speed_profile(Stadium(), np.array([0.0, 0.05, 0.0]), 1.0, 6.0)
    np.testing.assert_array_equal(v, 6.0)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"transition": 80.0}, "the track's transition is 80; give above 0, up to 62.83"),
        ({"lateral": 12.0}, "the track's lateral is 12; give above 0, up to 8"),
        ({"straight": 0.0}, "the track's straight is 0; give above 0, up to 1000"),
        ({"braking": math.nan}, "the track's braking is nan"),
    ],
)
def test_a_track_that_cannot_be_driven_is_refused(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InvalidOptionError, match=sentence):
        Stadium(**options)
