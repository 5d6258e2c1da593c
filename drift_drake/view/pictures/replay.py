"""A run in three dimensions, as one HTML file that plays in any browser without a network."""

import logging
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
from markupsafe import escape
from pydrake.geometry import Cylinder, Meshcat, MeshcatAnimation, MeshcatParams, Rgba
from pydrake.math import RigidTransform

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.common.safe_files import write_text
from drift_drake.drive.reference.trajectory import Reference
from drift_drake.view.pages.policy import with_policy
from drift_drake.view.pages.templates import templates
from drift_drake.view.pictures.car_shape import CarShape
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
from drift_drake.view.style import DEGREES, KMH, colours_of

FRAMES_PER_SECOND = (10.0, 30.0)  # as many as keep a long run to
MOST_FRAMES = 3000.0
READ_OUTS = (  # column, name and unit on the panel, factor
    ("beta", "sideslip", "deg", DEGREES),
    ("v", "speed", "km/h", KMH),
    ("r", "yaw rate", "deg/s", DEGREES),
)
READ_STEP, MOST_READ = 0.02, 1500.0  # [s] between values at least, and how many of a long run
SCALED = '<meta name="viewport" content="width=device-width">'
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
    a panel names them, reads out speed, sideslip and yaw rate with a chart that follows, moves them apart, lets the
    camera follow them or see all of the ground, and plays at other speeds. A car stands where its pose is NaN. A
    model car's scene is magnified to a full-size one's.

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
    scene = Scene.of(runs, reference, parameters)
    if scene.scale != 1.0:
        note = f"{note} Drawn {1.0 / scene.scale:.0f} times as large.".strip()
    meshcat = _quiet_meshcat()
    home = _set_stage(meshcat, scene)
    longest = max(float(np.ptp(run["t"])) for run in runs.values())
    rate = float(np.clip(MOST_FRAMES / max(longest, 1.0), *FRAMES_PER_SECOND))
    meshcat.StartRecording(rate, set_visualizations_while_recording=False)
    scene.draw(_MeshcatCanvas(meshcat))
    for index, run in enumerate(scene.runs.values()):
        _record(meshcat, car_path(index), run, scene.shape, rate)
    meshcat.StopRecording()
    recording = meshcat.get_mutable_recording()
    recording.set_autoplay(True)
    recording.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    meshcat.PublishRecording()
    path = Path(path)
    cars = [{"name": name, "colour": colour} for name, colour in zip(runs, colours_of(runs), strict=True)]
    panel = (
        templates(PANEL.parent)
        .get_template(PANEL.name)
        .render(cars=cars, home=home, title=title, note=note, camera=camera, signals=read_outs(runs))
    )
    write_text(path, with_policy(_page(meshcat.StaticHtml(), title or "drift_drake: replay", panel)))
    return path


def _page(scene: str, title: str, panel: str) -> str:
    """Meshcat's page with a name, a language, a phone's width and the panel."""
    named = re.sub(r"<title>.*?</title>", lambda _: f"<title>{escape(title)}</title>", scene, count=1)
    scaled = named.replace("<html>", '<html lang="en">', 1).replace("<head>", f"<head>\n{SCALED}", 1)
    page, end, rest = scaled.rpartition("</body>")
    return page + panel + end + rest


def read_outs(runs: Mapping[str, pd.DataFrame]) -> list[dict[str, object]]:
    """What the panel reads out of each car in a driver's units: sideslip, speed and yaw rate, where all runs have them.

    Each has values by car every `step` seconds from the start; None where there is no reading.
    """
    known = [signal for signal in READ_OUTS if all(signal[0] in run for run in runs.values())]
    longest = max(float(np.ptp(run["t"])) for run in runs.values())
    step = max(READ_STEP, longest / MOST_READ)
    found = []
    for column, name, unit, factor in known:
        cars = []
        for run in runs.values():
            t = run["t"].to_numpy(dtype=float)
            at = np.searchsorted(t - t[0], np.arange(0.0, float(np.ptp(t)) + 0.5 * step, step)).clip(0, len(t) - 1)
            values = factor * run[column].to_numpy(dtype=float)[at]
            cars.append([round(float(value), 2) if np.isfinite(value) else None for value in values])
        found.append({"name": name, "unit": unit, "step": step, "cars": cars})
    return found


def _quiet_meshcat() -> Meshcat:
    """A Meshcat that this machine alone could reach, and that does not say where it listens: its page is wanted."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        return Meshcat(MeshcatParams(host="localhost"))
    finally:
        logger.setLevel(level)


class _MeshcatCanvas:
    """A `Canvas` that a browser shows."""

    def __init__(self, meshcat: Meshcat) -> None:
        self._meshcat = meshcat

    def mesh(self, path: str, vertices: Array, faces: Faces, rgba: Rgba) -> None:
        self._meshcat.SetTriangleMesh(path, vertices, faces, rgba)

    def cylinder(self, path: str, radius: float, length: float, rgba: Rgba) -> None:
        self._meshcat.SetObject(path, Cylinder(radius, length), rgba)

    def lines(self, path: str, starts: Array, ends: Array, rgba: Rgba) -> None:
        self._meshcat.SetLineSegments(path, starts, ends, 1.0, rgba)

    def place(self, path: str, pose: RigidTransform) -> None:
        self._meshcat.SetTransform(path, pose)


def _set_stage(meshcat: Meshcat, scene: Scene) -> list[list[float]]:
    """Daylight, and a camera that sees all of the ground.

    Returns:
        The camera's place and what it looks at in the page's own axes (x, up, south) [m].
    """
    for thing in ("/Grid", "/Axes", "/Lights/PointLightNegativeX", "/Lights/PointLightPositiveX"):
        meshcat.SetProperty(thing, "visible", False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 1.7)
    meshcat.SetProperty("/Lights/FillLight/<object>", "intensity", 1.6)
    for edge in ("top_color", "bottom_color"):
        meshcat.SetProperty("/Background", edge, list(BACKGROUND))
    meshcat.SetCamera(Meshcat.PerspectiveCamera(fov=FIELD_OF_VIEW, aspect=1.5, near=0.5, far=2000.0, zoom=1.0))
    views = scene.overview()
    meshcat.SetCameraPose(*views)
    return [[float(x), float(z), float(-y)] for x, y, z in views]


def _record(meshcat: Meshcat, path: str, run: pd.DataFrame, shape: CarShape, rate: float) -> None:
    """Poses and steering at `rate` frames a second."""
    frames = np.arange(0.0, float(np.ptp(run["t"])) + 0.5 / rate, 1.0 / rate)
    for time, x, y, psi, delta in zip(frames, *poses(run, frames), strict=True):
        meshcat.SetTransform(path, car_pose(x, y, psi), time)
        for wheel, pose in front_wheels(shape, delta).items():
            meshcat.SetTransform(f"{path}/{wheel}", pose, time)
