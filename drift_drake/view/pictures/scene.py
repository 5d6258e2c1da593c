"""What runs look like in three dimensions: ground, lane, traces and cars, drawn on either kind of canvas."""

import dataclasses
from collections.abc import Mapping
from typing import Protocol

import numpy as np
import pandas as pd
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from pydrake.geometry import Rgba
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from drift_drake.car.log.driving import spans
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.drive.reference.trajectory import Reference
from drift_drake.view.pictures.car_shape import CarShape, model_scale
from drift_drake.view.style import check_runs, colours_of

Faces = NDArray[np.int32]

COLUMNS = ("t", "x", "y", "psi", "delta")
LINE_SPACING = 0.5  # [m] between points of lines on the ground

SILL, WAIST, ROOF = 0.18, 0.78, 1.28  # [m] heights of the car's body
GHOST_OPACITY = 0.45

# [m] heights that keep what lies on the ground from flickering through each other.
GROUND, LANE, LINE, TRACE = -0.05, 0.0, 0.04, 0.08
LINE_WIDTH, TRACE_WIDTH = 0.18, 0.24  # [m]
GRID, GRID_MARGIN = 10.0, 40.0  # [m] between the ground's lines, and beyond where runs go
FIELD_OF_VIEW = 45.0  # [deg], vertical
BACKGROUND = (0.93, 0.94, 0.95)


class Canvas(Protocol):
    """Takes a scene. Things have paths, and `/car/wheel` moves with `/car`."""

    def mesh(self, path: str, vertices: Array, faces: Faces, rgba: Rgba) -> None:
        """Triangles: vertices [3, n] [m], faces [3, m]."""

    def cylinder(self, path: str, radius: float, length: float, rgba: Rgba) -> None:
        """A cylinder along z about the origin [m]."""

    def lines(self, path: str, starts: Array, ends: Array, rgba: Rgba) -> None:
        """Thin lines on the ground, from starts to ends [3, n] [m]."""

    def place(self, path: str, pose: RigidTransform) -> None:
        """Where a thing stands in its parent."""


@dataclasses.dataclass(frozen=True)
class Scene:
    """Runs, magnified to a full-size car's if theirs is a model, and what they are driven on."""

    runs: Mapping[str, pd.DataFrame]
    reference: Reference | None
    shape: CarShape
    scale: float  # of the car relative to a full-size one

    @classmethod
    def of(
        cls, runs: Mapping[str, pd.DataFrame], reference: Reference | None, parameters: VehicleParameters | None
    ) -> "Scene":
        """The scene of runs with t, x, y, psi, delta (SI), of the default car without parameters.

        Raises:
            ValueError: there is no run; a run lacks a column or has no row.
        """
        check_runs(runs, COLUMNS)
        parameters = parameters or VehicleParameters()
        scale = model_scale(parameters)
        runs = {name: run.assign(x=run["x"] / scale, y=run["y"] / scale) for name, run in runs.items()}
        return cls(runs, reference, CarShape.of(parameters).scaled(1.0 / scale), scale)

    def extent(self) -> tuple[Array, Array]:
        """Corners [2] [m] of the ground that matters."""
        points = [run[["x", "y"]].to_numpy(dtype=float) for run in self.runs.values()]
        if self.reference is not None:
            points.append(np.stack(self.reference.path.pose(_positions(self.reference))[:2], axis=-1) / self.scale)
        everywhere = np.concatenate(points)
        return np.nanmin(everywhere, axis=0), np.nanmax(everywhere, axis=0)

    def overview(self) -> Array:
        """A camera that sees all of it from the south and above: its place, and what it looks at [2, 3] [m]."""
        low, high = self.extent()
        centre, size = 0.5 * (low + high), high - low
        # Far enough back for the width on a wide screen and for the height.
        half = np.tan(np.deg2rad(0.5 * FIELD_OF_VIEW))
        distance = max(0.5 * size[0] / (1.3 * half), 0.5 * size[1] / half) + 12.0
        return np.array([[centre[0], centre[1] - 0.6 * distance, 0.8 * distance], [*centre, 0.0]])

    def draw(self, canvas: Canvas) -> None:
        """Ground, reference, traces and cars; the first car is solid, the others are ghosts."""
        low, high = self.extent()
        centre, reach = 0.5 * (low + high), 0.5 * (high - low) + 400.0
        corners = np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]]) * reach[:, None] + centre[:, None]
        faces = np.array([[0, 0], [1, 2], [2, 3]], dtype=np.int32)
        canvas.mesh("/ground", np.vstack([corners, np.full(4, GROUND)]), faces, Rgba(0.93, 0.94, 0.92, 1.0))
        _draw_grid(canvas, low - GRID_MARGIN, high + GRID_MARGIN)
        if self.reference is not None:
            _draw_reference(canvas, self.reference, self.scale)
        for index, (run, colour) in enumerate(zip(self.runs.values(), colours_of(self.runs), strict=True)):
            paint = to_rgb(colour)
            _draw_trace(canvas, f"/traces/{index}", run, TRACE + 0.02 * index, paint)
            _build_car(canvas, car_path(index), self.shape, paint, 1.0 if index == 0 else GHOST_OPACITY)


def car_path(index: int) -> str:
    """Of the run's car in the scene."""
    return f"/runs/{index}/car"


def car_pose(x: float, y: float, psi: float) -> RigidTransform:
    """Of a car on the ground."""
    return RigidTransform(RotationMatrix.MakeZRotation(psi), np.array([x, y, 0.0]))


def poses(run: pd.DataFrame, times: Array) -> tuple[Array, Array, Array, Array]:
    """(x, y [m], psi, delta [rad]) at times [s] since the run's first row; before a gap's end, those after it."""
    run = run.ffill().bfill()
    t = run["t"].to_numpy(dtype=float) - float(run["t"].iloc[0])
    x, y, delta = (np.interp(times, t, run[name].to_numpy(dtype=float)) for name in ("x", "y", "delta"))
    return x, y, np.interp(times, t, np.unwrap(run["psi"].to_numpy(dtype=float))), delta


def front_wheels(shape: CarShape, delta: float) -> dict[str, RigidTransform]:
    """Poses in the car of its front wheels' pivots, steered by delta [rad]."""
    turn, centres = RotationMatrix.MakeZRotation(delta), shape.wheel_centres()
    return {f"pivot{k}": RigidTransform(turn, np.array([*centres[k], shape.wheel_radius])) for k in (0, 1)}


def _draw_grid(canvas: Canvas, low: Array, high: Array) -> None:
    """Lines on the ground, against which motion is seen."""
    x, y = (np.arange(np.floor(a / GRID), np.ceil(b / GRID) + 1.0) * GRID for a, b in zip(low, high, strict=True))
    along_y = [[[v, y[0]], [v, y[-1]]] for v in x]
    along_x = [[[x[0], v], [x[-1], v]] for v in y]
    ends = np.array(along_y + along_x)  # [lines, 2, 2]
    ends = np.concatenate([ends, np.full((*ends.shape[:2], 1), 0.5 * (GROUND + LANE))], axis=-1)
    canvas.lines("/ground_lines", ends[:, 0].T, ends[:, 1].T, Rgba(0.92, 0.92, 0.92, 1.0))


def _positions(reference: Reference) -> Array:
    length = min(reference.distance, reference.path.length)
    return np.linspace(0.0, length, int(np.ceil(length / LINE_SPACING)) + 1)


def _draw_reference(canvas: Canvas, reference: Reference, scale: float) -> None:
    s = _positions(reference)
    low, high = reference.lane(s)

    def strip(name: str, right: Array, left: Array, height: float, rgba: Rgba) -> None:
        right_edge, left_edge = (np.stack(reference.path.to_world(s, e)) / scale for e in (right, left))
        _set_ribbon(canvas, f"/lane/{name}", right_edge, left_edge, height, rgba)

    white, dark, width = Rgba(1.0, 1.0, 1.0, 1.0), Rgba(0.35, 0.35, 0.36, 1.0), scale * LINE_WIDTH
    half = 0.5 * width
    strip("surface", low, high, LANE, Rgba(0.66, 0.67, 0.69, 1.0))
    strip("right", low, low + width, LINE, white)
    strip("left", high - width, high, LINE, white)
    strip("reference", np.full_like(s, -half), np.full_like(s, half), LINE, dark)


def _set_ribbon(canvas: Canvas, path: str, right: Array, left: Array, height: float, rgba: Rgba) -> None:
    """A flat band between two edges [2, K] [m]."""
    count = right.shape[1]
    vertices = np.vstack([np.hstack([right, left]), np.full(2 * count, height)])
    here = np.arange(count - 1)
    faces = np.hstack([
        np.stack([here, here + 1, here + count]), np.stack([here + 1, here + 1 + count, here + count])
    ])  # fmt: skip
    canvas.mesh(path, vertices, faces.astype(np.int32), rgba)


def _draw_trace(canvas: Canvas, path: str, run: pd.DataFrame, height: float, paint: tuple[float, float, float]) -> None:
    """A band along the driven path, a point each half metre or so, broken where the position is NaN."""
    everywhere = run[["x", "y"]].to_numpy(dtype=float).T
    for number, (begin, end) in enumerate(spans(np.isfinite(everywhere[0]))):
        points = everywhere[:, begin:end]
        driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points)))])
        keep = np.unique(np.searchsorted(driven, np.append(np.arange(0.0, driven[-1], LINE_SPACING), driven[-1])))
        points = points[:, keep]
        if len(keep) < 2:
            continue
        along = np.gradient(points, axis=1)
        across = 0.5 * TRACE_WIDTH * np.stack([-along[1], along[0]]) / np.hypot(*along)
        _set_ribbon(canvas, f"{path}/{number}", points - across, points + across, height, Rgba(*paint, 1.0))


def _build_car(canvas: Canvas, path: str, shape: CarShape, rgb: tuple[float, float, float], opacity: float) -> None:
    paint, glass, rubber = Rgba(*rgb, opacity), Rgba(0.10, 0.11, 0.13, opacity), Rgba(0.08, 0.08, 0.08, opacity)
    _set_prism(canvas, f"{path}/body", shape.body(), shape.body(), SILL, WAIST, paint)
    roof = shape.cabin() * [0.72, 0.86] + [-0.12, 0.0]
    _set_prism(canvas, f"{path}/glass", shape.cabin(), roof, WAIST, ROOF - 0.04, glass)
    _set_prism(canvas, f"{path}/roof", roof, roof, ROOF - 0.04, ROOF, paint)
    across = RigidTransform(RollPitchYaw(0.5 * np.pi, 0.0, 0.0), np.zeros(3))
    for index, centre in enumerate(shape.wheel_centres()):
        canvas.place(f"{path}/pivot{index}", RigidTransform(np.array([*centre, shape.wheel_radius])))
        canvas.cylinder(f"{path}/pivot{index}/tyre", shape.wheel_radius, shape.wheel_width, rubber)
        canvas.place(f"{path}/pivot{index}/tyre", across)
        rim = Rgba(0.75, 0.76, 0.78, opacity)
        canvas.cylinder(f"{path}/pivot{index}/rim", 0.62 * shape.wheel_radius, shape.wheel_width + 0.02, rim)
        canvas.place(f"{path}/pivot{index}/rim", across)


def _set_prism(canvas: Canvas, path: str, bottom: Array, top: Array, low: float, high: float, rgba: Rgba) -> None:
    """A closed body between two convex outlines [K, 2] at two heights [m]."""
    count = len(bottom)
    vertices = np.hstack([np.vstack([bottom.T, np.full(count, low)]), np.vstack([top.T, np.full(count, high)])])
    here = np.arange(count)
    following = (here + 1) % count
    sides = [np.stack([here, following, following + count]), np.stack([here, following + count, here + count])]
    fan = np.stack([np.zeros(count - 2, dtype=int), here[1:-1], here[2:]])
    canvas.mesh(path, vertices, np.hstack([*sides, fan + count, fan[::-1]]).astype(np.int32), rgba)
