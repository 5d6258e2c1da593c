"""Planar paths of continuous, piecewise-linear curvature (lines, arcs, clothoids), parameterised by arc length s."""

import math
from bisect import bisect_right
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from drift_drake.common.arrays import Array

TABLE_SPACING = 1.0  # [m] between tabulated poses
CLOSURE_TOLERANCE = 1e-6  # [m] and [rad]

# Four points are exact to 1e-14 m on the table's pieces up to a curvature of 0.2 1/m.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


class Path:
    """A path given by its curvature over arc length.

    An open path goes on with its end curvatures beyond [0, length]; on a closed one s wraps around, the heading going
    on without a jump. World frame: x, y [m], heading [rad] counter-clockwise from x. `e` is positive to the left.

    Attributes:
        length: [m] of the path, one lap if it is closed.
        closed: whether the end meets the start.
        turning: [rad] change of heading over the length.
    """

    def __init__(self, s: ArrayLike, curvature: ArrayLike, start: tuple[float, float, float] = (0.0, 0.0, 0.0),
                 closed: bool = False) -> None:  # fmt: skip
        """Builds the path.

        Args:
            s: nodes [K] [m], the first 0, ascending; curvature: [K] [1/m] there, linear in between.
            start: (x, y, heading) at s = 0.
            closed: whether the end meets the start.

        Raises:
            ValueError: the nodes are no path, or a path said to be closed is not.
        """
        nodes, values = np.array(s, dtype=float), np.array(curvature, dtype=float)
        if nodes.ndim != 1 or nodes.shape != values.shape or len(nodes) < 2:
            raise ValueError(f"s {nodes.shape} and curvature {values.shape} must be equally long lists of two or more")
        if not (np.isfinite(nodes).all() and np.isfinite(values).all()):
            raise ValueError("s and curvature hold NaN or infinity; give finite numbers")
        if nodes[0] != 0.0 or not (np.diff(nodes) > 0.0).all():
            raise ValueError("s must start at 0 and ascend")
        self.length = float(nodes[-1])
        self.closed = closed
        self._nodes, self._values = nodes, values
        self._slopes = np.diff(values) / np.diff(nodes)
        self._node_list, self._value_list, self._slope_list = nodes.tolist(), values.tolist(), self._slopes.tolist()
        self._tabulate(start)
        self.turning = float(self._table_heading[-1] - self._table_heading[0])
        if closed:
            self._check_closed()

    def _tabulate(self, start: tuple[float, float, float]) -> None:
        """Poses at the nodes and in between, each from the last by quadrature."""
        pieces = [
            np.linspace(low, high, math.ceil((high - low) / TABLE_SPACING), endpoint=False)
            for low, high in zip(self._node_list[:-1], self._node_list[1:], strict=True)
        ]
        table = np.concatenate([*pieces, [self.length]])
        steps = np.diff(table)
        curvature, slope = self._curvature_and_slope(table[:-1])
        turns = steps * (curvature + 0.5 * slope * steps)
        heading = start[2] + np.concatenate([[0.0], np.cumsum(turns)])
        dx, dy = _displacement(heading[:-1], curvature, slope, steps)
        self._table_s, self._table_heading = table, heading
        self._table_x = start[0] + np.concatenate([[0.0], np.cumsum(dx)])
        self._table_y = start[1] + np.concatenate([[0.0], np.cumsum(dy)])

    def _check_closed(self) -> None:
        gap = math.hypot(self._table_x[-1] - self._table_x[0], self._table_y[-1] - self._table_y[0])
        turn = abs(math.remainder(self.turning, 2.0 * math.pi))
        if gap > CLOSURE_TOLERANCE or turn > CLOSURE_TOLERANCE or self._values[0] != self._values[-1]:
            raise ValueError(
                f"the path is said to be closed, but its end misses its start by {gap:.3g} m and {turn:.3g} rad "
                f"(curvature {self._values[0]:.3g} against {self._values[-1]:.3g} 1/m)"
            )

    def _wrapped(self, s: Array) -> tuple[Array, Array]:
        """(s within the lap, laps gone by)."""
        if not self.closed:
            return s, np.zeros_like(s)
        laps = np.floor(s / self.length)
        return s - laps * self.length, laps

    def _curvature_and_slope(self, s: Array) -> tuple[Array, Array]:
        index = np.clip(np.searchsorted(self._nodes, s, side="right") - 1, 0, len(self._slopes) - 1)
        inside = (s >= 0.0) & (s <= self.length)
        slope = np.where(inside, self._slopes[index], 0.0)
        offset = np.clip(s, 0.0, self.length) - self._nodes[index]
        return self._values[index] + self._slopes[index] * offset, slope

    def curvature(self, s: Any) -> Any:
        """Curvature [1/m] at s [...] [m], positive to the left. A float gives a float, quickly."""
        if isinstance(s, float):
            if not math.isfinite(s):
                return math.nan
            if self.closed:
                s %= self.length
            if s <= 0.0:
                return self._value_list[0]
            if s >= self.length:
                return self._value_list[-1]
            index = bisect_right(self._node_list, s) - 1
            return self._value_list[index] + self._slope_list[index] * (s - self._node_list[index])
        return self._curvature_and_slope(self._wrapped(np.asarray(s, dtype=float))[0])[0]

    def heading(self, s: ArrayLike) -> Array:
        """Heading [rad] at s [...] [m], without jumps."""
        return self.pose(s)[2]

    def pose(self, s: ArrayLike) -> tuple[Array, Array, Array]:
        """(x [m], y [m], heading [rad]) at s [...] [m]; within 1e-9 m of the exact integral."""
        s, laps = self._wrapped(np.asarray(s, dtype=float))
        index = np.clip(np.searchsorted(self._table_s, s, side="right") - 1, 0, len(self._table_s) - 2)
        index = np.where(s >= self.length, len(self._table_s) - 1, index)
        offset = s - self._table_s[index]
        heading = self._table_heading[index]
        curvature, slope = self._curvature_and_slope(self._table_s[index])
        slope = np.where((s < 0.0) | (s >= self.length), 0.0, slope)
        dx, dy = _displacement(heading, curvature, slope, offset)
        x, y = self._table_x[index] + dx, self._table_y[index] + dy
        return x, y, heading + offset * (curvature + 0.5 * slope * offset) + laps * self.turning

    def to_world(self, s: ArrayLike, e: ArrayLike) -> tuple[Array, Array]:
        """World position (x, y) [m] of the points at s and lateral deviation e [m] (broadcast)."""
        x, y, heading = self.pose(s)
        e = np.asarray(e, dtype=float)
        return x - e * np.sin(heading), y + e * np.cos(heading)


def _displacement(heading: Array, curvature: Array, slope: Array, length: Array) -> tuple[Array, Array]:
    """(dx, dy) [m] along a piece of linear curvature; exact for arcs and lines of any length, Gauss for clothoids."""
    half_turn = 0.5 * curvature * length
    chord = length * np.sinc(half_turn / np.pi)
    arc_x, arc_y = chord * np.cos(heading + half_turn), chord * np.sin(heading + half_turn)
    along = 0.5 * np.asarray(length)[..., None] * (1.0 + _NODES)
    angle = np.asarray(heading)[..., None] + along * (
        np.asarray(curvature)[..., None] + 0.5 * np.asarray(slope)[..., None] * along
    )
    gauss_x = 0.5 * length * (np.cos(angle) @ _WEIGHTS)
    gauss_y = 0.5 * length * (np.sin(angle) @ _WEIGHTS)
    arc = slope == 0.0
    return np.where(arc, arc_x, gauss_x), np.where(arc, arc_y, gauss_y)
