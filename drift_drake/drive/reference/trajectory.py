"""What to drive: a path, and the states and inputs wanted along it."""

import dataclasses
import math
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.reference.chain import (
    GRID_SPACING,
    Chain,
    Leg,
    NoTransitionError,
    Transition,
    chain,
    other_side,
    plan_transition,
    steady_straight,
)
from drift_drake.drive.reference.equilibrium import NoEquilibriumError, drift_equilibrium
from drift_drake.drive.reference.figure_legs import figure_8_legs
from drift_drake.drive.reference.grid import Grid, along, positions_at, rows_at, times_at
from drift_drake.drive.reference.path import Path
from drift_drake.drive.reference.remedies import instead
from drift_drake.drive.reference.similarity import similarity

# Of the default car; those of others go with their size (`similarity`).
RADIUS, TRANSITION, HALF_WIDTH = 18.0, 20.0, 3.0  # [m]
INITIATION, ENTRY_SPEED = 30.0, 8.0  # [m], [m/s] of loops
ENTRY_LENGTH = 10.0  # [m] of steady straight before and after the loops' acceleration
ACCELERATION_LENGTH = 50.0  # [m]

# The columns of the lookup table; the first four are states.
_COLUMNS = ("r", "v", "beta", "omega_r", "delta", "tau", "curvature", "e_min", "e_max")


class Horizon(NamedTuple):
    """A reference sampled in time for a planner: N steps, N + 1 points."""

    s: Array
    """Path position [N + 1] [m]."""
    x_ref: Array
    """States (r, v, beta, omega_r, e, dphi) [N + 1, 6], e = dphi = 0."""
    u_ref: Array
    """Inputs (delta, tau) [N + 1, 2]."""
    curvature: Array
    """Mean path curvature over each step [N] [1/m]."""
    e_min: Array
    """Right lane bound [N + 1] [m], negative."""
    e_max: Array
    """Left lane bound [N + 1] [m]."""
    heading: Array
    """Mean path heading over each step [N] [rad], laps and turns counted."""


@dataclasses.dataclass(frozen=True, repr=False)
class Reference:
    """States and inputs wanted along a path, on a grid of path positions; linear in between.

    On a closed path the grid holds one lap and all lookups wrap; on an open one the end values hold beyond the ends.

    Attributes:
        path: the path, whose length is the grid's end.
        s: grid [M] in m, uniform, from 0 to the path's length.
        v, beta, r, omega_r: states wanted [M]; delta, tau: inputs that go with them [M].
        curvature: of the path [M] in 1/m.
        e_min, e_max: lane bounds [M] in m, e_min < 0 < e_max.
        in_transition: whether the car is between two steady drifts [M].
        distance: [m] to drive in all, several laps of a closed path perhaps.

    Raises:
        ValueError: a grid that is not uniform, a number that is not finite, a speed that is not positive.

    Examples:
        >>> reference.state(0.0).round(1).tolist()
        [0.0, 7.5, 0.0, 7.5, 0.0, 0.0]
    """

    path: Path
    s: Array
    v: Array
    beta: Array
    r: Array
    omega_r: Array
    curvature: Array
    delta: Array
    tau: Array
    e_min: Array
    e_max: Array
    in_transition: NDArray[np.bool_]
    distance: float

    def __post_init__(self) -> None:
        for name in ("s", *_COLUMNS):
            values = getattr(self, name)
            if values.shape != self.s.shape or not np.isfinite(values).all():
                raise ValueError(f"the reference's {name} must be {self.s.shape[0]} finite numbers, one a grid point")
        if self.s[0] != 0.0 or not np.allclose(np.diff(self.s), self._spacing) or self.s[-1] != self.path.length:
            raise ValueError("the reference's grid must be uniform from 0 to the path's length")
        if not (self.v > 0.0).all():
            raise ValueError("the reference's speed must be positive throughout")
        if not ((self.e_min < 0.0) & (self.e_max > 0.0)).all():
            raise ValueError("the path must lie within its lane: e_min < 0 < e_max")

    @property
    def _spacing(self) -> float:
        return float(self.s[-1] / (len(self.s) - 1))

    @cached_property
    def _grid(self) -> Grid:
        mean_pace = 0.5 * (1.0 / self.v[1:] + 1.0 / self.v[:-1])
        time = np.concatenate([[0.0], np.cumsum(self._spacing * mean_pace)])
        s = np.minimum(self.s, self.path.length - 1e-12) if self.path.closed else self.s
        table = np.ascontiguousarray(np.column_stack([getattr(self, name) for name in _COLUMNS]))
        return Grid(table, time, self.path.heading(s), self._spacing, self.path.length, self.path.turning,
                    self.path.closed)  # fmt: skip

    @cached_property
    def duration(self) -> float:
        """Time [s] in which a car on the reference drives the distance."""
        return float(self.time(self.distance))

    def _lookup(self, s: ArrayLike) -> Array:
        s = np.asarray(s, dtype=float)
        return rows_at(self._grid, s.ravel()).reshape(*s.shape, len(_COLUMNS))

    def time(self, s: ArrayLike) -> Array:
        """Time [...] in s at which a car on the reference is at s [...] in m; 0 at s = 0."""
        s = np.asarray(s, dtype=float)
        return times_at(self._grid, s.ravel()).reshape(s.shape)

    def position(self, time: ArrayLike) -> Array:
        """Path position [...] in m of a car on the reference at a time [...] in s: ds/dt = v_ref(s), s = 0 at 0."""
        time = np.asarray(time, dtype=float)
        return positions_at(self._grid, time.ravel()).reshape(time.shape)

    def state(self, s: ArrayLike) -> Array:
        """States (r, v, beta, omega_r, e, dphi) [..., 6] wanted at s [...] in m; e = dphi = 0."""
        return _state(self._lookup(s))

    def input(self, s: ArrayLike) -> Array:
        """Inputs (delta, tau) [..., 2] that go with the states at s [...] in m."""
        return self._lookup(s)[..., 4:6]

    def lane(self, s: ArrayLike) -> tuple[Array, Array]:
        """Lane bounds (e_min, e_max) [...] in m at s [...] in m."""
        row = self._lookup(s)
        return row[..., 7], row[..., 8]

    def transition(self, s: ArrayLike) -> NDArray[np.bool_]:
        """Whether s [...] in m lies in a transition."""
        s = np.asarray(s, dtype=float)
        s = np.mod(s, self.path.length) if self.path.closed else np.clip(s, 0.0, self.path.length)
        return self.in_transition[np.rint(np.nan_to_num(s) / self._spacing).astype(np.intp)]

    def horizon(self, s0: float, dt: float, count: int) -> Horizon:
        """The reference over the next `count` steps of `dt` [s], from path position s0 [m] on."""
        s, row, curvature, heading = along(self._grid, float(s0), dt, count)
        return Horizon(s, _state(row), row[:, 4:6], curvature, row[:, 7], row[:, 8], 0.5 * (heading[1:] + heading[:-1]))


def _state(row: Array) -> Array:
    state = np.zeros((*row.shape[:-1], 6))
    state[..., :4] = row[..., :4]
    return state


def straight_line(v_start: float, v_end: float, duration: float, half_width: float = 5.0) -> Reference:
    """A straight line, gripping, with a speed linear in time (the paper's section IV-A: 7.5 to 20 m/s in 4.5 s).

    Args:
        v_start, v_end: speeds [m/s] at the start and at `duration` [s]; the rim speed equals the speed.
        half_width: [m] of the lane to either side.

    Raises:
        ValueError: a speed or the duration is not positive.

    Examples:
        >>> straight_line(7.5, 20.0, duration=4.5).path.length  # [m]
        61.875
    """
    if not (v_start > 0.0 and v_end > 0.0 and duration > 0.0):
        raise ValueError(f"speeds ({v_start:g}, {v_end:g}) m/s and duration {duration:g} s must be positive")
    length = 0.5 * (v_start + v_end) * duration
    path = Path([0.0, length], [0.0, 0.0])
    s = np.linspace(0.0, length, math.ceil(length / GRID_SPACING) + 1)
    v = np.sqrt(v_start**2 + (v_end**2 - v_start**2) * s / length)
    zero, lane = np.zeros_like(s), np.full_like(s, half_width)
    return Reference(
        path=path, s=s, v=v, beta=zero, r=zero, omega_r=v, curvature=zero, delta=zero, tau=zero, e_min=-lane,
        e_max=lane, in_transition=np.zeros(len(s), dtype=bool), distance=length)  # fmt: skip


def figure_8(parameters: VehicleParameters, radius: float | None = None, sideslip: float = 0.6,
             transition: float | None = None, half_width: float | None = None,
             laps: float = 1.5) -> Reference:  # fmt: skip
    """A figure-8: steady drifts round two circles in opposite directions, joined by feasible transitions.

    The equilibria are those of Goh and Gerdes 2016. In between, path and motion come from `plan_transition`: the
    nominal car can follow the reference exactly, with the curvature going from one circle's to the other's mostly in
    the first half and the yaw rate swinging beyond both equilibria's. The circles' arcs are as long as it takes for
    the figure to close; the default car steers at most 0.62 rad in a 20 m transition and 0.56 rad in a 25 m one.

    Lengths that are not given go with the wheelbase (`similarity`): 18 m, 20 m and 3 m for the default car.

    Args:
        parameters: the car whose equilibria are wanted.
        radius: [m] of both circles; sideslip: size [rad] of both drifts.
        transition: [m] from the one steady drift to the other.
        half_width: [m] of the lane to either side.
        laps: [-] to drive, from half-way round the left-hand circle on (1.5: some 27 s, three transitions).

    Raises:
        InvalidOptionError: a number that is not above zero; InvalidVehicleError: a parameter that no car has.
        NoEquilibriumError: the car cannot drift steadily at this radius and sideslip.
        NoTransitionError: the car cannot go from one drift to the other over the transition.

    Examples:
        >>> round(figure_8(car).duration, 1)  # [s]
        26.8
    """
    unit = similarity(parameters).length
    radius, transition = (
        RADIUS * unit if radius is None else radius,
        TRANSITION * unit if transition is None else transition,
    )
    half_width = HALF_WIDTH * unit if half_width is None else half_width
    for name, value in (
        ("radius", radius),
        ("sideslip", sideslip),
        ("transition", transition),
        ("half-width", half_width),
    ):
        if not 0.0 < value < math.inf:
            raise InvalidOptionError(f"the figure-8's {name} is {value:g}; give a number above 0")
    asked = (radius, sideslip, transition)
    try:
        legs, path = figure_8_legs(parameters, asked)
    except (NoEquilibriumError, NoTransitionError) as error:
        raise type(error)(instead(figure_8_legs, parameters, asked, str(error))) from None
    # Laid out with the left-hand circle about the origin, then moved so that the circles' centres lie on the x axis,
    # at equal distances from the origin.
    x, y = path.to_world(0.5 * path.length, -radius)
    tilt, half_distance = math.atan2(y, x), 0.5 * math.hypot(x, y)
    start = (-radius * math.cos(tilt) - half_distance, radius * math.sin(tilt), -0.5 * math.pi - tilt)
    return _reference(chain(parameters, legs, start, closed=True), half_width, laps)


def loops(parameters: VehicleParameters, radius: float | None = None, sideslip: float = 0.6, count: int = 4,
          swing: float = 4.0, initiation: float | None = None, transition: float | None = None,
          entry_speed: float | None = None, half_width: float | None = None) -> Reference:  # fmt: skip
    """A straight entry in grip, a drift initiation, and linked loops to alternating sides (the paper's section IV-C).

    The car accelerates along the x axis from `entry_speed` to the drift's speed, breaks away while the curvature builds
    up, and drifts `count` loops, the first one to the left, with transitions in between. The loops follow each other
    along x. All joints are feasible motions (`plan_transition`).

    What is not given goes with the car's size (`similarity`): for the default car lengths of 18 m, 30 m, 20 m and 3 m,
    and 8 m/s at the start.

    Args:
        parameters: the car whose equilibria are wanted.
        radius: [m] of the loops; sideslip: size [rad] of the drifts; count: how many loops.
        swing: [rad] between the path's headings at the ends of two loops, about the x axis.
        initiation: [m] from the straight to the first drift; transition: [m] from one drift to the next.
        entry_speed: [m/s] at the start.
        half_width: [m] of the lane to either side.

    Raises:
        InvalidVehicleError: a parameter that no car has; ValueError: an entry speed out of its range.
        NoEquilibriumError: the car cannot drift steadily at this radius and sideslip.
        NoTransitionError: the car cannot go from one state to the next over the distance.

    Examples:
        >>> round(loops(car, count=2).duration, 1)  # [s]
        16.7
    """
    units = similarity(parameters)
    radius = RADIUS * units.length if radius is None else radius
    initiation = INITIATION * units.length if initiation is None else initiation
    transition = TRANSITION * units.length if transition is None else transition
    entry_speed = ENTRY_SPEED * units.speed if entry_speed is None else entry_speed
    half_width = HALF_WIDTH * units.length if half_width is None else half_width
    left = drift_equilibrium(parameters, radius, -sideslip)
    entry = steady_straight(left.v)
    turned = _turning(plan_transition(parameters, entry, left, initiation))
    change = _turning(plan_transition(parameters, left, other_side(left), transition))
    if not 0.5 * swing > turned:
        raise ValueError(
            f"swing is {swing:g} rad; the initiation turns through {turned:.2f} rad, give more than twice that"
        )
    arc = radius * (swing + change)
    legs = [
        Leg(steady_straight(entry_speed), ENTRY_LENGTH * units.length, ACCELERATION_LENGTH * units.length),
        Leg(entry, ENTRY_LENGTH * units.length, initiation),
        Leg(left, radius * (0.5 * swing - turned), transition),
        *(Leg(left if index % 2 == 0 else other_side(left), arc, transition) for index in range(1, count)),
    ]
    return _reference(chain(parameters, legs, (0.0, 0.0, 0.0)), half_width, 1.0)


def _turning(motion: Transition) -> float:
    """Change of course [rad] over a transition."""
    return Path(motion.s, motion.curvature).turning


def _reference(parts: Chain, half_width: float, laps: float) -> Reference:
    lane = np.full_like(parts.s, half_width)
    return Reference(
        path=parts.path, s=parts.s, **parts.columns, e_min=-lane, e_max=lane, in_transition=parts.in_transition,
        distance=laps * parts.path.length)  # fmt: skip
