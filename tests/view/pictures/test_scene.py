"""What the replay and the still show: a scene drawn on a canvas that keeps a list."""

import numpy as np
import pytest

from drift_drake.view.pictures.scene import Scene, car_path, front_wheels, poses


class Listed:
    """A canvas that keeps what it is given."""

    def __init__(self):
        self.meshes, self.cylinders, self.places, self.segments = {}, {}, {}, {}

    def mesh(self, path, vertices, faces, rgba):
        self.meshes[path] = (vertices, faces, rgba)

    def cylinder(self, path, radius, length, rgba):
        self.cylinders[path] = (radius, length, rgba)

    def lines(self, path, starts, ends, rgba):
        self.segments[path] = (starts, ends, rgba)

    def place(self, path, pose):
        self.places[path] = pose


def test_a_scene_has_ground_lane_traces_and_cars_of_which_the_first_is_solid(eight, perfect_run):
    canvas = Listed()
    scene = Scene.of({"a": perfect_run, "b": perfect_run}, eight, None)
    scene.draw(canvas)
    assert {"/ground", "/lane/surface", "/traces/0/0", f"{car_path(1)}/roof"} <= set(canvas.meshes)
    opacity = [canvas.meshes[f"{car_path(k)}/body"][2].a() for k in (0, 1)]
    assert opacity[0] == 1.0 > opacity[1]
    for vertices, faces, _ in canvas.meshes.values():
        assert np.isfinite(vertices).all()
        assert 0 <= faces.min() <= faces.max() < vertices.shape[1]
    starts, ends, _ = canvas.segments["/ground_lines"]
    assert starts.shape == ends.shape == (3, starts.shape[1])
    low, high = scene.extent()
    trace = canvas.meshes["/traces/0/0"][0][:2]
    assert (trace > low[:, None] - 1.0).all()
    assert (trace < high[:, None] + 1.0).all()


def test_poses_are_those_of_the_rows_and_wait_through_gaps(perfect_run):
    gap = perfect_run.copy()
    gap.loc[gap.index[:50], ["x", "y", "psi"]] = float("nan")
    row = perfect_run.iloc[100]
    x, y, psi, delta = (value[0] for value in poses(perfect_run, np.array([row["t"]])))
    np.testing.assert_allclose([x, y, delta], row[["x", "y", "delta"]].to_numpy(dtype=float))
    assert np.cos(psi - row["psi"]) == pytest.approx(1.0)
    early = poses(gap, np.array([0.0, 0.5]))
    assert early[0][0] == early[0][1] == gap["x"].iloc[50]


def test_the_front_wheels_turn_with_the_steering(eight, perfect_run):
    scene = Scene.of({"a": perfect_run}, eight, None)
    for pose in front_wheels(scene.shape, 0.3).values():
        np.testing.assert_allclose(pose.rotation().matrix()[:2, 0], [np.cos(0.3), np.sin(0.3)])
