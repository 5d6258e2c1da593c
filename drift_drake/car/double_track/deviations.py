"""What a double-track car has that a vehicle file says nothing of, and how far it is from a first guess.

The tyres' numbers are those of all four: stiffnesses and friction differ between the axles by effects of the catalogue.
"""

from collections.abc import Mapping

from drift_drake.car.deviation import Deviation
from drift_drake.car.double_track.constants import DoubleTrackConstants, changed_constants
from drift_drake.car.double_track.tyres import TireConstants
from drift_drake.car.effects.magnitudes import Effects

LARGEST_WHEELS = 0.45  # inertia of a rear wheel over that of the axle with engine and gearbox


DEVIATIONS = {
    "cg_height": Deviation("m", 0.15),
    "roll_stiffness": Deviation("N m/rad", 0.3),  # of both axles
    "front_roll_share": Deviation("-", 0.08, relative=False, low=0.1, high=0.9),  # of it
    "longitudinal_stiffness": Deviation("N per unit slip", 0.3),
    "longitudinal_friction": Deviation("-", 0.15),
    "load_sensitivity": Deviation("-", 0.06, relative=False, high=0.4),
    "shape": Deviation("-", 0.1, relative=False, low=1.02, high=1.9),
    "curvature": Deviation("-", 0.5, relative=False, low=-4.0, high=0.99),
    "lateral_relaxation": Deviation("m", 0.4),
    "longitudinal_relaxation": Deviation("m", 0.4),
    "wheel_inertia": Deviation("kg m^2", 0.3),
    "differential_preload": Deviation("N m", 100.0, relative=False),
    "differential_share": Deviation("-", 0.2, relative=False, high=1.0),
    "ackermann": Deviation("-", 0.3, relative=False, high=1.5),
    "steering_compliance": Deviation("rad/N", 0.6),
}


def value_of(name: str, car: DoubleTrackConstants) -> float:
    """What a quantity of `DEVIATIONS` is on a car; of the tyres, the rear one's."""
    total = car.front_roll_stiffness + car.rear_roll_stiffness
    if name == "roll_stiffness":
        return float(total)
    if name == "front_roll_share":
        return float(car.front_roll_stiffness / total)
    return float(getattr(car if name in car._fields else car.rear_tire, name))


def deviated(car: DoubleTrackConstants, by: Mapping[str, float], effects: Effects) -> DoubleTrackConstants:
    """The car with its quantities of `DEVIATIONS` so many standard deviations off; effects: those that it has."""
    own = {name: deviation.moved(value_of(name, car), by.get(name, 0.0)) for name, deviation in DEVIATIONS.items()}
    total, share = own.pop("roll_stiffness"), own.pop("front_roll_share")
    longitudinal = {name: own.pop(name) / value_of(name, car) for name in ("longitudinal_stiffness",
                                                                          "longitudinal_friction")}  # fmt: skip
    # It is a part of what turns with the axle.
    own["wheel_inertia"] = min(own["wheel_inertia"],
                               LARGEST_WHEELS * float(changed_constants(car, effects).rear_axle_inertia))  # fmt: skip
    of_tires = {name: own.pop(name) for name in tuple(own) if name in TireConstants._fields}

    def tire(before: TireConstants) -> TireConstants:
        scaled = {name: factor * getattr(before, name) for name, factor in longitudinal.items()}
        return before._replace(**scaled, **of_tires)

    return car._replace(
        **own, front_roll_stiffness=total * share, rear_roll_stiffness=total * (1.0 - share),
        front_tire=tire(car.front_tire), rear_tire=tire(car.rear_tire),
    )  # fmt: skip
