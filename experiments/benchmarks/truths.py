"""What a case hides, and how it is drawn: effects, deviations within tolerance, effects that the catalogue lacks."""

import dataclasses

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.parameters import Constants, Tolerance, VehicleParameters
from drift_drake.gap.estimation.prior import TOLERANCE_OF
from experiments.benchmarks.strange_effects import FAMILIES

LEAST_TOLERANCES = 4.0  # a deviation of a tolerance's size is no gap to report


@dataclasses.dataclass(frozen=True)
class Truth:
    """What a case hides: effects of the catalogue, strange ones, and the car's deviations from nominal."""

    effects: dict[str, float]
    strange: dict[str, float] = dataclasses.field(default_factory=dict)
    deviations: dict[str, float] = dataclasses.field(default_factory=dict)


def true_constants(vehicle: VehicleParameters, deviations: dict[str, float]) -> tuple[Constants, float]:
    """The car's own constants under its deviations from nominal, and its steering offset [rad]."""
    c = vehicle.constants()._asdict()
    for name, value in deviations.items():
        if name == "front_axle_distance":
            c["front_axle_distance"] += value
            c["rear_axle_distance"] -= value
        elif name == "torque":
            c["gear_ratio"] *= 1.0 + value
        elif name != "steering_offset":
            c[name] *= 1.0 + value
    return Constants(**c), deviations.get("steering_offset", 0.0)


def true_car(truth: Truth, vehicle: VehicleParameters) -> tuple[Constants, Effects]:
    """The car that a truth describes, its strange effects aside."""
    constants, offset = true_constants(vehicle, truth.deviations)
    effects = make_effects(truth.effects)
    return constants, effects._replace(steering_offset=effects.steering_offset + offset)


def drawn_deviations(rng: np.random.Generator, tolerance: Tolerance) -> dict[str, float]:
    """Deviations from nominal, one normal draw of each tolerance's standard deviation (two and a half at most)."""
    sizes = {name: size for name, size in dataclasses.asdict(tolerance).items() if name != "gear_ratio"}
    return {name: float(np.clip(rng.standard_normal(), -2.5, 2.5) * size) for name, size in sizes.items()}


def drawn_magnitude(rng: np.random.Generator, name: str, tolerance: Tolerance) -> float:
    """A magnitude within the practical range.

    A signed one is at least an eighth of the way to its end, and one that a tolerance could be at least four of them.
    """
    info = CATALOGUE[name]
    if not info.signed:
        return float(rng.uniform(info.low, info.high))
    end = info.low if rng.uniform() < 0.5 else info.high
    least = 0.125 * abs(end)
    if name in TOLERANCE_OF:
        least = max(least, LEAST_TOLERANCES * getattr(tolerance, TOLERANCE_OF[name]))
    return float(np.sign(end) * rng.uniform(least, abs(end)))


def drawn_truth(rng: np.random.Generator, tier: str, vehicle: VehicleParameters) -> Truth:
    """What a case of a tier hides.

    Tiers: exact (a single effect, the nominal exact), tolerance (a single effect, the nominal off), none, pair,
    family (an effect that the catalogue lacks).
    """
    deviations = {} if tier == "exact" else drawn_deviations(rng, vehicle.tolerance)
    if tier == "none":
        return Truth({}, {}, deviations)
    if tier == "family":
        name = str(rng.choice(list(FAMILIES)))
        family = FAMILIES[name]
        sign = -1.0 if family.signed and rng.uniform() < 0.5 else 1.0
        return Truth({}, {name: sign * float(rng.uniform(family.low, family.high))}, deviations)
    names = rng.choice(list(CATALOGUE), size=2 if tier == "pair" else 1, replace=False)
    return Truth({str(name): drawn_magnitude(rng, str(name), vehicle.tolerance) for name in names}, {}, deviations)
