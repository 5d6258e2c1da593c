"""A run in three dimensions, as one HTML file that plays in any browser without a network."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import jinja2
import numpy as np
import pandas as pd
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from pydrake.geometry import Cylinder, Meshcat, MeshcatAnimation, Rgba
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from drift_drake.pictures.car_shape import CarShape, model_scale
from drift_drake.pictures.style import RUNS, check_columns
from drift_drake.reference.trajectory import Reference
from drift_drake.vehicle.parameters import VehicleParameters

Array = NDArray[np.float64]

COLUMNS = ("t", "x", "y", "psi", "delta")
FRAMES_PER_SECOND = (10.0, 30.0)  # as many as keep a long run to
MOST_FRAMES = 3000.0
LINE_SPACING = 0.5  # [m] between points of lines on the ground

SILL, WAIST, ROOF = 0.18, 0.78, 1.28  # [m] heights of the car's body
GHOST_OPACITY = 0.45

# [m] heights that keep what lies on the ground from flickering through each other.
GROUND, LANE, LINE, TRACE = -0.05, 0.0, 0.04, 0.08
LINE_WIDTH, TRACE_WIDTH = 0.18, 0.24  # [m]
GRID, GRID_MARGIN = 10.0, 40.0  # [m] between the ground's lines, and beyond where runs go
FIELD_OF_VIEW = 45.0  # [deg], vertical
PANEL = Path(__file__).parent / "replay_panel.html"


def replay(
    runs: Mapping[str, pd.DataFrame],
    path: str | Path,
    reference: Reference | None = None,
    parameters: VehicleParameters | None = None,
    title: str = "",
    note: str = "",
    camera: Literal["follow", "overview"] = "overview",
) -> Path:
    """Writes a Meshcat replay of runs, all starting together; the first is solid, the others are ghosts.

    The cars are `/runs/0`, `/runs/1`, ... in the scene tree of the controls, in the colours of the overhead picture;
    a panel names them, moves them apart, lets the camera follow them or see all of the ground, and scrubs through
    time. A car stands where its pose is NaN. A model car's scene is magnified to a full-size one's.

    Args:
        runs: tables with t, x, y, psi, delta (SI) by name.
        path: of the HTML file; its folder is made.
        reference: its path and lane are drawn on the ground.
        parameters: the car whose shape is drawn; the default car without.
        title, note: lines of the panel.
        camera: where it is at first.

    Returns:
        The file's path.

    Raises:
        ValueError: a run lacks a column or has no row.
    """
    if not runs:
        raise ValueError("no runs to replay; give at least one")
    for name, run in runs.items():
        check_columns(run, COLUMNS, name)
    parameters = parameters or VehicleParameters()
    scale = model_scale(parameters)
    runs = {name: run.assign(x=run["x"] / scale, y=run["y"] / scale) for name, run in runs.items()}
    if scale != 1.0:
        note = f"{note} Drawn {1.0 / scale:.0f} times as large.".strip()
    meshcat = Meshcat()
    low, high = _extent(runs, reference, scale)
    home = _set_scene(meshcat, low, high)
    if reference is not None:
        _draw_reference(meshcat, reference, scale)
    shape = CarShape.of(parameters).scaled(1.0 / scale)
    longest = max(float(np.ptp(run["t"])) for run in runs.values())
    rate = float(np.clip(MOST_FRAMES / max(longest, 1.0), *FRAMES_PER_SECOND))
    meshcat.StartRecording(rate, set_visualizations_while_recording=False)
    for index, run in enumerate(runs.values()):
        colour = to_rgb(_colour(index))
        _draw_trace(meshcat, f"/traces/{index}", run, TRACE + 0.02 * index, colour)
        _build_car(meshcat, f"/runs/{index}/car", shape, colour, 1.0 if index == 0 else GHOST_OPACITY)
        _record(meshcat, f"/runs/{index}/car", run, shape, rate)
    meshcat.StopRecording()
    recording = meshcat.get_mutable_recording()
    recording.set_autoplay(True)
    recording.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    meshcat.PublishRecording()
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    cars = [{"name": name, "colour": _colour(index)} for index, name in enumerate(runs)]
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    panel = environment.from_string(PANEL.read_text()).render(
        cars=cars, home=home, title=title, note=note, camera=camera
    )
    page, end, rest = meshcat.StaticHtml().rpartition("</body>")
    path.write_text(page + panel + end + rest)
    return path


def _colour(index: int) -> str:
    return RUNS[index % len(RUNS)]


def _extent(runs: Mapping[str, pd.DataFrame], reference: Reference | None, scale: float) -> tuple[Array, Array]:
    """Corners [2] [m] of the ground that matters; the reference is yet to be magnified by 1 / scale."""
    points = [run[["x", "y"]].to_numpy(dtype=float) for run in runs.values()]
    if reference is not None:
        points.append(np.stack(reference.path.pose(_line_positions(reference))[:2], axis=-1) / scale)
    everywhere = np.concatenate(points)
    return np.nanmin(everywhere, axis=0), np.nanmax(everywhere, axis=0)


def _set_scene(meshcat: Meshcat, low: Array, high: Array) -> list[list[float]]:
    """Daylight, a plain ground, and a camera that sees all of it from the south and above.

    Returns:
        The camera's place and what it looks at in the page's own axes (x, up, south) [m].
    """
    for thing in ("/Grid", "/Axes", "/Lights/PointLightNegativeX", "/Lights/PointLightPositiveX"):
        meshcat.SetProperty(thing, "visible", False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 1.7)
    meshcat.SetProperty("/Lights/FillLight/<object>", "intensity", 1.6)
    for edge in ("top_color", "bottom_color"):
        meshcat.SetProperty("/Background", edge, [0.93, 0.94, 0.95])
    centre, size = 0.5 * (low + high), high - low
    reach = 0.5 * size + 400.0
    corners = np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]]) * reach[:, None] + centre[:, None]
    vertices = np.vstack([corners, np.full(4, GROUND)])
    meshcat.SetTriangleMesh("/ground", vertices, np.array([[0, 0], [1, 2], [2, 3]]), Rgba(0.93, 0.94, 0.92, 1.0))
    _draw_grid(meshcat, low - GRID_MARGIN, high + GRID_MARGIN)
    # Far enough back for the width on a wide screen and for the height.
    half = np.tan(np.deg2rad(0.5 * FIELD_OF_VIEW))
    distance = max(0.5 * size[0] / (1.3 * half), 0.5 * size[1] / half) + 12.0
    meshcat.SetCamera(Meshcat.PerspectiveCamera(fov=FIELD_OF_VIEW, aspect=1.5, near=0.5, far=2000.0, zoom=1.0))
    views = np.array([[centre[0], centre[1] - 0.6 * distance, 0.8 * distance], [*centre, 0.0]])
    meshcat.SetCameraPose(*views)
    return [[float(x), float(z), float(-y)] for x, y, z in views]


def _draw_grid(meshcat: Meshcat, low: Array, high: Array) -> None:
    """Lines on the ground, against which motion is seen."""
    x, y = (np.arange(np.floor(a / GRID), np.ceil(b / GRID) + 1.0) * GRID for a, b in zip(low, high, strict=True))
    along_y = [[[v, y[0]], [v, y[-1]]] for v in x]
    along_x = [[[x[0], v], [x[-1], v]] for v in y]
    ends = np.array(along_y + along_x)  # [lines, 2, 2]
    ends = np.concatenate([ends, np.full((*ends.shape[:2], 1), 0.5 * (GROUND + LANE))], axis=-1)
    meshcat.SetLineSegments("/ground_lines", ends[:, 0].T, ends[:, 1].T, 1.0, Rgba(0.92, 0.92, 0.92, 1.0))


def _line_positions(reference: Reference) -> Array:
    length = min(reference.distance, reference.path.length)
    return np.linspace(0.0, length, int(np.ceil(length / LINE_SPACING)) + 1)


def _draw_reference(meshcat: Meshcat, reference: Reference, scale: float) -> None:
    s = _line_positions(reference)
    low, high = reference.lane(s)

    def strip(name: str, right: Array, left: Array, height: float, rgba: Rgba) -> None:
        right_edge, left_edge = (np.stack(reference.path.to_world(s, e)) / scale for e in (right, left))
        _set_ribbon(meshcat, f"/lane/{name}", right_edge, left_edge, height, rgba)

    white, dark, width = Rgba(1.0, 1.0, 1.0, 1.0), Rgba(0.35, 0.35, 0.36, 1.0), scale * LINE_WIDTH
    half = 0.5 * width
    strip("surface", low, high, LANE, Rgba(0.66, 0.67, 0.69, 1.0))
    strip("right", low, low + width, LINE, white)
    strip("left", high - width, high, LINE, white)
    strip("reference", np.full_like(s, -half), np.full_like(s, half), LINE, dark)


def _set_ribbon(meshcat: Meshcat, path: str, right: Array, left: Array, height: float, rgba: Rgba) -> None:
    """A flat band between two edges [2, K] [m]."""
    count = right.shape[1]
    vertices = np.vstack([np.hstack([right, left]), np.full(2 * count, height)])
    here = np.arange(count - 1)
    faces = np.hstack([
        np.stack([here, here + 1, here + count]), np.stack([here + 1, here + 1 + count, here + count])
    ])  # fmt: skip
    meshcat.SetTriangleMesh(path, vertices, faces.astype(np.int32), rgba)


def _draw_trace(meshcat: Meshcat, path: str, run: pd.DataFrame, height: float,
                colour: tuple[float, float, float]) -> None:  # fmt: skip
    """A band along the driven path, a point each half metre or so, broken where the position is NaN."""
    everywhere = run[["x", "y"]].to_numpy(dtype=float).T
    for number, piece in enumerate(_pieces(np.isfinite(everywhere[0]))):
        points = everywhere[:, piece]
        driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points)))])
        keep = np.unique(np.searchsorted(driven, np.append(np.arange(0.0, driven[-1], LINE_SPACING), driven[-1])))
        points = points[:, keep]
        if len(keep) < 2:
            continue
        along = np.gradient(points, axis=1)
        across = 0.5 * TRACE_WIDTH * np.stack([-along[1], along[0]]) / np.hypot(*along)
        _set_ribbon(meshcat, f"{path}/{number}", points - across, points + across, height, Rgba(*colour, 1.0))


def _pieces(valid: NDArray[np.bool_]) -> list[slice]:
    """The stretches of rows that are valid."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], valid, [False]]).astype(int)))
    return [slice(int(begin), int(end)) for begin, end in zip(edges[::2], edges[1::2], strict=True)]


def _build_car(
    meshcat: Meshcat, path: str, shape: CarShape, colour: tuple[float, float, float], opacity: float
) -> None:
    paint, glass, rubber = Rgba(*colour, opacity), Rgba(0.10, 0.11, 0.13, opacity), Rgba(0.08, 0.08, 0.08, opacity)
    _set_prism(meshcat, f"{path}/body", shape.body(), shape.body(), SILL, WAIST, paint)
    roof = shape.cabin() * [0.72, 0.86] + [-0.12, 0.0]
    _set_prism(meshcat, f"{path}/glass", shape.cabin(), roof, WAIST, ROOF - 0.04, glass)
    _set_prism(meshcat, f"{path}/roof", roof, roof, ROOF - 0.04, ROOF, paint)
    across = RigidTransform(RollPitchYaw(0.5 * np.pi, 0.0, 0.0), np.zeros(3))
    for index, centre in enumerate(shape.wheel_centres()):
        meshcat.SetTransform(f"{path}/pivot{index}", RigidTransform(np.array([*centre, shape.wheel_radius])))
        meshcat.SetObject(f"{path}/pivot{index}/tyre", Cylinder(shape.wheel_radius, shape.wheel_width), rubber)
        meshcat.SetTransform(f"{path}/pivot{index}/tyre", across)
        spoke = Cylinder(0.62 * shape.wheel_radius, shape.wheel_width + 0.02)
        meshcat.SetObject(f"{path}/pivot{index}/rim", spoke, Rgba(0.75, 0.76, 0.78, opacity))
        meshcat.SetTransform(f"{path}/pivot{index}/rim", across)


def _set_prism(meshcat: Meshcat, path: str, bottom: Array, top: Array, low: float, high: float, rgba: Rgba) -> None:
    """A closed body between two convex outlines [K, 2] at two heights [m]."""
    count = len(bottom)
    vertices = np.hstack([np.vstack([bottom.T, np.full(count, low)]), np.vstack([top.T, np.full(count, high)])])
    here = np.arange(count)
    following = (here + 1) % count
    sides = [np.stack([here, following, following + count]), np.stack([here, following + count, here + count])]
    fan = np.stack([np.zeros(count - 2, dtype=int), here[1:-1], here[2:]])
    meshcat.SetTriangleMesh(path, vertices, np.hstack([*sides, fan + count, fan[::-1]]).astype(np.int32), rgba)


def _record(meshcat: Meshcat, path: str, run: pd.DataFrame, shape: CarShape, rate: float) -> None:
    """Poses and steering at `rate` frames a second."""
    run = run.ffill().bfill()
    t = run["t"].to_numpy(dtype=float) - float(run["t"].iloc[0])
    frames = np.arange(0.0, t[-1] + 0.5 / rate, 1.0 / rate)
    x, y, delta = (np.interp(frames, t, run[name].to_numpy(dtype=float)) for name in ("x", "y", "delta"))
    psi = np.interp(frames, t, np.unwrap(run["psi"].to_numpy(dtype=float)))
    centres = shape.wheel_centres()
    for frame, time in enumerate(frames):
        pose = RigidTransform(RotationMatrix.MakeZRotation(psi[frame]), np.array([x[frame], y[frame], 0.0]))
        meshcat.SetTransform(path, pose, time)
        for index in (0, 1):
            steered = RigidTransform(
                RotationMatrix.MakeZRotation(delta[frame]), np.array([*centres[index], shape.wheel_radius])
            )
            meshcat.SetTransform(f"{path}/pivot{index}", steered, time)
