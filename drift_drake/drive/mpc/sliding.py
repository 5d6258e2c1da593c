"""The shortest stop of a car that slides: the front wheels turned into the bend as far as they go, and torque off.

An axle that slides gives its peak force across its wheels. Turned by delta into the bend that a car with the sideslip
beta slides through, the front one brakes by sin(delta - beta) of that and leaves cos(delta - beta) across, which a slow
car needs no more of; the rear one brakes by sin(-beta). From 0.6 rad and 12 m/s the default car stands after 12 m and
1.4 s, in place of 60 m and 9 s with the engine's drag alone. Forces at their peak depend on friction, not on slips, so
that a prediction that no reading corrects holds for so long. Where the slide would end too soon with the torque off at
once, the torque in force is kept for some tenths of a second: the rear tyre's force across stays small meanwhile.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from drift_drake.car.log.driving import slowest
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import rear_slip, static_loads
from drift_drake.car.step_model import NominalStepModel
from drift_drake.common.arrays import Array
from drift_drake.drive.reference.path import Path
from drift_drake.drive.reference.similarity import similarity

STEP = 0.05  # [s] of the prediction, for a car of the default one's size
STABLE = 2.5  # product of rate and step up to which Runge-Kutta 4 is stable
LONGEST = 50  # steps
KEPT = (0, 3, 6)  # steps for which the torque in force is kept; the first that serves
DEEPEST = 0.9  # [rad] of sideslip: as far below a spin (1.3) as a model errs that nothing corrects
INSIDE = 2.0 / 3.0  # of the lane's half-widths

Lane = Callable[[float], tuple[Array, Array]]
"""(e_min, e_max) [m] at a path position [m]."""


class SlidingStop:
    """Says whether a car that slides stands before it leaves its lane, if it steers into the bend from now on.

    Args:
        parameters: the nominal car, by which it is predicted; path, lane: on which it drives; rates: at which its
            command may change (2) [rad/s], [N m/s].
    """

    def __init__(self, parameters: VehicleParameters, path: Path, lane: Lane, rates: Array) -> None:
        self._p, self._path, self._lane = parameters, path, lane
        self._slowest = slowest(parameters)
        step = STEP * similarity(parameters).time
        rim = parameters.rear_stiffness * parameters.wheel_radius**2 / parameters.rear_axle_inertia / self._slowest
        self._model = NominalStepModel(parameters, step, math.ceil(step * rim / STABLE))
        self._most = rates * step

    def command(self, x: Array, command: Array) -> Array | None:
        """(delta [rad], tau [N m]) of such a stop; None where the car does not slide or would leave its lane.

        Args:
            x: (r, v, beta, omega_r, e, dphi, s) [7]; command: in force [2].
        """
        if not (np.isfinite(x).all() and self._slides(x)):
            return None
        lock = -math.copysign(self._p.steering_limit, x[2])
        sliding, off = np.array([lock, command[1]]), np.array([lock, self._p.torque_min])
        for kept in KEPT:
            if self._stands_on_its_lane(x, command, [sliding] * kept + [off] * (LONGEST - kept)):
                return sliding if kept else off
        return None

    def _slides(self, x: Array) -> bool:
        """Whether the rear tyre is at its peak, as a brush tyre would be."""
        p = self._p
        _, load = static_loads(p.constants())
        slip = math.hypot(*rear_slip(*x[:4], p.rear_axle_distance))
        return p.rear_stiffness * slip >= 3.0 * p.friction * load

    def _stands_on_its_lane(self, x: Array, command: Array, commands: Sequence[Array]) -> bool:
        """By the nominal car; commands: wanted at each step, which the command in force [2] moves towards."""
        state, s, e_start = np.array(x[:6]), float(x[6]), float(x[4])
        for wanted in commands:
            curvature = self._path.curvature(s)
            after = command + np.clip(wanted - command, -self._most, self._most)
            s += self._model.dt * state[1] * math.cos(state[5]) / (1.0 - curvature * state[4])
            state = self._model.step(state[None], command[None], after[None], np.array([curvature]))[0]
            command = after
            if not np.isfinite(state).all() or abs(state[2]) > DEEPEST:
                return False
            low, high = self._lane(s)
            if not min(INSIDE * low, e_start) <= state[4] <= max(INSIDE * high, e_start):
                return False
            if state[1] < self._slowest:
                return True
        return False
