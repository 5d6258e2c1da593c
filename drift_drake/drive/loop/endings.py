"""How a run in the closed loop ends: completed, stopped, spun, off the lane."""

import dataclasses
import math
from typing import Any, Literal

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.drive.reference.trajectory import Reference

Outcome = Literal["completed", "stopped safely", "spin", "left the lane", "time is up", "simulation failed"]


@dataclasses.dataclass(frozen=True)
class RunLimits:
    """When a run ends early.

    Examples:
        >>> RunLimits(time_factor=0.5, lane_margin=2.0).sideslip
        1.3
    """

    sideslip: float = 1.3  # [rad] beyond which the car has spun
    turned: float = 1.0  # [s] for which the car heads backwards along its path, after which it has spun, too
    lane_margin: float = 1.0  # [m] that the centre of gravity may be outside the lane
    time_factor: float = 1.5  # [-] of the reference's own duration; at the safe pace where the car may be slowed down
    stopping_time: float = 30.0  # [s] more for a car that is being stopped


def heads_backwards(beta: Any, dphi: Any) -> Any:
    """Whether a car is turned by more than 90 degrees from its path; beta, dphi: its sideslip and course [rad]."""
    return np.cos(dphi - beta) < 0.0


class Ending:
    """Says of one run, state by state, when and how it ends; it remembers since when the car heads backwards.

    Args:
        reference: that is driven; limits: of the run.
        standstill: [m/s] below which a car that is being stopped has stopped.
    """

    def __init__(self, reference: Reference, limits: RunLimits, standstill: float) -> None:
        self._reference, self._limits, self._standstill = reference, limits, standstill
        self._turned_at = math.inf

    def __call__(self, t: float, state: Array, stopping: bool) -> Outcome | None:
        """How a run ends here and now; None where it goes on.

        Args:
            t: time [s], not before that of the last call; state: the plant's; stopping: whether the car is being
                stopped.
        """
        limits = self._limits
        v, beta, e, dphi, s = (float(state[i]) for i in (1, 2, 4, 5, 6))
        self._turned_at = min(self._turned_at, t) if heads_backwards(beta, dphi) else math.inf
        if abs(beta) > limits.sideslip or t - self._turned_at >= limits.turned:
            return "spin"
        e_min, e_max = self._reference.lane(s)
        if not e_min - limits.lane_margin <= e <= e_max + limits.lane_margin:
            return "left the lane"
        if stopping:
            return "stopped safely" if v < self._standstill else None
        return "completed" if s >= self._reference.distance else None
