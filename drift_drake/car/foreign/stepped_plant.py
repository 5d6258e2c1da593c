"""A car that another program steps, as a plant in Drake: its whole state lies in the Context."""

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.car.on_path import PLANT_STATES
from drift_drake.car.path_plant import PORTS, POSE_AT, CurvedPath, MotionError, PathPlant
from drift_drake.car.single_track.motion import INPUTS
from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_output, declare_parts, declare_update

PERIOD = 0.002  # [s] between samples of the command
NEAREST = 3  # Newton steps to the path's nearest point, from that of a period before
S, HEADING, ACCELERATION, OWN = 0, 1, slice(2, 4), 4  # places in the state


class WorldMotion(NamedTuple):
    """Where a car is and how it moves, its centre of gravity in the world's frame (SI)."""

    x: float
    y: float
    psi: float  # with jumps by 2 pi, perhaps
    r: float
    v_x: float  # in the world
    v_y: float
    omega_r: float  # [m/s] mean rim speed of the rear wheels


class SteppedCar(Protocol):
    """What another program offers of a car; it keeps nothing between two calls."""

    @property
    def state_names(self) -> Sequence[str]:
        """Of its own state."""

    def start(self, state: Sequence[float], pose: Sequence[float], actuation: Sequence[float]) -> Array:
        """Its own state [n] at (r, v, beta, omega_r) and (x, y, psi), the command having been (delta, tau) for long."""

    def step(self, own: Array, actuation: Array, wrench: Array, duration: float) -> Array:
        """Its state [n] `duration` [s] later, under (delta [rad], tau [N m]) and a wrench on the body [3]."""

    def motion(self, own: Array) -> WorldMotion:
        """What of it the world sees."""


class SteppedPlant(PathPlant, LeafSystem):
    """A `SteppedCar` with the ports of every plant; each `PERIOD` it is stepped under the command of its begin.

    e, dphi and s follow from where it is: the point of the path nearest to it. Accelerations are those over the last
    step. State in the Context: s, psi without jumps, these accelerations, and the car's own.

    Args:
        car: the car; path: that it is put on; the x axis without one.

    Raises:
        MotionError: its state is no longer finite.
    """

    has_internal_states = False

    def __init__(self, car: SteppedCar, path: CurvedPath | None) -> None:
        LeafSystem.__init__(self)
        self._car, self.path = car, path
        self.state_names = (*PLANT_STATES, *car.state_names)
        self._actuation = self.DeclareVectorInputPort("actuation", len(INPUTS))
        self._disturbance = self.DeclareVectorInputPort("disturbance", 3)
        self.DeclareVectorInputPort("curvature", 1)
        self._state = self.DeclareDiscreteState(OWN + len(car.state_names))
        declare_update(self, PERIOD, self._step)
        given = {self.xd_ticket()}
        declare_parts(self, PORTS | {"full_state": slice(0, len(self.state_names))}, self._full_state, given)
        declare_output(self, "acceleration", 2, lambda context: self._held(context)[ACCELERATION], given)

    def set_initial(
        self, context: Context, state: Sequence[float], s: float = 0.0, pose: Sequence[float] | None = None,
        actuation: Sequence[float] = (0.0, 0.0),
    ) -> None:  # fmt: skip
        """See `PathPlant.set_initial`."""
        placed = self.placed(state, s, pose)
        own = self._car.start(placed[:4], placed[POSE_AT:], actuation)
        context.SetDiscreteState(np.concatenate([[placed[6], placed[9], 0.0, 0.0], own]))

    def _held(self, context: Context) -> Array:
        return context.get_discrete_state(self._state).value()

    def _step(self, context: Context, discrete: DiscreteValues) -> None:
        held = self._held(context)
        wrench = self._disturbance.Eval(context) if self._disturbance.HasValue(context) else np.zeros(3)
        own = self._car.step(held[OWN:], self._actuation.Eval(context), wrench, PERIOD)
        if not np.isfinite(own).all():
            raise MotionError(f"the car's state is no longer finite at {context.get_time():g} s")
        before, now = self._car.motion(held[OWN:]), self._car.motion(own)
        change = np.array([now.v_x - before.v_x, now.v_y - before.v_y]) / PERIOD
        cos, sin = math.cos(now.psi), math.sin(now.psi)
        acceleration = cos * change[0] + sin * change[1], cos * change[1] - sin * change[0]
        psi = held[HEADING] + math.remainder(now.psi - held[HEADING], 2.0 * math.pi)
        discrete.set_value(self._state, np.concatenate([[self._nearest(now, held[S]), psi], acceleration, own]))

    def _nearest(self, motion: WorldMotion, s: float) -> float:
        """Path position [m] of the point nearest to the car, from where it was."""
        if self.path is None:
            return motion.x
        for _ in range(NEAREST):
            x, y, heading = (float(value) for value in self.path.pose(s))
            cos, sin = math.cos(heading), math.sin(heading)
            along = cos * (motion.x - x) + sin * (motion.y - y)
            across = cos * (motion.y - y) - sin * (motion.x - x)
            s += along / max(1.0 - self.path.curvature(s) * across, 0.1)
        return s

    def _full_state(self, context: Context) -> Array:
        held = self._held(context)
        m, s = self._car.motion(held[OWN:]), float(held[S])
        x, y, heading = (0.0, 0.0, 0.0) if self.path is None else (float(value) for value in self.path.pose(s))
        e = math.cos(heading) * (m.y - y) - math.sin(heading) * (m.x - x)
        course = math.atan2(m.v_y, m.v_x)
        beta, dphi = (math.remainder(course - angle, 2.0 * math.pi) for angle in (m.psi, heading))
        v, psi = math.hypot(m.v_x, m.v_y), held[HEADING]
        return np.concatenate([[m.r, v, beta, m.omega_r, e, dphi, s, m.x, m.y, psi], held[OWN:]])
