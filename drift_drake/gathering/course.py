"""Where a drive of information gathering goes: the lane's path and speed, and an OCP's data along it."""

from collections.abc import Iterable
from functools import cache

import numpy as np
import pandas as pd

from drift_drake.arrays import Array
from drift_drake.control.ocp import OcpData
from drift_drake.control.plan import DT
from drift_drake.gathering.config import GatheringConfig
from drift_drake.gathering.lane import problem_data
from drift_drake.reference.stadium import Stadium, stadium
from drift_drake.reference.trajectory import Reference, circle


def lane(config: GatheringConfig) -> Reference:
    """The lane, and the speed along it."""
    if config.lane == "track":
        return _track(config.track, config.v_end, config.half_width)
    return circle(config.v_start, config.v_end, config.steps * DT, config.curvature, config.half_width)


@cache
def _track(track: Stadium, fastest: float, half_width: float) -> Reference:
    return stadium(track, fastest, half_width)


def lane_for_pictures(config: GatheringConfig, tables: Iterable[pd.DataFrame]) -> Reference:
    """The lane, as long as the farthest of drives: one that is faster than the reference leaves its end behind."""
    if config.lane == "track":
        return lane(config)
    farthest = max(lane(config).distance, *(float(table["s"].max()) for table in tables))
    return circle(config.v_end, config.v_end, farthest / config.v_end, config.curvature, config.half_width)


def positions(config: GatheringConfig, states: Array, start: float = 0.0) -> Array:
    """Path positions [N+1] [m] at planned states (r, v, beta, omega_r, e, dphi, ...) [N+1, 6 or more].

    Args:
        start: of the first one [m].
    """
    path, e = lane(config).path, states[:, 4]
    forward = states[:, 1] * np.cos(states[:, 5])
    out = np.full(len(states), start)
    for k in range(len(states) - 1):
        bend = float(path.curvature(float(out[k] + 0.5 * DT * forward[k])))
        out[k + 1] = out[k] + 0.5 * DT * (forward[k] + forward[k + 1]) / (1.0 - bend * 0.5 * (e[k] + e[k + 1]))
    return out


def curvature_along(config: GatheringConfig, states: Array, start: float = 0.0) -> Array:
    """The lane's mean curvature [N] [1/m] over the steps between planned states; see `positions`."""
    if config.lane == "open":
        return np.full(len(states) - 1, config.curvature)
    return _mean_curvature(lane(config), positions(config, states, start))


def lane_data(config: GatheringConfig, lateral: Array | None = None, s: Array | None = None) -> OcpData:
    """The OCP's data along the lane, from its beginning.

    Args:
        lateral: a line e(t) [N+1] [m] beside the middle of an open lane to follow, see `problem_data`.
        s: path positions [N+1] [m] on a track where a plan is expected; without, those of the reference.
    """
    if config.lane == "open":
        return problem_data(config, lateral, config.curvature)
    course = lane(config)
    s = course.horizon(0.0, DT, config.steps).s if s is None else s
    states, edge = course.state(s), np.full(len(s), config.half_width - config.margin)
    return OcpData(states[0], np.zeros(2), states, _mean_curvature(course, s), -edge, edge)


def _mean_curvature(course: Reference, s: Array) -> Array:
    return np.asarray(np.diff(course.path.heading(s)) / np.diff(s), dtype=np.float64)
