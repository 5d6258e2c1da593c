"""How far quantities of a car that a vehicle file says nothing of may be from a first guess."""

from typing import NamedTuple

import numpy as np

FURTHEST = 4.0  # standard deviations


class Deviation(NamedTuple):
    """From car to car: one standard deviation, and the bounds of the quantity."""

    unit: str
    deviation: float
    relative: bool = True  # of its logarithm
    low: float = 0.0
    high: float = np.inf

    def moved(self, first: float, by: float) -> float:
        """The quantity `by` so many standard deviations from a first guess."""
        return first * float(np.exp(self.deviation * by)) if self.relative else first + self.deviation * by

    def bounds(self, first: float) -> tuple[float, float]:
        """Least and greatest `by`."""
        if self.relative:
            return -FURTHEST, FURTHEST
        low, high = ((end - first) / self.deviation for end in (self.low, self.high))
        return max(low, -FURTHEST), min(high, FURTHEST)
