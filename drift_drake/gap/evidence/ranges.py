"""Magnitudes that an effect may have: what would be a gap, what is usual, how far to look, when it would be named."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import effect_range

REACH = 1.5  # times the ends of the practical range that a magnitude may reach
SIGNED_GRID = (-1.0, -0.65, -0.4, -0.2, 0.2, 0.4, 0.65, 1.0)  # of the reach
UNSIGNED_GRID = (0.1, 0.2, 0.35, 0.5, 0.7, 1.0)
NO_GAP = 1.5  # tolerances of the calibrated car up to which a deviation of its parameters is no gap
FARTHER = 2.0  # times the reach that is looked at where the most likely magnitude is at its end
NEAR_END = 0.02  # of the reach
SURE = 1.645  # standard deviations of a one-sided 95 %
AGAINST_NONE = 5.5  # [nats] that an effect's prior and the width of its range cost it relative to none
RELATIVE_TO_NONE = float(SURE + np.sqrt(SURE**2 + 2.0 * AGAINST_NONE))  # standard deviations that a shift must have
RELATIVE_TO_RIVAL = 2.0 * SURE  # that it must be from a rival's


@dataclasses.dataclass(frozen=True)
class Range:
    """Magnitudes that a hypothesis may have."""

    low: float
    high: float
    least: float  # of the absolute value
    usual: tuple[float, float]  # practical range, beyond which it is less and less likely

    @property
    def width(self) -> float:
        """Of all magnitudes that would be a gap; a wide tolerance may leave none on one side of zero."""
        below = max(-self.low - self.least, 0.0) if self.low < 0.0 else 0.0
        return max(self.high - self.least, 0.0) + below

    def allows(self, q: np.ndarray) -> np.ndarray:
        """Which magnitudes [m] are within bounds and a gap [m] (bool)."""
        return np.asarray((np.abs(q) >= self.least * (1.0 - 1e-9)) & (q >= self.low) & (q <= self.high))


def range_of(name: str, vehicle: VehicleParameters, tolerances: bool = True) -> Range:
    """Magnitudes of an effect that would be a gap, and are believed possible; tolerances: what is within one
    is no gap."""
    info = CATALOGUE[name]
    low, high = info.range_for(vehicle)
    least = info.least_for(vehicle)
    if info.tolerance and tolerances:
        least = max(least, NO_GAP * float(getattr(vehicle.tolerance, info.tolerance)))
    return Range(REACH * low if info.signed else least, REACH * high, least, (low, high))


def at_shares(r: Range, shares: Sequence[float]) -> list[float]:
    """Magnitudes of a range at signed shares of its reach."""
    return [q * r.high if q > 0.0 else -q * r.low for q in shares]


def tried_first(r: Range) -> list[float]:
    """Magnitudes that a search begins with."""
    return at_shares(r, SIGNED_GRID) if r.low < 0.0 else [max(q * r.high, r.least) for q in UNSIGNED_GRID]


def at_end(q: float, r: Range) -> bool:
    """Whether a magnitude is at the end of what is looked at, so that the true one may lie beyond."""
    return min(abs(q - r.high), abs(q - r.low) if r.low < 0.0 else np.inf) < NEAR_END * r.high


def farther(name: str, r: Range, vehicle: VehicleParameters) -> Range:
    """The range with more reach, as far as any vehicle's effect goes; what is usual stays."""
    low, high = effect_range(name, vehicle)
    reach = max(FARTHER * r.low, low) if r.low < 0.0 else r.low
    return dataclasses.replace(r, high=min(FARTHER * r.high, high), low=reach)


def clipped(q: float, r: Range) -> float:
    """The nearest magnitude that is within bounds and a gap."""
    q = float(np.clip(q, r.low, r.high))
    if abs(q) >= r.least:
        return q
    # A wide tolerance may leave one side without a gap.
    up = r.least <= r.high and (q >= 0.0 or r.least > -r.low)
    return r.least if up else -r.least
