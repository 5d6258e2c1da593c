"""A moment of runs in three dimensions as a picture: Drake's own renderer sees the scene that the replay plays."""

import dataclasses
from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    Cylinder,
    GeometryInstance,
    InMemoryMesh,
    LightParameter,
    MakeRenderEngineVtk,
    Mesh,  # fmt: skip
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    Rgba,
    SceneGraph,
    Shape,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.sensors import CameraInfo

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.drive.reference.trajectory import Reference
from drift_drake.view.pictures.scene import (
    BACKGROUND,
    FIELD_OF_VIEW,
    Faces,
    Scene,
    car_path,
    car_pose,
    front_wheels,
    poses,
)
from drift_drake.view.style import RESOLUTION, colours_of, styled

LINES_WIDTH = 0.08  # [m] of a canvas's thin lines
CLOSE = np.array([0.0, -0.85, 0.53])  # where a close camera is from the cars, of its distance
RENDERER = "vtk"


@styled
def still(
    runs: Mapping[str, pd.DataFrame],
    time: float,
    reference: Reference | None = None,
    parameters: VehicleParameters | None = None,
    distance: float | None = None,
    size: tuple[float, float] = (6.4, 3.2),
) -> Figure:
    """Draws runs, all started together, as they stand after a time, and what they have driven until then.

    Args:
        runs: tables with t, x, y, psi, delta (SI) by name; a run that has ended stands where it did. time: [s] since
            their first rows. reference, parameters: see `replay`. distance: [m] from the middle of the cars to the
            camera; the replay's overview without. size: of the picture [in].

    Raises:
        ValueError: a run lacks a column or has no row; the time is before the start.
        RuntimeError: there is no OpenGL for the renderer.
    """
    if not time >= 0.0:
        raise ValueError(f"the time is {time:g} s; give seconds since the runs' start, 0 or more")
    scene = Scene.of(runs, reference, parameters)
    scene = dataclasses.replace(
        scene, runs={name: run[run["t"] - run["t"].iloc[0] <= time] for name, run in scene.runs.items()}
    )
    canvas = _RenderedCanvas()
    scene.draw(canvas)
    stands = [[float(value[0]) for value in poses(run, np.array([time]))] for run in scene.runs.values()]
    for index, (x, y, psi, delta) in enumerate(stands):
        canvas.place(car_path(index), car_pose(x, y, psi))
        for wheel, pose in front_wheels(scene.shape, delta).items():
            canvas.place(f"{car_path(index)}/{wheel}", pose)
    view = scene.overview()
    if distance is not None:
        middle = np.append(np.mean(stands, axis=0)[:2], 0.0)
        view = np.stack([middle + distance * CLOSE, middle])
    figure = Figure(figsize=size, dpi=RESOLUTION)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    width, height = (round(RESOLUTION * length) for length in size)
    axes.imshow(canvas.render(view, width, height))
    axes.set_axis_off()
    colours = dict(zip(runs, colours_of(runs), strict=True))
    handles = [Line2D([], [], color=colour, linewidth=3.0, label=name) for name, colour in colours.items()]
    axes.legend(handles=handles, loc="upper left", frameon=True, framealpha=0.85, edgecolor="none",
                title=f"after {time:.1f} s", alignment="left")  # fmt: skip
    return figure


class _RenderedCanvas:
    """A `Canvas` that Drake's VTK renderer sees, without a window."""

    def __init__(self) -> None:
        self._things: list[tuple[str, Shape, Rgba]] = []
        self._poses: dict[str, RigidTransform] = {}

    def mesh(self, path: str, vertices: Array, faces: Faces, rgba: Rgba) -> None:
        a, b, c = (vertices[:, face] for face in faces)
        normals = np.cross(b - a, c - a, axis=0)
        normals /= np.maximum(np.linalg.norm(normals, axis=0), 1e-12)
        lines = [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in vertices.T]
        lines += [f"vn {x:.5f} {y:.5f} {z:.5f}" for x, y, z in normals.T]
        lines += [f"f {i}//{k} {j}//{k} {m}//{k}" for k, (i, j, m) in enumerate(faces.T + 1, 1)]
        obj = MemoryFile("\n".join(lines), ".obj", path)
        self._things.append((path, Mesh(InMemoryMesh(mesh_file=obj)), rgba))

    def cylinder(self, path: str, radius: float, length: float, rgba: Rgba) -> None:
        self._things.append((path, Cylinder(radius, length), rgba))

    def lines(self, path: str, starts: Array, ends: Array, rgba: Rgba) -> None:
        along = ends - starts
        across = 0.5 * LINES_WIDTH * np.stack([-along[1], along[0], 0.0 * along[2]]) / np.linalg.norm(along, axis=0)
        corners = np.hstack([starts - across, ends - across, ends + across, starts + across])
        count = starts.shape[1]
        a, b, c, d = (np.arange(count) + k * count for k in range(4))
        self.mesh(path, corners, np.hstack([np.stack([a, b, c]), np.stack([a, c, d])]).astype(np.int32), rgba)

    def place(self, path: str, pose: RigidTransform) -> None:
        self._poses[path] = pose

    def render(self, view: Array, width: int, height: int) -> NDArray[np.uint8]:
        """The picture [height, width, 3] by a camera whose place, and what it looks at, are the view [2, 3] [m]."""
        graph = SceneGraph()
        light = LightParameter(type="directional", direction=np.array([0.3, 0.5, -1.0]), intensity=1.2, frame="world")
        graph.AddRenderer(
            RENDERER, MakeRenderEngineVtk(RenderEngineVtkParams(default_clear_color=BACKGROUND, lights=[light]))
        )
        source = graph.RegisterSource("scene")
        for path, shape, rgba in self._things:
            properties = PerceptionProperties()
            properties.AddProperty("phong", "diffuse", rgba)
            instance = GeometryInstance(self._world_pose(path), shape, path)
            instance.set_perception_properties(properties)
            graph.RegisterAnchoredGeometry(source, instance)
        core = RenderCameraCore(
            RENDERER,
            CameraInfo(width, height, np.deg2rad(FIELD_OF_VIEW)),
            ClippingRange(0.5, 2000.0),
            RigidTransform(),
        )
        query = graph.get_query_output_port().Eval(graph.CreateDefaultContext())
        image = query.RenderColorImage(ColorRenderCamera(core), graph.world_frame_id(), looking_at(*view))
        return np.asarray(image.data[:, :, :3])

    def _world_pose(self, path: str) -> RigidTransform:
        """A thing's pose: those of its parents and its own, one after the other."""
        parts = path.split("/")
        pose = RigidTransform()
        for k in range(2, len(parts) + 1):
            pose = pose @ self._poses.get("/".join(parts[:k]), RigidTransform())
        return pose


def looking_at(place: Array, target: Array) -> RigidTransform:
    """The pose of a camera (x to the right, y down, z ahead) at a place that looks at a target [3]."""
    ahead = (target - place) / np.linalg.norm(target - place)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return RigidTransform(RotationMatrix(np.stack([right, np.cross(ahead, right), ahead], axis=1)), place)
