"""How far a reading is from what the car's model makes of the last one: an innovation and its covariance.

Over one control period the noise of two readings and what the model does not know add up. The latter is stated as
standard deviations of forces: 0.3 of the friction limit, along, across, and about the vertical axis. That is wide: a
car of half the grip is within it. Gross errors of the sensors are not.
"""

import math

import numpy as np
from scipy.stats import chi2

from drift_drake.arrays import Array
from drift_drake.logs.driving import slowest
from drift_drake.reference.path import Path
from drift_drake.sensing.sensors import MEASURED_STATE, NoiseLevels
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.step_model import NominalStepModel

UNMODELLED = 0.3  # of the friction limit: standard deviation of the forces
ANGLE = 0.05  # [rad] of the course: what offsets of the sensors make of the motion along the path
INSIDE = 0.9  # of the radius of a bend: beyond, the path's coordinates say little
FALSE_ALARMS = 1e-9  # a reading, were all normal: the chi-square's bound
STABLE = 2.5  # product of rate and step up to which Runge-Kutta 4 is stable


class Innovation:
    """One-step prediction of a reading, and its squared Mahalanobis distance.

    Args:
        parameters: what the controller takes the car for; path: where it drives; noise: of the sensors, taken to be
            that of a good inertial system at least; period: [s] of a step.
    """

    def __init__(self, parameters: VehicleParameters, path: Path, noise: NoiseLevels, period: float) -> None:
        self._path, self._period, self._p = path, period, parameters
        self._slowest = slowest(parameters)
        rim = parameters.rear_stiffness * parameters.wheel_radius**2 / parameters.rear_axle_inertia / self._slowest
        self._model = NominalStepModel(parameters, period, math.ceil(period * rim / STABLE))
        self._noise = np.array([max(getattr(noise, name), getattr(NoiseLevels(), name)) for name in MEASURED_STATE])
        self.bound = float(chi2.isf(FALSE_ALARMS, len(MEASURED_STATE)))

    def predict(self, reading: Array, command: Array, next_command: Array) -> Array:
        """The reading [7] one period on, commands [2] linear in between; NaN where the model has none."""
        x, s = reading[:6], float(reading[6])
        curvature = self._path.curvature(s)
        if not (np.isfinite(reading).all() and min(x[1], x[3]) > self._slowest and curvature * x[4] < INSIDE):
            return np.full_like(reading, np.nan)
        speed = x[1] * math.cos(x[5]) / (1.0 - curvature * x[4])
        x_next = self._model.step(x[None], command[None], next_command[None], np.array([curvature]))[0]
        return np.append(x_next, s + self._period * speed)

    def distance(self, reading: Array, predicted: Array, spread: float) -> float:
        """d^2 of a reading [7] from its prediction, what is unmodelled having acted for `spread` [s]; 0 without one."""
        if not np.isfinite(predicted).all():
            return 0.0
        difference = reading - predicted
        if self._path.closed:
            difference[6] = math.remainder(difference[6], self._path.length)
        variance = 2.0 * self._noise**2 + (self._rates(max(predicted[1], self._slowest)) * spread) ** 2
        return float(np.sum(difference**2 / variance))

    def _rates(self, v: float) -> Array:
        """Standard deviations [7] of the readings' rates by what the model does not know."""
        p = self._p
        acceleration = UNMODELLED * p.friction * p.gravity
        force = acceleration * p.mass
        turning = force * p.front_axle_distance / p.yaw_inertia
        rim = force * p.wheel_radius**2 / p.rear_axle_inertia
        course, along = acceleration / v, ANGLE * v
        return np.array([turning, acceleration, course, rim, along, course, along])
