"""A reference's lookup table by path position and by time, compiled: it is asked at each plan."""

import math
from typing import NamedTuple

import numpy as np

from drift_drake.car.compilation import compiled
from drift_drake.common.arrays import Array

V, CURVATURE = 1, 6  # columns that the lookups themselves need


class Grid(NamedTuple):
    """Values on a uniform grid of path positions from 0 to `length`; linear in between.

    On a closed path the grid holds one lap and all lookups wrap; on an open one the end values hold beyond the ends.
    """

    table: Array  # [M, 9] of (r, v, beta, omega_r, delta, tau, curvature, e_min, e_max)
    time: Array  # [M] [s] at which a car on the reference passes the grid's points
    heading: Array  # [M] [rad] of the path, without jumps
    spacing: float  # [m]
    length: float  # [m]
    turning: float  # [rad] of the path in all
    closed: bool


@compiled
def wrapped(grid: Grid, s: float) -> tuple[float, float]:
    """(s within the grid, laps gone by); NaN where it is not finite."""
    if not math.isfinite(s):
        return math.nan, 0.0
    if not grid.closed:
        return min(max(s, 0.0), grid.length), 0.0
    laps = math.floor(s / grid.length)
    return s - laps * grid.length, float(laps)


@compiled
def _place(grid: Grid, within: float) -> tuple[int, float]:
    """(index of the grid's interval, share of it that lies behind)."""
    position = within / grid.spacing
    index = min(int(position), grid.time.size - 2) if position == position else 0  # no place has no row: NaN
    return index, position - index


@compiled
def rows_at(grid: Grid, s: Array) -> Array:
    """The table's rows [K, 9] at s [K]."""
    rows = np.empty((s.size, grid.table.shape[1]))
    for k in range(s.size):
        i, part = _place(grid, wrapped(grid, s[k])[0])
        for j in range(rows.shape[1]):
            rows[k, j] = (1.0 - part) * grid.table[i, j] + part * grid.table[i + 1, j]
    return rows


@compiled
def times_at(grid: Grid, s: Array) -> Array:
    """Time [K] at which a car on the reference is at s [K]; 0 at s = 0."""
    times = np.empty(s.size)
    for k in range(s.size):
        within, laps = wrapped(grid, s[k])
        i, part = _place(grid, within)
        beyond = 0.0 if grid.closed else s[k] - within
        speed = grid.table[0 if beyond < 0.0 else -1, V]
        times[k] = (1.0 - part) * grid.time[i] + part * grid.time[i + 1] + laps * grid.time[-1] + beyond / speed
    return times


@compiled
def positions_at(grid: Grid, times: Array) -> Array:
    """Path position [K] of a car on the reference at times [K]: ds/dt = v_ref(s), s = 0 at 0."""
    found, end = np.empty(times.size), grid.time[-1]
    for k in range(times.size):
        laps = math.floor(times[k] / end) if grid.closed and math.isfinite(times[k]) else 0
        t = times[k] - laps * end if grid.closed else min(max(times[k], 0.0), end)
        beyond = 0.0 if grid.closed else times[k] - t
        i = min(max(np.searchsorted(grid.time, t, side="right") - 1, 0), grid.time.size - 2)
        part = (t - grid.time[i]) / (grid.time[i + 1] - grid.time[i])
        speed = grid.table[0 if beyond < 0.0 else -1, V]
        found[k] = (i + part) * grid.spacing + laps * grid.length + beyond * speed
    return found


@compiled
def along(grid: Grid, s0: float, dt: float, count: int) -> tuple[Array, Array, Array, Array]:
    """(path positions [N+1], rows [N+1, 9], mean path curvature over each step [N], path heading [N+1]) of N = `count`
    steps from s0."""
    times = times_at(grid, np.array([s0]))[0] + dt * np.arange(count + 1)
    s = positions_at(grid, times)
    s[0] = s0
    rows, heading, curvature = rows_at(grid, s), np.empty(count + 1), np.empty(count)
    for k in range(count + 1):
        within, laps = wrapped(grid, s[k])
        i, part = _place(grid, within)
        heading[k] = (1.0 - part) * grid.heading[i] + part * grid.heading[i + 1] + laps * grid.turning
        if not grid.closed:
            heading[k] += (s[k] - within) * rows[k, CURVATURE]
    for k in range(count):
        curvature[k] = (heading[k + 1] - heading[k]) / (s[k + 1] - s[k])
    return s, rows, curvature, heading
