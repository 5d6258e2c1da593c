"""What is unknown of a car, by name: deviations from its vehicle file, as effects of the catalogue.

A deviation of the file's own parameters is an effect too (`yaw_inertia_error`, `cg_shift`, ...), so that one vector of
named magnitudes serves calibration, diagnosis and tolerances alike.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE, REFERENCE, wheelbase
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import CarConstants, folded_into, kind_of
from drift_drake.car.parameters import SomeCar, Tolerance, VehicleParameters

OWN = tuple(name for name, info in CATALOGUE.items() if info.tolerance)  # deviations of the file's own parameters
FIELDS = {  # of the vehicle file, that an effect is a deviation of; a deviation of the torque is one of the gear ratio
    name: {"torque": "gear_ratio"}.get(tolerance, tolerance)
    for name in OWN if (tolerance := str(CATALOGUE[name].tolerance)) == "torque" or hasattr(REFERENCE, tolerance)
}  # fmt: skip
BROAD = Tolerance(  # standard deviations where the vehicle file states no tolerance
    mass=0.2,
    yaw_inertia=0.3,
    front_axle_distance=0.05,  # of the wheelbase here
    wheel_radius=0.05,
    rear_axle_inertia=0.5,
    torque=0.2,
    friction=0.3,
    front_stiffness=0.5,
    rear_stiffness=0.5,
    steering_offset=0.02,
)
SHIFTED = "front_axle_distance"  # whose deviation moves the rear axle the other way
CAUTION = 2.0  # stated tolerances that a first guess may be off, as one standard deviation
LEAST = -0.8  # relative deviation, below which a mass, an inertia or a stiffness makes no car
LEAST_SHARE = 0.15  # of the wheelbase, between an axle and the centre of gravity
FURTHEST = 2.0  # times the practical range that a magnitude may reach
FIRST_SHARE = 0.05  # of its range that an unsigned effect starts from
SHORTEST_RELAXATION = 0.04  # of the wheelbase: shorter ones are no lag that a log shows
DIFFERENCE = 0.01  # of a unit, for derivatives


@dataclasses.dataclass(frozen=True)
class Unknown:
    """One magnitude: its unit for steps, its prior's standard deviation around zero, its bounds, where it starts."""

    name: str
    unit: float
    prior: float
    low: float
    high: float
    start: float


def unknown(name: str, vehicle: VehicleParameters, stated: frozenset[str]) -> Unknown:
    """What is believed of one effect before the logs.

    Args:
        vehicle: the first guess; stated: tolerances that its file states (`Tolerance`'s names), believed with caution.
    """
    info = CATALOGUE[name]
    bottom, top = info.range_for(vehicle)
    size = max(abs(bottom), abs(top))
    if info.tolerance:
        prior = getattr(BROAD, info.tolerance) * (wheelbase(vehicle) if info.tolerance == SHIFTED else 1.0)
        if info.tolerance in stated:
            prior = CAUTION * max(float(getattr(vehicle.tolerance, info.tolerance)), 1e-6)
        low, high = LEAST, -5.0 * LEAST
        if info.tolerance == SHIFTED:
            low = LEAST_SHARE * wheelbase(vehicle) - vehicle.front_axle_distance
            high = vehicle.rear_axle_distance - LEAST_SHARE * wheelbase(vehicle)
        elif info.unit != "-":
            low, high = -FURTHEST * size, FURTHEST * size
        return Unknown(name, min(size, prior), prior, low, high, 0.0)
    low = -FURTHEST * size if info.signed else 0.0
    if info.rolled:
        low = SHORTEST_RELAXATION * wheelbase(vehicle)
    start = 0.0 if info.signed else max(FIRST_SHARE * size, low)
    return Unknown(name, size, size, low, FURTHEST * size, start)


def added(effects: Effects, more: Mapping[str, float]) -> Effects:
    """Effects with further magnitudes added."""
    return effects._replace(**{name: getattr(effects, name) + value for name, value in more.items()})


def magnitudes(names: Sequence[str], theta: np.ndarray) -> dict[str, float]:
    """A vector of magnitudes by name."""
    return dict(zip(names, (float(q) for q in theta), strict=True))


def folded(car: SomeCar, effects: Effects) -> tuple[SomeCar, Effects]:
    """The same car with the effects that change its parameters put into them; the other effects stay.

    Raises:
        InvalidVehicleError: no car has these parameters.
    """
    changed, rest = folded_into(car.constants(), effects)
    return car.with_constants(changed), rest


def deviations_of(constants: CarConstants) -> list[Unknown]:
    """What a car of this kind has that a vehicle file says nothing of, in standard deviations from the first guess."""
    kind = kind_of(constants)
    bounds = {name: deviation.bounds(kind.value_of(name, constants)) for name, deviation in kind.deviations.items()}
    return [Unknown(name, 1.0, 1.0, low, high, 0.0) for name, (low, high) in bounds.items()]


def with_found(constants: CarConstants, effects: Effects, found: Mapping[str, float]) -> tuple[CarConstants, Effects]:
    """A first guess with magnitudes of what was unknown: further effects and deviations of its kind."""
    effects = added(effects, {name: q for name, q in found.items() if name in CATALOGUE})
    return kind_of(constants).deviated(constants, found, effects), effects
