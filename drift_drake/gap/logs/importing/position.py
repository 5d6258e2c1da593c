"""Positions of a satellite receiver as x, y on a plane, and the motion along the path that they and the speed describe.

The plane touches the ellipsoid at the first reading (transverse Mercator, exact to a millimetre within some
kilometres). It is as the fixed frame of `ned` recorders becomes: x to the north, y to the west. Course, the direction
of the velocity, is positive to the left from north.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.common.errors import MissingExtraError
from drift_drake.gap.logs.importing.evidence import Trace, clockwise, derivative, product, sense, velocity
from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError
from drift_drake.gap.logs.importing.smoothing import smooth

TURNED = 0.05  # [rad] in a window, of course or heading, from which the two are compared
WINDOW = 1.0  # [s]
ALIKE = 0.9  # correlation of the turns of course and yaw rate from which their ratio is believed
CLOSE = 1.5  # times: the sideslip's changes explain no more
SLOWEST = 0.5  # [m/s] below which positions do not say where a car is heading


def projected(path: Path, latitude: Array, longitude: Array) -> tuple[Array, Array]:
    """Positions x (north), y (west) [n] [m] of latitudes and longitudes [n] [rad]; NaN where there is no fix.

    Raises:
        InvalidRecordingError: no such angles, none at all, or `pyproj` is not installed.
    """
    try:
        from pyproj import Transformer
    except ImportError:
        raise InvalidRecordingError(f"{path}: {MissingExtraError('a GPS position', 'pyproj', 'gps')}") from None
    none = (latitude == 0.0) & (longitude == 0.0)
    seen = np.isfinite(latitude) & np.isfinite(longitude) & ~none
    if not seen.any():
        raise InvalidRecordingError(f"{path}: latitude and longitude hold no position; take them out of the mapping")
    for name, values, limit in (("latitude", latitude, 90.0), ("longitude", longitude, 360.0)):
        largest = math.degrees(float(np.max(np.abs(values[seen]))))
        if largest > limit:
            raise InvalidRecordingError(
                f"{path}: {name} is up to {largest:.6g} deg, and no {name} is; minutes of arc need 'scale: 0.0166667', "
                "whole numbers of 1e-7 deg 'scale: 1.0e-7'"
            )
    lat, lon = np.degrees(latitude[seen]), np.degrees(longitude[seen])
    plane = Transformer.from_crs(
        "EPSG:4326", f"+proj=tmerc +lat_0={lat[0]:.9f} +lon_0={lon[0]:.9f} +ellps=WGS84 +units=m", always_xy=True
    )
    east, north = plane.transform(lon, lat)
    x, y = np.full(len(seen), np.nan), np.full(len(seen), np.nan)
    x[seen], y[seen] = north, -np.asarray(east)
    return x, y


def path_motion(
    t: Array, x: Array, y: Array, v: Array | None, course: Array | None, highest: float = math.inf
) -> dict[str, Array]:
    """Motion along the path at times t [n] [s]: `v` [m/s], `course` [rad], `course_rate` [rad/s], and the accelerations
    along (`path_ax`) and across it, to the left (`path_ay`) [m/s^2].

    Args:
        x, y: positions [n] [m] (NaN: none); v: measured speed, course: measured direction of the velocity (None: of
            the positions); highest: frequency [Hz] of motion, what is faster is taken for noise.

    Raises:
        ValueError: too few readings.
    """
    position = smooth(t, np.stack([x, y], axis=1), highest)
    (x_dot, y_dot), (x_ddot, y_ddot) = position.rate.T, position.acceleration.T
    speed = np.hypot(x_dot, y_dot)
    slow = np.maximum(speed, SLOWEST)
    if v is None:
        v, v_dot = speed, (x_dot * x_ddot + y_dot * y_ddot) / slow
    else:
        smoothed = smooth(t, v, highest)
        v, v_dot = smoothed.value[:, 0], smoothed.rate[:, 0]
    if course is None:
        course, rate = np.unwrap(np.arctan2(y_dot, x_dot)), (x_dot * y_ddot - y_dot * x_ddot) / slow**2
    else:
        turning = smooth(t, course, highest)
        course, rate = turning.value[:, 0], turning.rate[:, 0]
    rate = np.where(v < SLOWEST, 0.0, rate)
    return {"v": v, "course": course, "course_rate": rate, "path_ax": v_dot, "path_ay": v * rate}


def against_position(
    runs: Sequence[Mapping[str, Array]], period: float, measured: Collection[str]
) -> tuple[Sequence[Mapping[str, Array]], list[str]]:
    """The runs with r turned, and what agrees with it, where r turns against the positions; and a sentence on it.

    Args:
        runs: columns of the log [n], x to the north and y to the west; period: time between rows [s]; measured: names
            of columns that are no others' result.
    """
    t: Array = period * np.arange(float(sum(len(run["r"]) for run in runs)))

    def whole(name: str) -> Trace:
        return Trace(t, np.concatenate([run[name] for run in runs]), None)

    r = whole("r")
    turning = clockwise(*velocity(whole("x"), Trace(t, -whole("y").values, None), degrees=False))
    if sense(r, turning) != 1:
        return runs, []
    across = product(r, whole("v"))

    def agrees(name: str) -> bool:
        if name == "psi":
            return sense(derivative(whole(name), turns=True), turning) == 1
        return name not in ("ay", "delta_cmd") or sense(whole(name), across) == 1

    there = [name for name in ("r", "ay", "delta_cmd", "psi", "beta", "vy") if all(name in run for run in runs)]
    mirrored = [name for name in there if name in measured and agrees(name)]
    wrong = {"beta"} - set(measured) if "psi" in mirrored else set()
    return [
        {name: -values if name in mirrored else values for name, values in run.items() if name not in wrong}
        for run in runs
    ], [f"r turns against the position: {', '.join(mirrored)} are mirrored; change their frame (ned, or iso8855)."]


def course_doubts(columns: Mapping[str, Array], period: float) -> list[str]:
    """Sentences if the yaw rate turns otherwise than the measured course; none where one of them is missing.

    Args:
        columns: of the log [n]; period: time between rows [s].
    """
    step = round(WINDOW / period)
    if "course" not in columns or len(columns["r"]) < 3 * step:
        return []
    heading = np.cumsum(columns["r"]) * period
    course, turned = (values[step:] - values[:-step] for values in (columns["course"], heading))
    seen = (np.abs(course) > TURNED) | (np.abs(turned) > TURNED)
    if np.count_nonzero(seen) < step or not np.ptp(turned[seen]) or not np.ptp(course[seen]):
        return []
    course, turned = course[seen], turned[seen]
    if abs(course @ turned) < ALIKE * np.linalg.norm(course) * np.linalg.norm(turned):
        return []
    ratio = float(turned @ course / (course @ course))
    if ratio < 0.0:
        return ["r turns against the course: one of the two is positive to the right (frame: ned, or sign: -1)."]
    return [f"r is {ratio:.3g} times the course's rate: check its unit."] if not 1.0 / CLOSE < ratio < CLOSE else []
