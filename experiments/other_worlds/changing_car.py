"""A car of another program that becomes another one on the way: other tyres' friction, less torque, slower steering."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from drift_drake.car.foreign.stepped_plant import SteppedCar, WorldMotion
from drift_drake.common.arrays import Array

TIME, STEERING, OWN = 0, 1, 2  # places in the state


@dataclasses.dataclass(frozen=True)
class ChangingCar:
    """A `SteppedCar`; its state holds the time and the steering angle that the actuator has come to, too."""

    before: SteppedCar
    after: SteppedCar  # of the same program, with as many states
    begin: float  # [s] of the change
    end: float = math.inf  # [s] from which on it is over
    torque: float = 1.0  # share of the torque that is left
    steering_rate: float = math.inf  # [rad/s] at most

    @property
    def state_names(self) -> Sequence[str]:
        return ("time", "steering", *self.before.state_names)

    def start(self, state: Sequence[float], pose: Sequence[float], actuation: Sequence[float]) -> Array:
        return np.concatenate([[0.0, actuation[0]], self.before.start(state, pose, actuation)])

    def step(self, own: Array, actuation: Array, wrench: Array, duration: float) -> Array:
        changed = self.begin <= own[TIME] < self.end
        steering, torque = float(actuation[0]), float(actuation[1])
        if changed:
            most = self.steering_rate * duration
            steering = own[STEERING] + min(max(steering - own[STEERING], -most), most)
            torque *= self.torque
        car = self.after if changed else self.before
        later = car.step(own[OWN:], np.array([steering, torque]), wrench, duration)
        return np.concatenate([[own[TIME] + duration, steering], later])

    def motion(self, own: Array) -> WorldMotion:
        return self.before.motion(own[OWN:])
