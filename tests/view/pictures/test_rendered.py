"""The still: Drake's renderer shows the cars where they are."""

import ctypes.util

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from drift_drake.view.colours import RUNS
from experiments.pictures.rendered import looking_at, still

OPENGL = any(ctypes.util.find_library(name) for name in ("EGL", "GL"))


def share_of_colour(pixels, index):
    """How much of a picture [height, width, 3] has the hue of the run of that number."""
    wanted = np.array(to_rgb(RUNS[index]))
    direction = wanted / np.linalg.norm(wanted)
    rgb = pixels.reshape(-1, 3) / 255.0
    return np.mean(rgb @ direction > 0.99 * np.linalg.norm(rgb, axis=1))


def test_a_camera_looks_at_its_target_with_the_horizon_level():
    pose = looking_at(np.array([3.0, -20.0, 9.0]), np.array([5.0, 1.0, 0.0]))
    x, y, z = (pose.inverse() @ np.array([5.0, 1.0, 0.0])).tolist()
    assert abs(x) < 1e-12
    assert abs(y) < 1e-12
    assert z == pytest.approx(np.sqrt(2.0**2 + 21.0**2 + 9.0**2))
    assert pose.rotation().matrix()[2, 0] == pytest.approx(0.0)  # right is level
    assert pose.rotation().matrix()[2, 1] < 0.0  # down is down


@pytest.mark.skipif(not OPENGL, reason="there is no OpenGL for Drake's renderer (Mesa's libEGL would do)")
def test_the_solid_car_is_in_the_middle_of_a_close_picture_while_it_moves(eight, perfect_run):
    behind = perfect_run.assign(t=perfect_run["t"] + 0.5)
    behind.loc[behind.index[0], "t"] = 0.0  # waits
    for time in (2.0, 6.0):
        figure = still({"here": perfect_run, "behind": behind}, time, eight, distance=15.0, size=(2.0, 1.0))
        pixels = figure.axes[0].images[0].get_array()
        height, width = pixels.shape[:2]
        assert (width, height) == (400, 200)
        middle = pixels[height // 4 : -height // 4, width // 4 : -width // 4]
        assert share_of_colour(middle, 0) > 0.02
        assert share_of_colour(pixels[: height // 6], 0) < 0.01
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["here", "behind"]


def test_a_run_without_a_column_is_named(perfect_run):
    with pytest.raises(ValueError, match=r"run 'a' lacks the column\(s\) psi"):
        still({"a": perfect_run.drop(columns="psi")}, 1.0)


def test_a_time_before_the_start_is_refused(perfect_run):
    with pytest.raises(ValueError, match="the time is -1 s; give seconds since the runs' start"):
        still({"a": perfect_run}, -1.0)
