"""What is believed of magnitudes before the data: ranges, scales, starting points; which would be named."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE, REFERENCE
from drift_drake.car.parameters import Tolerance, VehicleParameters
from drift_drake.car.vehicle_file import effect_range

REACH = 1.5  # magnitudes are believed up to this many times the ends of the practical range
LEAST = 0.5  # and unsigned ones down to this part of its low end
TOLERANCE_OF = {name: info.tolerance for name, info in CATALOGUE.items() if info.tolerance}
NO_GAP = 1.5  # tolerances up to which such an effect is none: a deviation of a tolerance's size is no gap to report
TWO_SIDED = 1.96  # standard deviations
SIGNED_GRID = (-1.0, -0.65, -0.4, -0.2, 0.2, 0.4, 0.65, 1.0)  # of the reach
UNSIGNED_GRID = (0.1, 0.2, 0.35, 0.5, 0.7, 1.0)
FEW_SIGNED, FEW_UNSIGNED = (-0.65, -0.2, 0.2, 0.65), (0.15, 0.5, 1.0)  # of a simulator whose roll-outs take long
FARTHER = 2.0  # times the reach that is looked at where the most likely magnitude is at its end
NEAR_END = 0.02  # of the reach
SURE = 1.645  # standard deviations of a one-sided 95 %
AGAINST_NONE = 5.5  # [nats] that an effect's prior and the width of its range cost it relative to none
RELATIVE_TO_NONE = float(SURE + np.sqrt(SURE**2 + 2.0 * AGAINST_NONE))  # standard deviations that a shift must have
RELATIVE_TO_RIVAL = 2.0 * SURE  # that it must be from a rival's


def bounds(name: str, vehicle: VehicleParameters = REFERENCE) -> tuple[float, float]:
    """Magnitudes that are believed possible at all, of a car of that size."""
    info = CATALOGUE[name]
    low, high = info.range_for(vehicle)
    return REACH * low if info.signed else LEAST * low, REACH * high


def scale(name: str, vehicle: VehicleParameters = REFERENCE) -> float:
    """Unit of a magnitude in the solver: the far end of its practical range."""
    return max(abs(q) for q in CATALOGUE[name].range_for(vehicle))


def named_from(likeness: np.ndarray) -> np.ndarray:
    """Standard deviations that effects have to shift scores by, to be named with 95 % probability [n].

    Far enough from none, and from what the effect most like it can do; likeness: absolute cosine of its signature with
    that one's [n].
    """
    apart = np.sqrt(np.maximum(1.0 - np.minimum(likeness, 1.0) ** 2, 1e-12))
    return np.maximum(RELATIVE_TO_NONE, RELATIVE_TO_RIVAL / apart)


def is_gap(name: str, magnitude: float, tolerance: Tolerance) -> bool:
    """Whether a magnitude is more than the vehicle file's own tolerance allows for."""
    if name not in TOLERANCE_OF:
        return True
    return abs(magnitude) > NO_GAP * float(getattr(tolerance, TOLERANCE_OF[name]))


def starts(name: str, vehicle: VehicleParameters = REFERENCE) -> list[float]:
    """Magnitudes from which fits are started: both signs, or spread over the range."""
    info = CATALOGUE[name]
    low, high = info.range_for(vehicle)
    if info.signed:
        return [0.4 * low, 0.4 * high]
    if info.spread:
        return [float(q) for q in np.geomspace(1.2 * low, 0.85 * high, 3)]
    return [low + 0.3 * (high - low)]


def log_density(name: str, vehicle: VehicleParameters = REFERENCE) -> float:
    """Log of the uniform prior density of a magnitude over its bounds."""
    low, high = bounds(name, vehicle)
    return -float(np.log(high - low))


@dataclasses.dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % interval."""

    estimate: float
    low: float
    high: float


@dataclasses.dataclass(frozen=True)
class Range:
    """Magnitudes that a hypothesis may have."""

    low: float
    high: float
    least: float  # of the absolute value
    usual: tuple[float, float]  # practical range, beyond which it is less and less likely

    @property
    def width(self) -> float:
        """Of all magnitudes that would be a gap; there may be none on one side of zero."""
        below = max(-self.low - self.least, 0.0) if self.low < 0.0 else 0.0
        return max(self.high - self.least, 0.0) + below

    def allows(self, q: np.ndarray) -> np.ndarray:
        """Which magnitudes [m] are within bounds and a gap [m] (bool)."""
        return np.asarray((np.abs(q) >= self.least * (1.0 - 1e-9)) & (q >= self.low) & (q <= self.high))


def range_of(name: str, vehicle: VehicleParameters) -> Range:
    """Magnitudes of an effect that would be a gap, and are believed possible.

    A tolerance of a calibrated car is the same car's on both days: no gap is within it.
    """
    info = CATALOGUE[name]
    low, high = info.range_for(vehicle)
    least = info.least_for(vehicle)
    return Range(REACH * low if info.signed else least, REACH * high, least, (low, high))


def at_shares(r: Range, shares: Sequence[float]) -> list[float]:
    """Magnitudes of a range at signed shares of its reach."""
    return [q * r.high if q > 0.0 else -q * r.low for q in shares]


def tried_first(r: Range, few: bool = False) -> list[float]:
    """Magnitudes that a search begins with; few: as each of them takes long."""
    signed, unsigned = (FEW_SIGNED, FEW_UNSIGNED) if few else (SIGNED_GRID, UNSIGNED_GRID)
    return at_shares(r, signed) if r.low < 0.0 else [max(q * r.high, r.least) for q in unsigned]


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
    # One side may have no gap.
    up = r.least <= r.high and (q >= 0.0 or r.least > -r.low)
    return r.least if up else -r.least
