"""A sideslip that stays at its value while the car changes: no single reading shows it, the motion does.

The sideslip is the course less the heading, so that it changes by the change of the course less the integral of the
yaw rate, for any car. What the readings miss of that over the last second or two is held against what errors of the
yaw-rate sensor and noise can make.
"""

import math
from typing import NamedTuple

import numpy as np

from drift_drake.car.sensors import MEASURED_STATE
from drift_drake.common.arrays import Array
from drift_drake.drive.screening.fusion import Fused

R, BETA, DPHI, S = (MEASURED_STATE.index(name) for name in ("r", "beta", "dphi", "s"))
MEMORY = 1.5  # [s] over which an error adds up
LEAST, DEVIATIONS = 0.06, 5.0  # [rad] of error, and standard deviations of the readings' noise
GAIN = 0.05  # of the angle turned: errors of a yaw-rate sensor's scale and zero
SETTLED = 4.0  # [s] without a bad reading: where another channel has just been wrong, it may be that one again
DOUBTED = 2.0  # [s] for which the sideslip is not used once it was found to be wrong


class Holding(NamedTuple):
    """What a run of good readings says of the sideslip."""

    error: float = 0.0  # [rad] of the sideslip, less what is forgotten
    turned: float = 0.0  # [rad] of the heading, to either side, less what is forgotten
    good: float = SETTLED  # [s] since the last bad reading
    doubted: float = 0.0  # [s] for which it is not used from now on

    def after_bad(self, period: float) -> "Holding":
        """After a reading that is not good."""
        return Holding(good=0.0, doubted=max(self.doubted - period, 0.0))

    def after_good(self, x: Array, last: Array, curvature: float, length: float, period: float) -> "Holding":
        """After a good reading x [7], the last one a period [s] before; curvature [1/m] and length [m] of the path."""
        along = x[S] - last[S]
        if math.isfinite(length):
            along = math.remainder(along, length)
        course = math.remainder(x[DPHI] - last[DPHI], 2.0 * math.pi) + curvature * along
        heading = 0.5 * period * (x[R] + last[R])
        missed = math.remainder(x[BETA] - last[BETA], 2.0 * math.pi) - (course - heading)
        kept = 1.0 - period / MEMORY
        return Holding(
            kept * (self.error + missed), kept * (self.turned + abs(heading)), self.good + period,
            max(self.doubted - period, 0.0),
        )  # fmt: skip

    def without(self, x: Array, noise: Array) -> tuple[Array, Fused]:
        """A reading [7] with the sideslip that the motion says in place of its own, and how uncertain it is."""
        right, fused = np.array(x), Fused.after_good(noise)
        right[BETA] -= self.error
        fused.covariance[BETA, BETA] = LEAST**2
        return right, fused

    def wrong(self, noise: Array) -> bool:
        """Whether the sideslip is off by more than noise [7] and the yaw-rate sensor's errors can make."""
        spread = float(np.hypot(noise[BETA], noise[DPHI]))
        return self.good >= SETTLED and abs(self.error) > LEAST + DEVIATIONS * spread + GAIN * self.turned
