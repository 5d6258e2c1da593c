"""What is believed of magnitudes before the data: ranges, scales, starting points."""

import dataclasses

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE, REFERENCE
from drift_drake.car.parameters import Tolerance, VehicleParameters

REACH = 1.5  # magnitudes are believed up to this many times the ends of the practical range
LEAST = 0.5  # and unsigned ones down to this part of its low end
TOLERANCE_OF = {name: info.tolerance for name, info in CATALOGUE.items() if info.tolerance}
NO_GAP = 1.5  # tolerances up to which such an effect is none: a deviation of a tolerance's size is no gap to report
TWO_SIDED = 1.96  # standard deviations


def bounds(name: str, vehicle: VehicleParameters = REFERENCE) -> tuple[float, float]:
    """Magnitudes that are believed possible at all, of a car of that size."""
    info = CATALOGUE[name]
    low, high = info.range_for(vehicle)
    return REACH * low if info.signed else LEAST * low, REACH * high


def scale(name: str, vehicle: VehicleParameters = REFERENCE) -> float:
    """Unit of a magnitude in the solver: the far end of its practical range."""
    return max(abs(q) for q in CATALOGUE[name].range_for(vehicle))


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
